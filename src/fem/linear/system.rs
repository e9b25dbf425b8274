//! What is solved, and what a solver answers.

use super::super::element::NodalTangent;
use super::super::reduce::by_rows;
use super::super::sparse::{Block, BlockMatrix};

/// A tangent: sparse blocks and, for elements with averaged deformation, the nodes' part on top.
pub(in super::super) struct Tangent {
    pub matrix: BlockMatrix,
    pub nodal: Option<NodalTangent>,
    /// What walls and springs are of the diagonal blocks of their rows: what changes most from one tangent to the next.
    pub walls: Vec<(u32, Block)>,
}

/// How good a solution is to be.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Within {
    /// |rhs - K x| as a part of |rhs|.
    Residual(f64),
    /// sqrt(e . K e) of its error e, as the preconditioner tells it, as a part of sqrt(x . K x). A stiff wall weighs much in a
    /// residual and little here.
    Energy(f64),
}

impl Within {
    /// What a solver asks of the residual that knows nothing else.
    pub(in super::super) fn residual(self) -> f64 {
        match self {
            Self::Residual(part) => part,
            Self::Energy(part) => 1e-3 * part,
        }
    }
}

/// How a linear solve went.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct LinearReport {
    /// Iterations (0 for a direct solve).
    pub iterations: usize,
    /// Whether the residual asked for was reached.
    pub reached: bool,
    /// A direction of negative curvature was met: the matrix is not positive definite.
    pub negative_curvature: bool,
}

/// Solves `tangent x = rhs`.
pub(in super::super) trait LinearSolver: Send {
    /// Takes up a new tangent; to be called before the first solve with it.
    fn prepare(&mut self, tangent: &Tangent);

    /// The same for one of many tangents that change little from one to the next: a preconditioner is that of the last one that
    /// was taken up `anew`.
    fn take_up(&mut self, tangent: &Tangent, anew: bool) {
        let _ = anew;
        self.prepare(tangent);
    }

    /// `x` comes back as the best solution found, also when the report says that it was not reached; on negative
    /// curvature it is a descent direction.
    fn solve(&mut self, tangent: &Tangent, rhs: &[[f64; 3]], x: &mut [[f64; 3]], within: Within) -> LinearReport;
}

impl Tangent {
    /// y = K x in double precision.
    pub(in super::super) fn product(&self, x: &[[f64; 3]], y: &mut [[f64; 3]]) {
        self.matrix.product(x, y);
        if let Some(nodal) = &self.nodal {
            nodal.add_product(x, y);
        }
    }

    /// K + factor other.
    pub(in super::super) fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut walls = self.walls.clone();
        walls.extend(other.walls.iter().map(|(row, block)| (*row, block.map(|x| factor * x))));
        let mut sum = Self { matrix: self.matrix.clone(), nodal: self.nodal.clone(), walls };
        by_rows(&mut sum.matrix.blocks, |first, blocks| add_scaled(blocks, factor, &other.matrix.blocks[first..]));
        if let (Some(own), Some(more)) = (&mut sum.nodal, &other.nodal) {
            by_rows(&mut own.moduli, |first, moduli| add_scaled(moduli, factor, &more.moduli[first..]));
        }
        sum
    }

    /// The 3 x 3 diagonal blocks of all rows, column-major.
    pub(in super::super) fn diagonal_blocks(&self) -> Vec<[f64; 9]> {
        let mut blocks: Vec<Block> =
            self.matrix.pattern.diagonal.iter().map(|&at| self.matrix.blocks[at as usize]).collect();
        if let Some(nodal) = &self.nodal {
            nodal.add_diagonal_blocks(&mut blocks);
        }
        blocks
    }
}

fn add_scaled<const N: usize>(a: &mut [[f64; N]], factor: f64, b: &[[f64; N]]) -> [f64; 0] {
    a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += factor * b);
    []
}

#[cfg(test)]
mod tests {
    use crate::fem::model::Projected;
    use crate::fem::{Model, Scenario};
    use crate::mesh::TetMesh;

    #[test]
    fn diagonal_blocks_are_those_of_the_products_with_unit_vectors() {
        // Two tissues around an edge, one end of which slides in a plane.
        let nodes = vec![
            [0.0, 0.0, 0.0],
            [1.0, 8.0, 0.0],
            [9.0, 0.0, 1.0],
            [0.0, -7.0, 2.0],
            [-8.0, 1.0, 0.0],
            [0.5, 1.0, 9.0],
        ];
        let tets = vec![[0, 2, 1, 5], [0, 3, 2, 5], [0, 4, 3, 5], [0, 1, 4, 5]];
        let mut mesh = TetMesh::new(nodes, tets, vec![2, 2, 3, 3]).unwrap();
        mesh.set_nodes("ring", vec![1, 2]).unwrap();
        mesh.set_nodes("end", vec![0]).unwrap();
        let material = "law = 'neo-hookean'\nshear_modulus_pa = 900.0\npoisson_ratio = 0.45\n";
        let scenario = Scenario::from_toml(&format!(
            "fixed = ['ring']\n[[prescribed]]\nset = 'end'\ndisplacement_mm = [0, 0, 0]\n\
             components = [false, true, false]\n[materials.grey_matter]\n{material}\
             [materials.white_matter]\n{material}[solver]\nelement = 'tet4-nodal'\n"
        ))
        .unwrap();
        let model = Model::new(&mesh, &scenario).unwrap();
        let bent = |n: usize| [0.3 * n as f64, 0.1 * (n * n % 5) as f64, -0.2 * (n % 3) as f64];
        let state = model.state(&(0..6).map(bent).collect::<Vec<_>>()).unwrap();
        let laws = model.laws(&scenario.materials).unwrap();
        let tangent = model.tangent(&state.u, &laws, &mut [[0.0; 3]; 6], Projected::Nothing, None);
        let blocks = tangent.diagonal_blocks();
        assert_eq!(blocks.len(), 4);
        let largest = blocks.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        for (row, block) in blocks.iter().enumerate() {
            for k in 0..3 {
                let (mut unit, mut product) = (vec![[0.0; 3]; 4], vec![[0.0; 3]; 4]);
                unit[row][k] = 1.0;
                tangent.product(&unit, &mut product);
                let held = model.held_components.as_ref().unwrap()[row];
                for r in 0..3 {
                    if !held[r] && !held[k] {
                        let off = block[r + 3 * k] - product[row][r];
                        assert!(off.abs() < 1e-12 * largest, "{row} {r} {k}: {off}");
                    } else if r != k {
                        assert_eq!(block[r + 3 * k], 0.0, "{row} {r} {k}");
                    }
                }
            }
        }
    }
}

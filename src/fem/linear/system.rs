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
    pub(super) fn residual(self) -> f64 {
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

    /// The 3 x 3 diagonal block of a row, column-major.
    pub(in super::super) fn diagonal_block(&self, row: usize) -> [f64; 9] {
        let mut block = self.matrix.blocks[self.matrix.pattern.diagonal[row] as usize];
        if let Some(nodal) = &self.nodal {
            nodal.add_diagonal_block(row, &mut block);
        }
        block
    }
}

fn add_scaled<const N: usize>(a: &mut [[f64; N]], factor: f64, b: &[[f64; N]]) -> [f64; 0] {
    a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += factor * b);
    []
}

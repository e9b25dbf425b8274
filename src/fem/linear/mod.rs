//! Solvers for the symmetric linear systems of Newton's method, behind one interface; one file per method.

mod block_jacobi;
mod operator;
mod pcg;

pub(super) use pcg::Pcg;

use super::element::Dilation;
use super::model::Model;
use super::scenario::LinearMethod;
use super::sparse::BlockMatrix;

/// A tangent: sparse blocks and, for elements with averaged volume, a low-rank part on top.
pub(super) struct Tangent {
    pub matrix: BlockMatrix,
    pub dilation: Option<Dilation>,
}

/// How a linear solve went.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LinearReport {
    /// Iterations (0 for a direct solve).
    pub iterations: usize,
    /// Whether the residual asked for was reached.
    pub reached: bool,
    /// A direction of negative curvature was met: the matrix is not positive definite.
    pub negative_curvature: bool,
}

/// Solves `tangent x = rhs` until |rhs - tangent x| <= tolerance |rhs|.
pub(super) trait LinearSolver: Send {
    /// Takes up a new tangent; to be called before the first solve with it.
    fn prepare(&mut self, tangent: &Tangent);

    /// `x` comes back as the best solution found, also when the report says that it was not reached; on negative
    /// curvature it is a descent direction.
    fn solve(&mut self, tangent: &Tangent, rhs: &[[f64; 3]], x: &mut [[f64; 3]], tolerance: f64) -> LinearReport;
}

impl Tangent {
    /// y = (K + sum_a w_a b_a b_a^T) x in double precision.
    pub(super) fn product(&self, x: &[[f64; 3]], y: &mut [[f64; 3]]) {
        self.matrix.product(x, y);
        if let Some(dilation) = &self.dilation {
            let inner: Vec<f64> = (0..dilation.weights.len())
                .map(|g| {
                    let range = dilation.row_start[g]..dilation.row_start[g + 1];
                    let sum: f64 = dilation.rows[range.clone()]
                        .iter()
                        .zip(&dilation.values[range])
                        .map(|(&r, v)| (0..3).map(|i| v[i] * x[r as usize][i]).sum::<f64>())
                        .sum();
                    dilation.weights[g] * sum
                })
                .collect();
            for (row, out) in y.iter_mut().enumerate() {
                for &(g, at) in &dilation.group_positions[dilation.group_start[row]..dilation.group_start[row + 1]] {
                    let v = dilation.values[at as usize];
                    (0..3).for_each(|i| out[i] += inner[g as usize] * v[i]);
                }
            }
        }
    }

    /// The 3 x 3 diagonal block of a row, column-major.
    pub(super) fn diagonal_block(&self, row: usize) -> [f64; 9] {
        let mut block = self.matrix.blocks[self.matrix.pattern.diagonal[row] as usize];
        if let Some(dilation) = &self.dilation {
            for &(g, at) in &dilation.group_positions[dilation.group_start[row]..dilation.group_start[row + 1]] {
                let (v, w) = (dilation.values[at as usize], dilation.weights[g as usize]);
                for c in 0..3 {
                    for r in 0..3 {
                        block[3 * c + r] += w * v[r] * v[c];
                    }
                }
            }
        }
        block
    }
}

/// The solver a model's settings ask for.
pub(super) fn automatic(model: &Model) -> Box<dyn LinearSolver> {
    let blocks = model.scenario.solver.linear != LinearMethod::PcgJacobi;
    Box::new(Pcg::new(blocks, 20_000 + 10 * model.free_nodes()))
}

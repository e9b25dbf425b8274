//! Solvers for the symmetric linear systems of Newton's method, behind one interface; one file per method.

mod block_jacobi;
mod coarse;
mod direct;
mod dissection;
mod factor;
mod operator;
mod pcg;

use coarse::Rows;
pub(super) use direct::Direct;
pub(super) use factor::Symbolic;
pub(super) use pcg::Pcg;

use super::element::NodalTangent;
use super::model::Model;
use super::reduce::by_rows;
use super::scenario::LinearMethod;
use super::sparse::BlockMatrix;

/// A tangent: sparse blocks and, for elements with averaged deformation, the nodes' part on top.
pub(super) struct Tangent {
    pub matrix: BlockMatrix,
    pub nodal: Option<NodalTangent>,
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
    /// y = K x in double precision.
    pub(super) fn product(&self, x: &[[f64; 3]], y: &mut [[f64; 3]]) {
        self.matrix.product(x, y);
        if let Some(nodal) = &self.nodal {
            nodal.add_product(x, y);
        }
    }

    /// K + factor other.
    pub(super) fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut sum = Self { matrix: self.matrix.clone(), nodal: self.nodal.clone() };
        by_rows(&mut sum.matrix.blocks, |first, blocks| add_scaled(blocks, factor, &other.matrix.blocks[first..]));
        if let (Some(own), Some(more)) = (&mut sum.nodal, &other.nodal) {
            by_rows(&mut own.moduli, |first, moduli| add_scaled(moduli, factor, &more.moduli[first..]));
        }
        sum
    }

    /// The 3 x 3 diagonal block of a row, column-major.
    pub(super) fn diagonal_block(&self, row: usize) -> [f64; 9] {
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

/// Poisson's ratio from which a factor is cheaper than conjugate gradients with a Jacobi preconditioner. Measured on
/// brain5k (tet4, CPU-s by factor and by iteration): .23 and .11 at nu = .45, .29 and .35 at .499; Cook's membrane of
/// n = 16 (averaged element): .6 and 18 at .4999.
const STIFF_RATIO: f64 = 0.4985;

/// Most free nodes for which that holds: a factor's work grows with the square of their number, an iteration's with
/// the power 4/3.
const MOST_FACTORED: usize = 12_000;

/// The solver a model's settings ask for, with materials up to this Poisson's ratio.
pub(super) fn for_model(model: &Model, largest_ratio: f64) -> Box<dyn LinearSolver> {
    let method = model.scenario.solver.linear;
    let iterative = |blocks| Box::new(Pcg::new(blocks, 20_000 + 10 * model.free_nodes(), None));
    let two_level = || {
        let (positions, held) = (model.positions_of_rows(), model.held_components.clone());
        let rows = Rows { positions, held, change: !model.supports.is_empty() };
        Box::new(Pcg::new(true, 20_000 + 10 * model.free_nodes(), Some(rows)))
    };
    match method {
        LinearMethod::PcgJacobi => return iterative(false),
        LinearMethod::PcgBlockJacobi => return iterative(true),
        LinearMethod::Auto if largest_ratio < STIFF_RATIO || model.free_nodes() > MOST_FACTORED => {
            return two_level();
        }
        LinearMethod::Auto | LinearMethod::Direct => (),
    }
    match model.symbolic() {
        Some(symbolic) => Box::new(Direct::new(symbolic)),
        None => two_level(),
    }
}

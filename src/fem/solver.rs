//! Which linear solver a model gets.

use super::linear::{Direct, LinearSolver, Pcg, Rows};
use super::model::Model;
use super::scenario::LinearMethod;

/// Poisson's ratio from which a factor is cheaper than conjugate gradients with a Jacobi preconditioner
/// (docs/evidence/choices.md).
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

//! Elements, assembly, boundary conditions, solvers, integrators, units.
//!
//! [`simulate`] answers one [`Scenario`] on one mesh; [`Model`] keeps what does not depend on the materials for sweeps
//! and estimation. Inside, everything is SI and in a numbering of its own; outside, mm and the mesh's numbering.

mod buoyancy;
mod check;
mod contact;
mod dynamics;
mod element;
mod equilibrium;
mod error;
mod hinge;
mod linear;
pub mod live;
mod load;
#[cfg(test)]
mod manufactured;
mod mass;
mod measured;
mod mixture;
mod model;
mod order;
mod outcome;
mod portion;
mod reduce;
mod remarks;
mod scenario;
mod sensitivity;
mod sharing;
mod solver;
mod sparse;
mod state;
mod stiffness;
pub mod units;
mod warning;

pub use contact::{Contact, ContactOutcome, Support, Tether, TetherOutcome, Wall};
pub use element::ElementKind;
pub use error::FemError;
pub(crate) use linear::Within;
pub use load::Load;
pub use model::Model;
pub use outcome::{ConvergenceRecord, Frame, Motion, NewtonIteration, Outcome, Progress};
pub use scenario::{
    CsfLevel, DynamicsSettings, LinearMethod, Loads, MassKind, Materials, Method, PatchLoad, Prescribed, PressureLoad,
    Scenario, ScenarioError, SolverSettings,
};
pub use sensitivity::By;
pub use state::State;
pub use stiffness::Stiffness;
pub use warning::{FemWarning, Idle};

use crate::mesh::TetMesh;
use remarks::with_remarks;

/// One deformation, or one motion: the mesh under the scenario's loads.
///
/// # Errors
/// [`FemError`] names what is wrong with the input, or why there is no equilibrium.
pub fn simulate(mesh: &TetMesh, scenario: &Scenario, progress: &dyn Fn(&Progress)) -> Result<Outcome, FemError> {
    check::check_supports(mesh, scenario)?;
    let model = Model::new(mesh, scenario)?;
    let found = match scenario.solver.method {
        Method::Static => model.solve(&scenario.materials, None, progress).map(|(outcome, _)| outcome),
        Method::BackwardEuler => model.run(&scenario.materials, progress),
    };
    found.map(|outcome| with_remarks(mesh, scenario, outcome))
}

/// [`simulate`] from a displacement of the nodes (mm) near the answer, such as that of neighbouring materials: fewer
/// iterations, the same equilibrium within the residual asked for. A start that leads nowhere, or from
/// cells inside out to an equilibrium of higher energy, is dropped for rest.
///
/// # Errors
/// As [`simulate`]; a start of another length or with numbers that are not finite is refused.
pub fn simulate_from(
    mesh: &TetMesh,
    scenario: &Scenario,
    start_mm: &[[f64; 3]],
    progress: &dyn Fn(&Progress),
) -> Result<Outcome, FemError> {
    check::check_supports(mesh, scenario)?;
    let model = Model::new(mesh, scenario)?;
    let start = model.state(start_mm)?;
    let found = model.solve(&scenario.materials, Some(&start), progress);
    found.map(|(outcome, _)| with_remarks(mesh, scenario, outcome))
}

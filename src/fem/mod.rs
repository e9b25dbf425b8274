//! Elements, assembly, boundary conditions, solvers, integrators, units.
//!
//! [`simulate`] answers one [`Scenario`] on one mesh; [`Model`] keeps what does not depend on the materials for sweeps
//! and estimation. Inside, everything is SI and in a numbering of its own; outside, mm and the mesh's numbering.

mod element;
mod equilibrium;
mod error;
mod linear;
mod load;
mod model;
mod order;
mod outcome;
mod reduce;
mod scenario;
mod sparse;
pub mod units;

pub use element::ElementKind;
pub use equilibrium::State;
pub use error::FemError;
pub use model::{Materials, Model};
pub use outcome::{ConvergenceRecord, NewtonIteration, Outcome, Progress};
pub use scenario::{
    CsfLevel, DynamicsSettings, LinearMethod, Loads, MassKind, Method, PatchLoad, Prescribed, PressureLoad, Scenario,
    ScenarioError, SolverSettings,
};

use crate::mesh::TetMesh;

/// One deformation: the mesh under the scenario's loads.
///
/// # Errors
/// [`FemError`] names what is wrong with the input, or why there is no equilibrium.
pub fn simulate(mesh: &TetMesh, scenario: &Scenario, progress: &dyn Fn(&Progress)) -> Result<Outcome, FemError> {
    let model = Model::new(mesh, scenario)?;
    model.solve(&scenario.materials, None, progress).map(|(outcome, _)| outcome)
}

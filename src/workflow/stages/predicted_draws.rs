//! The draws of a prediction as its case keeps them: modes on the mesh, and a table of coordinates.

use crate::experiment::predict::{DrawnState, Modes, draws_from_csv, mode_name};
use crate::layout::{PREDICTED_DRAWS, PREDICTED_STATE};
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use crate::workflow::case::Case;
use crate::workflow::error::{CaseError, PredictError, WorkflowError};
use nalgebra::Vector3;

/// Tissue that moves by more than the threshold, cc: of a tetrahedron, the share of its corners that do.
pub(super) fn over_threshold_cc(mesh: &TetMesh, displacement_mm: &[[f64; 3]], threshold_mm: f64) -> f64 {
    let over: Vec<f64> =
        displacement_mm.iter().map(|u| f64::from(u8::from(Vector3::from(*u).norm() > threshold_mm))).collect();
    let of = |t: usize| mesh.tets()[t].iter().map(|&n| over[n as usize]).sum::<f64>() / 4.0 * mesh.volume_mm3(t);
    (0..mesh.tets().len()).map(of).sum::<f64>() / 1000.0
}

/// The modes as arrays on the nodes.
pub(super) fn mode_fields(modes: &Modes) -> impl Iterator<Item = Field> + '_ {
    modes.modes_mm.iter().enumerate().map(|(n, mode)| Field::vector(&mode_name(n), mode))
}

/// A state of a prediction.
#[derive(Debug)]
pub(crate) struct Predicted {
    /// The undeformed mesh, MNI.
    pub mesh: TetMesh,
    /// Its draws, MNI.
    pub modes: Modes,
}

/// Reads the draws of a state.
///
/// # Errors
/// A case whose prediction an earlier version has made, or files that do not belong together.
pub(crate) fn read_draws(case: &Case, state: &str) -> Result<Predicted, WorkflowError> {
    let draws = read_table(case, state)?;
    let mesh = PREDICTED_STATE.of(state);
    let read = vtu::decode(&case.read_made(&mesh)?, &mesh)?;
    let vectors = |name: &str| read.point_field(name).and_then(Field::vectors).ok_or_else(|| damaged(case, &mesh));
    let mean_mm = vectors("displacement")?;
    let count = draws.first().map_or(0, |draw| draw.coordinates.len());
    let modes_mm = (0..count).map(|n| vectors(&mode_name(n))).collect::<Result<Vec<_>, _>>()?;
    Ok(Predicted { modes: Modes { mean_mm, modes_mm, draws }, mesh: read.mesh })
}

/// The table of a state's draws alone.
fn read_table(case: &Case, state: &str) -> Result<Vec<DrawnState>, WorkflowError> {
    let table = PREDICTED_DRAWS.of(state);
    if !case.path(&table).exists() {
        return Err(PredictError::NoDraws { folder: case.folder().to_path_buf(), file: table }.into());
    }
    let text = String::from_utf8(case.read_made(&table)?).map_err(|_| damaged(case, &table))?;
    Ok(draws_from_csv(&text).map_err(|_| damaged(case, &table))?)
}

fn damaged(case: &Case, file: &str) -> CaseError {
    CaseError::Damaged { folder: case.folder().to_path_buf(), file: file.to_owned(), subject: case.subject() }
}

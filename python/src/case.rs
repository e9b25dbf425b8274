//! What a case folder holds.

use crate::arrays::{array2, rows};
use crate::errors::{raised, refused};
use crate::mesh::field_array;
use hgm::cli::Failure;
use hgm::layout;
use hgm::overlay::PointState;
use hgm::workflow::{Case, WarpTo, named_state, warp_points as carried};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

fn said<T>(py: Python<'_>, read: impl FnOnce() -> Result<T, Failure> + Send) -> PyResult<T>
where
    T: Send,
{
    py.detach(read).map_err(|failure| raised(py, &failure))
}

/// Refuses a folder that no job has filled.
#[pyfunction]
pub fn case_check(py: Python<'_>, folder: PathBuf) -> PyResult<()> {
    said(py, || Ok(Case::open(folder).map(|_| ())?))
}

/// The numbers of `sim/outcome.json`, read as the library reads them, as JSON.
#[pyfunction]
pub fn case_outcome(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    said(py, || Ok(serde_json::to_string(&Case::open(folder)?.outcome()?)?))
}

/// The settings it was made with, as JSON.
#[pyfunction]
pub fn case_settings(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    said(py, || Ok(serde_json::to_string(&Case::open(folder)?.settings()?)?))
}

/// The state that is meant: the one named, as far as the outcome was made with it, else the estimate or the best sample.
#[pyfunction]
pub fn case_state(py: Python<'_>, folder: PathBuf, state: Option<&str>) -> PyResult<String> {
    said(py, || Ok(named_state(&Case::open(folder)?, state)?))
}

/// The bytes of a file of numbers, where the outcome was made with it.
#[pyfunction]
pub fn case_file(py: Python<'_>, folder: PathBuf, file: &str) -> PyResult<Py<PyBytes>> {
    let bytes = said(py, || Ok(Case::open(folder)?.present_file(file)?))?;
    Ok(PyBytes::new(py, &bytes).unbind())
}

/// Refuses a file that was changed, or that is not of the outcome where there is one.
#[pyfunction]
pub fn case_check_file(py: Python<'_>, folder: PathBuf, file: &str) -> PyResult<()> {
    said(py, || Ok(Case::open(folder)?.check_file(file)?))
}

/// An array of a state; of the best sample where none is named.
#[pyfunction]
pub fn case_array<'py>(
    py: Python<'py>,
    folder: PathBuf,
    name: &str,
    state: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let field = said(py, || {
        let case = Case::open(folder)?;
        Ok(match state {
            Some(state) => case.field_in(state, name)?,
            None => case.field(name)?,
        })
    })?;
    field_array(py, field)
}

/// What a reader of points that a case has carried must know.
#[pyfunction]
pub fn case_doubts(py: Python<'_>, folder: PathBuf) -> PyResult<Vec<String>> {
    said(py, || Ok(Case::open(folder)?.gate_warnings().iter().map(ToString::to_string).collect()))
}

/// Points carried by a case: where they are now, their standard deviations (NaN where not known), where they lay, the state.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "four things of one call")]
pub fn case_points<'py>(
    py: Python<'py>,
    folder: PathBuf,
    points: PyReadonlyArray2<'py, f64>,
    to: &str,
    state: Option<&str>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Vec<f64>, Vec<&'static str>, String)> {
    let to: WarpTo = serde_json::from_value(to.into())
        .map_err(|_| refused(py, &format!("to: `{to}`: say post, deformed, pre or mni")))?;
    let points = rows::<_, 3>(py, "points", &points)?.to_vec();
    let (state, found) = said(py, || Ok(carried(&Case::open(folder)?, to, state, &points)?))?;
    let sd = found.iter().map(|one| one.sd_mm.unwrap_or(f64::NAN)).collect();
    let lay = found.iter().map(|one| word(one.state)).collect();
    Ok((array2(py, found.iter().map(|one| one.mm).collect())?, sd, lay, state))
}

fn word(state: PointState) -> &'static str {
    match state {
        PointState::Tissue => "tissue",
        PointState::Fluid => "fluid",
        PointState::Removed => "removed",
        PointState::Outside => "outside",
        PointState::Rigid => "rigid",
        PointState::Moved => "moved",
    }
}

/// Names of a case's files, by what they are; a part in braces stands for the state.
#[pyfunction]
pub fn names(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let names = PyDict::new(py);
    for (key, path) in [
        ("mask brain pre native", layout::PRE_NATIVE_BRAIN),
        ("mask brain pre mni", layout::PRE_BRAIN),
        ("mask brain post native", layout::POST_NATIVE_BRAIN),
        ("mask brain post mni", layout::POST_BRAIN),
        ("mask resected native", layout::NATIVE_RESECTED),
        ("mask resected mni", layout::RESECTED),
        ("mask cavity native", layout::NATIVE_CAVITY),
        ("mask cavity mni", layout::CAVITY),
        ("mask ventricle post mni", layout::POST_VENTRICLE),
        ("labels native", layout::PRE_NATIVE_LABELS),
        ("labels mni", layout::PRE_LABELS),
        ("field deformed", layout::SHIFT.0),
        ("field undeformed", layout::SHIFT_BACK.0),
        ("field post", layout::POST_FROM_PRE_FIELD.0),
        ("field pre", layout::PRE_FROM_POST_FIELD.0),
        ("sd", layout::SHIFT_SD.0),
        ("reach95", layout::SHIFT_REACH.0),
        ("believed", layout::SHIFT_MASK.0),
        ("mesh", layout::REST_MESH),
        ("state", layout::SAMPLE_STATE.0),
        ("samples", layout::SAMPLES_TABLE),
        ("prediction", layout::PREDICTION_JSON),
        ("evaluation", layout::EVALUATION_JSON),
        ("brain shift", layout::SHIFT_JSON),
        ("estimate", layout::ESTIMATE_JSON),
        ("page", layout::PAGE),
    ] {
        names.set_item(key, path)?;
    }
    Ok(names)
}

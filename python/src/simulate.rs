//! One deformation of a mesh that was given as arrays.

use crate::arrays::{array1, array2, rows};
use crate::errors::{raised, refused};
use crate::job;
use crate::mesh::mesh_arrays;
use hgm::cli::Failure;
use hgm::fem::{Outcome, Scenario};
use hgm::mesh::TetMesh;
use hgm::workflow::{SimulationError, WorkflowError, in_words, simulate_mesh};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// How the scenario is called in messages.
const NAME: &str = "scenario";

/// Sets of nodes, and of facets (three nodes each).
type Sets = (BTreeMap<String, Vec<u32>>, BTreeMap<String, Vec<[u32; 3]>>);

fn mesh(
    py: Python<'_>,
    points: &PyReadonlyArray2<'_, f64>,
    cells: &PyReadonlyArray2<'_, u32>,
    labels: &PyReadonlyArray1<'_, u8>,
    (nodes, facets): Sets,
) -> PyResult<TetMesh> {
    let (points, cells) = (rows::<_, 3>(py, "points", points)?, rows::<_, 4>(py, "cells", cells)?);
    let made = TetMesh::new(points.to_vec(), cells.to_vec(), labels.as_array().to_vec()).and_then(|mut mesh| {
        for (name, set) in nodes {
            mesh.set_nodes(&name, set)?;
        }
        Ok(mesh)
    });
    let mut mesh = made.map_err(|error| refused(py, &error.to_string()))?;
    for (name, set) in facets {
        let count = mesh.nodes_mm().len();
        if let Some(node) = set.iter().flatten().find(|&&node| node as usize >= count) {
            return Err(refused(py, &format!("set `{name}` names node {node}, but there are only {count} nodes")));
        }
        mesh.facet_sets.insert(name, set);
    }
    Ok(mesh)
}

/// A scenario from TOML, or from the same as JSON.
fn scenario(text: &str, json: bool) -> Result<Scenario, Failure> {
    let refused = |reason| WorkflowError::from(SimulationError::Scenario { name: NAME.to_owned(), reason });
    let text = if json { crate::toml_of_json(text).map_err(refused)? } else { text.to_owned() };
    Scenario::from_toml(&text)
        .map_err(|error| {
            let said = error.to_string();
            // The lines of a dictionary are nobody's.
            let of_line = said.split_once(": ").filter(|(line, _)| json && line.starts_with("line "));
            refused(in_words(of_line.map_or(&said, |(_, reason)| reason)))
        })
        .map_err(Failure::of_input)
}

/// The deformed state; `json` says which of the two the scenario's text is.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "the arrays of one mesh")]
pub fn simulate<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    cells: PyReadonlyArray2<'py, u32>,
    labels: PyReadonlyArray1<'py, u8>,
    nodes: BTreeMap<String, Vec<u32>>,
    facets: BTreeMap<String, Vec<[u32; 3]>>,
    text: &str,
    json: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let scenario = scenario(text, json).map_err(|failure| raised(py, &failure))?;
    let mesh = mesh(py, &points, &cells, &labels, (nodes, facets))?;
    let work = move |ear: Arc<Mutex<job::Ear>>| -> Result<(TetMesh, Outcome), Failure> {
        // Cut open along sheets that slide: results stand on the mesh as it was computed.
        let refused = |source| WorkflowError::from(SimulationError::Fem { names: NAME.to_owned(), source });
        let body = scenario.body(&mesh).map_err(refused)?.into_owned();
        let mut ear = ear.lock().unwrap_or_else(PoisonError::into_inner);
        let outcome = simulate_mesh(&body, &scenario, None, &mut *ear).map_err(refused)?;
        Ok((body, outcome))
    };
    let (body, outcome) = job::run(py, progress.as_ref(), work)?.map_err(|failure| raised(py, &failure))?;
    let found = mesh_arrays(py, &body)?;
    found.set_item("displacement_mm", array2(py, outcome.displacement_mm)?)?;
    found.set_item("reaction_n", array2(py, outcome.reaction_n)?)?;
    found.set_item("jacobian", array1(py, outcome.jacobian))?;
    found.set_item("strain_energy_density_pa", array1(py, outcome.strain_energy_density_pa))?;
    if !outcome.contact.is_empty() {
        found.set_item("contact_pressure_pa", array1(py, outcome.contact_pressure_pa))?;
    }
    let record = serde_json::json!({
        "convergence": outcome.convergence,
        "contact": outcome.contact,
        "tethers": outcome.tethers,
        "motion": outcome.motion,
        "warnings": outcome.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    found.set_item("record", record.to_string())?;
    Ok(found)
}

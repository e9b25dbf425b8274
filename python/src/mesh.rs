//! Meshes as arrays, and label maps between arrays and NIfTI.

use crate::arrays::{array1, array2};
use crate::errors::{raised, refused};
use hgm::cli::Failure;
use hgm::geometry::Native;
use hgm::image::nifti::{ReadOptions, decode_labels, encode_u8};
use hgm::image::{Grid, Volume};
use hgm::mesh::TetMesh;
use hgm::mesh::format::{Field, vtu};
use hgm::workflow::read_input;
use nalgebra::Matrix4;
use numpy::{PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Points, cells, labels and sets.
pub fn mesh_arrays<'py>(py: Python<'py>, mesh: &TetMesh) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("points", array2(py, mesh.nodes_mm().to_vec())?)?;
    found.set_item("cells", array2(py, mesh.tets().to_vec())?)?;
    found.set_item("labels", array1(py, mesh.labels().to_vec()))?;
    let (nodes, facets) = (PyDict::new(py), PyDict::new(py));
    for (name, set) in &mesh.node_sets {
        nodes.set_item(name, array1(py, set.clone()))?;
    }
    for (name, set) in &mesh.facet_sets {
        facets.set_item(name, array2(py, set.clone())?)?;
    }
    found.set_item("sets", nodes)?;
    found.set_item("facets", facets)?;
    Ok(found)
}

/// One array of a state: a number, or a row of numbers, for each node or cell.
pub fn field_array(py: Python<'_>, field: Field) -> PyResult<Bound<'_, PyAny>> {
    let (rows, columns) = (field.values.len() / field.components.max(1), field.components);
    let values = array1(py, field.values);
    if columns == 1 { Ok(values.into_any()) } else { Ok(values.reshape([rows, columns])?.into_any()) }
}

/// A mesh file (.vtu) with what stands on its nodes and cells.
#[pyfunction]
pub fn read_mesh(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let read = move || {
        let name = path.display().to_string();
        vtu::decode(&read_input(&path)?, &name).map_err(Failure::of_input)
    };
    let state = py.detach(read).map_err(|failure: Failure| raised(py, &failure))?;
    let found = mesh_arrays(py, &state.mesh)?;
    let (points, cells) = (PyDict::new(py), PyDict::new(py));
    for field in state.point_fields {
        points.set_item(field.name.clone(), field_array(py, field)?)?;
    }
    for field in state.cell_fields {
        cells.set_item(field.name.clone(), field_array(py, field)?)?;
    }
    for (&label, of) in state.mesh.fractions() {
        cells.set_item(vtu::fraction_name(label), array1(py, of.clone()))?;
    }
    found.set_item("point_data", points)?;
    found.set_item("cell_data", cells)?;
    Ok(found)
}

/// A label map as the bytes of a NIfTI file (.nii.gz): values with i fastest, and the affine.
#[pyfunction]
pub fn encode_label_map(
    py: Python<'_>,
    dims: [usize; 3],
    values: PyReadonlyArray1<'_, u8>,
    affine: PyReadonlyArray2<'_, f64>,
) -> PyResult<Vec<u8>> {
    let affine = Matrix4::from_fn(|r, c| affine.get([r, c]).copied().unwrap_or(f64::NAN));
    // A file keeps three rows of it.
    if affine.row(3).iter().ne(&[0.0, 0.0, 0.0, 1.0]) {
        return Err(refused(py, "affine: last row is not 0 0 0 1: give voxel indices to mm (RAS+), not transposed"));
    }
    let Some(grid) = Grid::<Native>::new(dims, affine) else {
        return Err(refused(py, "affine: a number that is not finite, or no inverse: give voxel indices to mm (RAS+)"));
    };
    let data = values.as_array().to_vec();
    if data.len() != grid.len() {
        return Err(refused(py, &format!("labels: {} values for {} voxels", data.len(), grid.len())));
    }
    Ok(py.detach(|| encode_u8(&Volume::from_data(grid, data))))
}

/// A label map of a NIfTI file and its affine.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "an array and its affine, as Python takes them")]
pub fn read_label_map(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyArray3<u8>>, [[f64; 4]; 4])> {
    let read = move || {
        let name = path.display().to_string();
        decode_labels(&read_input(&path)?, &name, &ReadOptions::default()).map_err(Failure::of_input)
    };
    let (labels, _) = py.detach(read).map_err(|failure: Failure| raised(py, &failure))?;
    let [i, j, k] = labels.grid.dims;
    let affine = labels.grid.mm_from_voxel;
    // i is the fastest: the array is the transpose of what lies in memory.
    let array = array1(py, labels.data).reshape([k, j, i])?.permute(Some([2, 1, 0]))?;
    Ok((array, std::array::from_fn(|r| std::array::from_fn(|c| affine[(r, c)]))))
}

//! `hgm._hgm`: the library for the Python package `hgm`, which has the documented names. Arrays and words go in, the library's
//! functions are called without Python's lock, arrays and JSON come back. Nothing is computed here, and nothing is unsafe but
//! what PyO3 generates.

mod arrays;
mod case;
mod errors;
mod job;
mod mesh;
mod prior;
mod simulate;

use hgm::cli::Called;
use hgm::workflow::{Progress, Settings, SettingsError};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// The text of a TOML file from the same as JSON; a sentence where there is no such file.
fn toml_of_json(text: &str) -> Result<String, String> {
    let value: toml::Table = serde_json::from_str(text).map_err(|error| error.to_string())?;
    toml::to_string(&value).map_err(|error| error.to_string())
}

/// The command `hgm`: the one job of its process. Returns the exit code.
#[pyfunction]
fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| hgm::cli::main_with(words))
}

/// One command of `hgm` within Python: what it prints with `--json`. Programs are looked for beside `beside`.
#[pyfunction]
fn call(
    py: Python<'_>,
    words: Vec<OsString>,
    beside: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Option<String>> {
    let work = move |ear: Arc<Mutex<job::Ear>>| -> Called {
        let ear: Arc<Mutex<dyn Progress + Send>> = ear;
        hgm::cli::call(&words, beside.as_deref(), ear)
    };
    let Called { result, ended } = job::run(py, progress.as_ref(), work)?;
    match ended {
        Ok(()) => Ok(result),
        Err(failure) => Err(errors::raised_with(py, &failure, result.as_deref())),
    }
}

/// The text of a settings file from the same as JSON, looked over as a file is.
#[pyfunction]
fn settings_text(py: Python<'_>, json: &str) -> PyResult<String> {
    let text = toml_of_json(json).map_err(|reason| errors::refused(py, &format!("settings: {reason}")))?;
    match Settings::layer(&text, "settings") {
        Ok(_) => Ok(text),
        // The lines of a dictionary are nobody's.
        Err(error) => Err(errors::refused(py, &SettingsError { line: None, ..error }.to_string())),
    }
}

#[pymodule]
fn _hgm(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<prior::Prior>()?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(call, module)?)?;
    module.add_function(wrap_pyfunction!(settings_text, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::read_mesh, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::encode_label_map, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::read_label_map, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_check, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_outcome, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_settings, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_state, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_file, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_check_file, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_array, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_doubts, module)?)?;
    module.add_function(wrap_pyfunction!(case::case_points, module)?)?;
    module.add_function(wrap_pyfunction!(case::names, module)?)?;
    Ok(())
}

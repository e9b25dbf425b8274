//! Failures of the command line as exceptions of the package: same texts, by exit code.

use hgm::cli::Failure;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// The exception that stands for a failure.
pub fn raised(py: Python<'_>, failure: &Failure) -> PyErr {
    of_code(py, failure.code(), &failure.message(), failure.answer(), None)
}

/// The same where the files were written and what was found is known.
pub fn raised_with(py: Python<'_>, failure: &Failure, result: Option<&str>) -> PyErr {
    of_code(py, failure.code(), &failure.message(), failure.answer(), result)
}

/// An argument that cannot be used.
pub fn refused(py: Python<'_>, message: &str) -> PyErr {
    of_code(py, 3, message, None, None)
}

fn of_code(py: Python<'_>, code: u8, message: &str, answer: Option<&str>, result: Option<&str>) -> PyErr {
    let made = py
        .import("hgm._errors")
        .and_then(|module| module.getattr("of_code"))
        .and_then(|of_code| of_code.call1((code, message, answer, result)));
    match made {
        Ok(exception) => PyErr::from_value(exception),
        // The package is always there; a broken installation still says what happened.
        Err(_) => PyRuntimeError::new_err(message.to_owned()),
    }
}

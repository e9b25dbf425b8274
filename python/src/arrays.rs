//! Arrays in and out. The package has looked at types and shapes before (`hgm/_arrays.py`); what gets by is refused here too.

use crate::errors::refused;
use numpy::{Element, IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

/// An (n, 3) array, or (n, 2) ..., as rows, borrowed.
pub fn rows<'a, T: Element, const N: usize>(
    py: Python<'_>,
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<&'a [[T; N]]> {
    let shape = array.as_array().shape().to_vec();
    let values = array.as_slice().ok().filter(|_| shape[1] == N);
    let wrong = || refused(py, &format!("{name}: shape {shape:?}: give a contiguous array of shape (n, {N})"));
    values.map(|values| values.as_chunks::<N>().0).ok_or_else(wrong)
}

/// Rows as an (n, N) array; the memory is handed over.
pub fn array2<T: Element, const N: usize>(py: Python<'_>, rows: Vec<[T; N]>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let n = rows.len();
    rows.into_flattened().into_pyarray(py).reshape([n, N])
}

/// Numbers as an array; the memory is handed over.
pub fn array1<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    values.into_pyarray(py)
}

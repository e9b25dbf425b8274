//! The formats, by the end of their files' names.

use super::drawing::{Drawing, OverlayError, damaged};
use super::{csv, fcsv, markups, ply, stl, surface, tag, tck, trk, vtk};

type Reader = fn(&[u8], &str) -> Result<Drawing, OverlayError>;

/// Every format by the end of its files' names.
const FORMATS: [(&str, Reader); 10] = [
    (".csv", csv::decode),
    (".fcsv", fcsv::decode),
    (".mrk.json", markups::decode),
    (".tag", tag::decode),
    (".tck", tck::decode),
    (".trk", trk::decode),
    (".gii", surface::decode),
    (".stl", stl::decode),
    (".ply", ply::decode),
    (".vtk", vtk::decode),
];

fn format_of(name: &str) -> Option<(&'static str, Reader)> {
    let name = name.to_ascii_lowercase();
    FORMATS.into_iter().find(|(end, _)| name.ends_with(end))
}

impl Drawing {
    /// Whether a file's name says that it is a drawing.
    pub fn knows(name: &str) -> bool {
        format_of(name).is_some()
    }

    /// The end of the names of a file's format: `.trk`.
    pub fn ending(name: &str) -> Option<&'static str> {
        format_of(name).map(|(end, _)| end)
    }

    /// Reads a drawing; the end of `name` says its format.
    ///
    /// # Errors
    /// [`OverlayError`] with file, place and problem.
    pub fn decode(bytes: &[u8], name: &str) -> Result<Self, OverlayError> {
        let known = || FORMATS.map(|(end, _)| end).join(", ");
        let (_, read) =
            format_of(name).ok_or_else(|| OverlayError::Unknown { file: name.to_owned(), known: known() })?;
        let drawing = read(bytes, name)?;
        let finite = |p: &[f64; 3]| p.iter().all(|x| x.is_finite());
        match drawing.points_mm.iter().chain(&drawing.pairs_mm).position(|p| !finite(p)) {
            Some(n) => Err(damaged(name, format!("point {n} (counted from 0)"), "a coordinate is not a finite number")),
            None => Ok(drawing),
        }
    }
}

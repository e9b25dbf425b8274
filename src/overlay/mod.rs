//! What other tools draw on a scan: points, streamlines, surfaces. Bytes in, positions out (mm, RAS+), and the same file
//! again with the positions moved.
//!
//! A file keeps what it holds besides positions (triangles, scalars, names of points); what its header says of files,
//! people and times is left out where the format lets it.

mod csv;
mod fcsv;
mod markups;
mod ply;
mod stl;
mod surface;
mod tag;
mod tck;
mod trk;
mod vtk;

use std::fmt;
use thiserror::Error;

/// A drawing as read.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Every position, mm, RAS+.
    pub points_mm: Vec<[f64; 3]>,
    /// Names of the points, where they have names.
    pub names: Vec<String>,
    /// The same points on a second image, where the file holds pairs.
    pub pairs_mm: Vec<[f64; 3]>,
    kept: Kept,
}

/// What a file holds besides.
#[derive(Clone, Debug)]
enum Kept {
    Csv(csv::Table),
    Fcsv(fcsv::Lines),
    Markups(markups::Markups),
    Tag,
    Tck(tck::Lengths),
    Trk(trk::Tracks),
    Gifti(surface::Surface),
    Stl(stl::Facets),
    Ply(ply::Vertices),
    Vtk(vtk::Points),
}

/// Where a point lies, as far as its displacement goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointState {
    /// In tissue: moved, and believed.
    Tissue,
    /// In fluid or at the brain's edge: moved by the field's continuation.
    Fluid,
    /// In tissue that was taken: not moved by any brain shift.
    Removed,
    /// Beyond the field: not moved by any brain shift.
    Outside,
}

impl fmt::Display for PointState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tissue => "tissue",
            Self::Fluid => "fluid",
            Self::Removed => "removed",
            Self::Outside => "outside",
        })
    }
}

/// A point after it was carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// Where it is now, mm, RAS+.
    pub mm: [f64; 3],
    /// Standard deviation of its displacement (root of the trace of the covariance), mm, where known.
    pub sd_mm: Option<f64>,
    /// Where it lay.
    pub state: PointState,
}

/// Why a drawing cannot be read.
#[derive(Debug, Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum OverlayError {
    #[error("{file}: no format of points, streamlines or surfaces is known by this name: {}", known())]
    Unknown { file: String },
    #[error("{file}: {place}: {problem}")]
    Damaged { file: String, place: String, problem: String },
}

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

fn known() -> String {
    FORMATS.map(|(end, _)| end).join(", ")
}

fn damaged(file: &str, place: impl Into<String>, problem: impl Into<String>) -> OverlayError {
    OverlayError::Damaged { file: file.to_owned(), place: place.into(), problem: problem.into() }
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
        let (_, read) = format_of(name).ok_or_else(|| OverlayError::Unknown { file: name.to_owned() })?;
        let drawing = read(bytes, name)?;
        let finite = |p: &[f64; 3]| p.iter().all(|x| x.is_finite());
        match drawing.points_mm.iter().chain(&drawing.pairs_mm).position(|p| !finite(p)) {
            Some(n) => Err(damaged(name, format!("point {n} (counted from 0)"), "a coordinate is not a finite number")),
            None => Ok(drawing),
        }
    }

    /// The same drawing with its points carried, in the order they were read.
    ///
    /// # Panics
    /// When there are not as many points as were read, a programming error.
    pub fn encode(&self, carried: &[Carried]) -> Vec<u8> {
        assert_eq!(carried.len(), self.points_mm.len(), "one place for each point");
        let places: Vec<[f64; 3]> = carried.iter().map(|c| c.mm).collect();
        match &self.kept {
            Kept::Csv(table) => table.encode(carried),
            Kept::Fcsv(lines) => lines.encode(carried),
            Kept::Markups(markups) => markups.encode(carried),
            Kept::Tag => tag::encode(&places, &self.names),
            Kept::Tck(lengths) => lengths.encode(&places),
            Kept::Trk(tracks) => tracks.encode(&places),
            Kept::Gifti(surface) => surface.encode(&places),
            Kept::Stl(facets) => facets.encode(&places),
            Kept::Ply(vertices) => vertices.encode(&places),
            Kept::Vtk(points) => points.encode(&places),
        }
    }

    /// How many lines a file of streamlines holds.
    pub fn streamlines(&self) -> Option<usize> {
        match &self.kept {
            Kept::Tck(lengths) => Some(lengths.count()),
            Kept::Trk(tracks) => Some(tracks.count()),
            _ => None,
        }
    }
}

fn format_of(name: &str) -> Option<(&'static str, Reader)> {
    let name = name.to_ascii_lowercase();
    FORMATS.into_iter().find(|(end, _)| name.ends_with(end))
}

/// 3D Slicer notes in a comment which way its coordinates go; without a word they are taken as RAS.
fn says_lps(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&head[..head.len().min(400)]);
    head.contains("SPACE=LPS")
}

/// LPS to RAS and back.
fn turned([x, y, z]: [f64; 3], lps: bool) -> [f64; 3] {
    if lps { [-x, -y, z] } else { [x, y, z] }
}

/// A coordinate with a ten-thousandth of a mm, without trailing zeros or a minus before zero.
fn written(x: f64) -> String {
    let x = (x * 1e4).round() / 1e4 + 0.0;
    format!("{x}")
}

#[cfg(test)]
mod tests;

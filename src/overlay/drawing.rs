//! A drawing, whatever file it came from.

use crate::mesh::TriMesh;
use crate::mesh::format::gifti::Space;
use std::fmt;
use thiserror::Error;

/// A drawing as read.
#[derive(Debug)]
pub struct Drawing {
    /// Every position, mm, RAS+.
    pub points_mm: Vec<[f64; 3]>,
    /// Names of the points, where any has one; blank for those without. Numbers of rows are no names.
    pub names: Vec<String>,
    /// The same points on a second image, where the file holds pairs.
    pub pairs_mm: Vec<[f64; 3]>,
    pub(super) kept: Box<dyn Kept>,
}

/// What a file holds besides positions.
pub(super) trait Kept: fmt::Debug {
    /// The file again with its points carried.
    fn encode(&self, carried: &[Carried], names: &[String]) -> Vec<u8>;

    /// The same where the format says in which frame its points are.
    fn encode_in(&self, carried: &[Carried], names: &[String], _: Space) -> Vec<u8> {
        self.encode(carried, names)
    }

    /// The frame that the file says its points are in; `None` where it says none.
    fn declared(&self) -> Option<Space> {
        None
    }

    /// What of it does not move with the points.
    fn not_carried(&self) -> Option<NotCarried> {
        None
    }

    /// How many lines a file of streamlines holds.
    fn streamlines(&self) -> Option<usize> {
        None
    }

    /// The triangles between the points; `None` where the format has none.
    fn triangles(&self, _points: usize, _name: &str) -> Option<Result<Vec<[u32; 3]>, OverlayError>> {
        None
    }
}

/// What of a file does not move with its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NotCarried {
    /// Directions at the points.
    #[error(
        "its normals, vectors and tensors are written as they were: they are those of the points before, compute them again"
    )]
    Directions,
    /// Further arrays of a GIFTI file.
    #[error(
        "{0} more arrays of the file, beside the points and triangles, are not written: take them from the file itself"
    )]
    Arrays(usize),
    /// The second volume of tag points.
    #[error("the points of its second volume are not written: carry them from a file in which they stand first")]
    SecondVolume,
}

/// Where points are now, mm.
pub(super) fn places(carried: &[Carried]) -> Vec<[f64; 3]> {
    carried.iter().map(|c| c.mm).collect()
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
    /// Wherever it lies: moved rigidly, as all are where there is no field.
    Rigid,
    /// Within a field that nobody has said is that of tissue: moved by it.
    Moved,
}

impl PointState {
    /// Whether there is a brain shift to be held against: not for what was taken, nor for what lies beyond the brain.
    pub fn moves_with_the_brain(self) -> bool {
        matches!(self, Self::Tissue | Self::Fluid | Self::Moved)
    }
}

impl fmt::Display for PointState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tissue => "tissue",
            Self::Fluid => "fluid",
            Self::Removed => "removed",
            Self::Outside => "outside",
            Self::Rigid => "rigid",
            Self::Moved => "moved",
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
    #[error("{file}: no format of points, streamlines or surfaces is known by this name: {known}")]
    Unknown { file: String, known: String },
    #[error("{file}: {place}: {problem}")]
    Damaged { file: String, place: String, problem: String },
}

pub(super) fn damaged(file: &str, place: impl Into<String>, problem: impl Into<String>) -> OverlayError {
    OverlayError::Damaged { file: file.to_owned(), place: place.into(), problem: problem.into() }
}

impl Drawing {
    /// The same drawing with its points carried, in the order they were read.
    ///
    /// # Panics
    /// When there are not as many points as were read, a programming error.
    pub fn encode(&self, carried: &[Carried]) -> Vec<u8> {
        self.encode_in(carried, Space::Scanner)
    }

    /// The same in a frame that the file says where its format can (GIFTI).
    ///
    /// # Panics
    /// As [`Drawing::encode`].
    pub fn encode_in(&self, carried: &[Carried], space: Space) -> Vec<u8> {
        assert_eq!(carried.len(), self.points_mm.len(), "one place for each point");
        self.kept.encode_in(carried, &self.names, space)
    }

    /// The frame that the file says its points are in (GIFTI); `None` where it says none.
    pub fn declared(&self) -> Option<Space> {
        self.kept.declared()
    }

    /// Refuses a file that says its points are those of MNI space.
    ///
    /// # Errors
    /// [`OverlayError`] with what to do.
    pub fn check_of_scanner(&self, name: &str) -> Result<(), OverlayError> {
        if self.declared() != Some(Space::Mni152) {
            return Ok(());
        }
        let problem = "it says MNI space (NIFTI_XFORM_MNI_152), and the scanner's frame is needed: give the surface as it was before it \
                       was taken there; where the scan itself lies in MNI space, write NIFTI_XFORM_SCANNER_ANAT there";
        Err(damaged(name, "DataSpace of the coordinates", problem))
    }

    /// The surface that the points are the nodes of (STL, GIFTI, PLY), in the file's order; `None` of a drawing that is none.
    ///
    /// # Errors
    /// [`OverlayError`] for triangles that are damaged.
    pub fn surface(&self, name: &str) -> Result<Option<TriMesh>, OverlayError> {
        let triangles = self.kept.triangles(self.points_mm.len(), name).transpose()?.filter(|t| !t.is_empty());
        Ok(triangles.map(|triangles| TriMesh { nodes_mm: self.points_mm.clone(), triangles }))
    }

    /// What of the file [`Drawing::encode`] writes as it was, or not at all.
    pub fn not_carried(&self) -> Option<NotCarried> {
        self.kept.not_carried()
    }

    /// How many lines a file of streamlines holds.
    pub fn streamlines(&self) -> Option<usize> {
        self.kept.streamlines()
    }
}

/// 3D Slicer notes in a comment which way its coordinates go; without a word they are taken as RAS.
pub(super) fn says_lps(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&head[..head.len().min(400)]);
    head.contains("SPACE=LPS")
}

/// Names as the points have them; none where not one has a name.
pub(super) fn names_of(names: Vec<String>) -> Vec<String> {
    if names.iter().all(|name| name.trim().is_empty()) { Vec::new() } else { names }
}

/// LPS to RAS and back.
pub(super) fn turned([x, y, z]: [f64; 3], lps: bool) -> [f64; 3] {
    if lps { [-x, -y, z] } else { [x, y, z] }
}

/// A coordinate with a ten-thousandth of a mm, without trailing zeros or a minus before zero.
pub(super) fn written(x: f64) -> String {
    let x = (x * 1e4).round() / 1e4 + 0.0;
    format!("{x}")
}

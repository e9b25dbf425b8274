//! What a user has in one of a patient's frames carried to another: images, label maps, points, streamlines, surfaces.

use super::case::Case;
use super::error::{WarpError, WorkflowError};
use super::maps::{Map, Part, WarpTo};
use super::user_file::{read_input, shown};
use super::warning::{Warning, all_of};
use crate::artefact::{check_writable, write_whole};
use crate::experiment::field::{Between, looks_like_labels, seen_through};
use crate::geometry::{Native, Position};
use crate::image::Volume;
use crate::image::nifti::{self, ReadOptions, decode_displacement, encode_intensities};
use crate::overlay::{Carried, Drawing, PointState};
use rayon::prelude::*;
use serde::Serialize;
use std::path::PathBuf;

/// What is carried, and how.
#[derive(Clone, Debug)]
pub struct Warp {
    /// The file.
    pub file: PathBuf,
    /// Where the result goes.
    pub output: PathBuf,
    /// The case, or a displacement field of the user's own.
    pub through: Through,
    /// Whether an image is a map of labels; found out by itself where it is not said.
    pub labels: Option<bool>,
    /// How files that leave a choice open are read.
    pub reading: ReadOptions,
}

/// What carries.
#[derive(Clone, Debug)]
pub enum Through {
    /// A case in one of its states.
    Case {
        /// Its folder.
        folder: PathBuf,
        /// Where to.
        to: WarpTo,
        /// The state; the estimate's, or the best sample's, where none is named.
        state: Option<String>,
    },
    /// A field: it moves points, mm.
    Field(PathBuf),
}

/// What was carried.
#[derive(Clone, Debug, Serialize)]
pub struct Warped {
    /// The file that was written.
    pub output: PathBuf,
    /// `image`, `labels`, `points`, `streamlines` or `surface`.
    pub kind: &'static str,
    /// The state that carried it.
    pub state: String,
    /// Points, of a drawing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<PointCounts>,
    /// Largest motion of a point apart from the rigid one, or of none where it is not known, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub streamlines: Option<usize>,
    /// What a reader must know.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<Warning>,
}

/// How many points lay where.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PointCounts {
    /// All.
    pub all: usize,
    /// In tissue.
    pub tissue: usize,
    /// In fluid or at the brain's edge.
    pub fluid: usize,
    /// In tissue that was taken: not moved but rigidly.
    pub removed: usize,
    /// Beyond the field: not moved but rigidly.
    pub outside: usize,
}

impl PointCounts {
    fn of(carried: &[Carried]) -> Self {
        let count = |state: PointState| carried.iter().filter(|c| c.state == state).count();
        Self {
            all: carried.len(),
            tissue: count(PointState::Tissue),
            fluid: count(PointState::Fluid),
            removed: count(PointState::Removed),
            outside: count(PointState::Outside),
        }
    }
}

/// Carries a file.
///
/// # Errors
/// [`WorkflowError`] for a file, a case or a field that cannot be used, and the disk's.
pub fn warp(asked: &Warp) -> Result<Warped, WorkflowError> {
    let name = shown(&asked.file);
    let image = !Drawing::knows(&name);
    let ending = if image { ".nii.gz" } else { Drawing::ending(&name).unwrap_or_default() };
    let output = shown(&asked.output);
    if !output.to_ascii_lowercase().ends_with(ending) {
        return Err(WarpError::Ending { file: name, output, ending }.into());
    }
    check_writable(&asked.output)?;
    let bytes = read_input(&asked.file)?;
    let part = if image { Part::Images } else { Part::Points };
    let map = || match &asked.through {
        Through::Case { folder, to, state } => Map::of_case(&Case::open(folder)?, state.as_deref(), *to, part),
        Through::Field(path) => {
            let field = decode_displacement(&read_input(path)?, &shown(path))?;
            Ok((Map::of_field(field, part), "field".to_owned()))
        }
    };
    let doubts = || match &asked.through {
        Through::Case { folder, .. } => Ok(Case::open(folder)?.gate_warnings()),
        Through::Field(_) => Ok::<_, WorkflowError>(Vec::new()),
    };
    if image {
        let (volume, map) = rayon::join(|| nifti::decode_intensities(&bytes, &name, &asked.reading), map);
        let (volume, odd) = volume?;
        let labels = asked.labels.unwrap_or_else(|| looks_like_labels(&volume));
        let (map, state) = map?;
        let carried = image_through(&volume, &map, labels);
        write_whole(&asked.output, &encode_intensities(&carried))?;
        let kind = if labels { "labels" } else { "image" };
        let warnings = doubts()?.into_iter().chain(all_of(&name, &odd)).collect();
        return Ok(Warped { output: asked.output.clone(), kind, state, points: None, streamlines: None, warnings });
    }
    let drawing = Drawing::decode(&bytes, &name)?;
    let (map, state) = map()?;
    let carried: Vec<Carried> = drawing.points_mm.par_iter().map(|x| map.carry(*x)).collect();
    write_whole(&asked.output, &drawing.encode(&carried))?;
    let kind = match (drawing.streamlines(), ending) {
        (Some(_), _) => "streamlines",
        (None, ".gii" | ".stl" | ".ply" | ".vtk") => "surface",
        _ => "points",
    };
    let points = Some(PointCounts::of(&carried));
    let warnings = doubts()?.into_iter().chain(all_of(&name, drawing.not_carried().as_slice())).collect();
    let streamlines = drawing.streamlines();
    Ok(Warped { output: asked.output.clone(), kind, state, points, streamlines, warnings })
}

/// Carries points (mm) of one of a case's frames, as [`warp`] carries those of a file; returns the state that carried them
/// and each point with its spread.
///
/// # Errors
/// A case that has no such state.
pub fn warp_points(
    case: &Case,
    to: WarpTo,
    state: Option<&str>,
    points_mm: &[[f64; 3]],
) -> Result<(String, Vec<Carried>), WorkflowError> {
    let (map, state) = Map::of_case(case, state, to, Part::Points)?;
    Ok((state, points_mm.par_iter().map(|x| map.carry(*x)).collect()))
}

fn image_through(volume: &Volume<f32, Native>, map: &Map, labels: bool) -> Volume<f32, Native> {
    let grid = map.grid.unwrap_or(volume.grid);
    let from = |v: [usize; 3]| {
        let y: Position<Native> = grid.centre(v);
        map.source(y).filter(|x| !map.removed(*x, y)).map(|x| volume.grid.voxel_at(x))
    };
    let between = if labels { Between::Labels } else { Between::Intensities };
    let carried = seen_through(volume, &grid, from, None, between);
    // As whole as the image: between whole numbers there is nothing to be known.
    let whole = volume.data.par_iter().all(|x| *x == x.round());
    if whole { carried.map(f32::round) } else { carried }
}

//! What a user has in one of a patient's frames carried to another: images, label maps, points, streamlines, surfaces.

use super::case::Case;
use super::error::{SaysMni, WarpError, WorkflowError};
use super::maps::{Map, Part, WarpTo};
use super::stages::grid_of;
use super::user_file::{read_input, shown};
use super::warning::{Warning, all_of, says_talairach};
use crate::artefact::{check_apart, check_writable, write_whole};
use crate::experiment::field::{Between, looks_like_labels, seen_through};
use crate::geometry::{Mni, Native, Position};
use crate::image::nifti::{self, NiftiWarning, ReadOptions, decode_displacement_as, encode_intensities};
use crate::image::{Grid, Volume};
use crate::layout::{POST_NATIVE_BRAIN, PRE_NATIVE_BRAIN};
use crate::mesh::format::gifti::Space;
use crate::overlay::{Carried, Drawing, PointState};
use crate::segment::atlas;
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
    /// Beyond the field: not moved but rigidly, and not at all by a field of the user's own.
    pub outside: usize,
    /// Anywhere, where all are moved rigidly.
    pub rigid: usize,
    /// Within a field of the user's own, which says nothing of tissue.
    pub moved: usize,
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
            rigid: count(PointState::Rigid),
            moved: count(PointState::Moved),
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
    let carrying = match &asked.through {
        Through::Field(field) => vec![field.clone()],
        Through::Case { folder, .. } => Case::at(folder).own_of([asked.output.as_path()]),
    };
    check_apart([&asked.output], carrying.iter().chain([&asked.file]))?;
    let bytes = read_input(&asked.file)?;
    let part = if image { Part::Images } else { Part::Points };
    if let Through::Case { folder, to, .. } = &asked.through {
        check_not_of_mni(&name, image.then_some(&bytes), || scan_grid(&Case::open(folder)?, *to))?;
    }
    let map = || -> Result<(Map, String, Vec<Warning>), WorkflowError> {
        match &asked.through {
            Through::Case { folder, to, state } => {
                let case = Case::open(folder)?;
                let (map, state) = Map::of_case(&case, state.as_deref(), *to, part)?;
                Ok((map, state, case.gate_warnings()))
            }
            Through::Field(path) => {
                let file = shown(path);
                let (field, odd): (_, Vec<NiftiWarning>) =
                    decode_displacement_as(&read_input(path)?, &file, &asked.reading)?;
                Ok((Map::of_field(field, part), "field".to_owned(), all_of(&file, &odd).collect()))
            }
        }
    };
    let to_mni = matches!(asked.through, Through::Case { to: WarpTo::Mni, .. });
    if image {
        let (volume, map) = rayon::join(|| nifti::decode_intensities(&bytes, &name, &asked.reading), map);
        let (volume, odd) = volume?;
        let labels = asked.labels.unwrap_or_else(|| looks_like_labels(&volume));
        let (map, state, doubts) = map?;
        let carried = image_through(&volume, &map, labels);
        let written =
            if to_mni { encode_intensities(&carried.relabelled::<Mni>()) } else { encode_intensities(&carried) };
        write_whole(&asked.output, &written)?;
        let kind = if labels { "labels" } else { "image" };
        let mut warnings: Vec<Warning> = all_of(&name, &odd).chain(doubts).collect();
        if let Through::Field(_) = asked.through {
            let percent = 100.0 * left_behind(&volume, &map, labels);
            warnings.extend((percent >= 0.05).then(|| Warning::LeftBehind { file: name.clone(), percent }));
        }
        return Ok(Warped { output: asked.output.clone(), kind, state, points: None, streamlines: None, warnings });
    }
    let drawing = Drawing::decode(&bytes, &name)?;
    if let Through::Case { .. } = asked.through {
        drawing.check_of_scanner(&name)?;
    }
    let (map, state, doubts) = map()?;
    let space = match asked.through {
        Through::Case { to: WarpTo::Mni, .. } => Space::Mni152,
        Through::Case { .. } => Space::Scanner,
        // Nobody says where a field leads: what the file has said stays.
        Through::Field(_) => drawing.declared().unwrap_or(Space::Scanner),
    };
    let carried: Vec<Carried> = drawing.points_mm.par_iter().map(|x| map.carry(*x)).collect();
    write_whole(&asked.output, &drawing.encode_in(&carried, space))?;
    let kind = match (drawing.streamlines(), ending) {
        (Some(_), _) => "streamlines",
        (None, ".gii" | ".stl" | ".ply" | ".vtk") => "surface",
        _ => "points",
    };
    let points = Some(PointCounts::of(&carried));
    let in_doubt = says_talairach(&drawing, &name).filter(|_| !matches!(asked.through, Through::Field(_)));
    let warnings = all_of(&name, drawing.not_carried().as_slice()).chain(in_doubt).chain(doubts).collect();
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

/// The grid of the scan that a case carries from.
fn scan_grid(case: &Case, to: WarpTo) -> Result<Grid<Native>, WorkflowError> {
    grid_of(case, if to == WarpTo::Pre { POST_NATIVE_BRAIN } else { PRE_NATIVE_BRAIN })
}

/// Refuses a file that says it lies in MNI space, by its name or, of an image, its header or the template's grid, on which `--to mni`
/// writes; but for one on the scan's very grid: there the scan says so of its own frame.
fn check_not_of_mni(
    name: &str,
    image: Option<&Vec<u8>>,
    scan: impl FnOnce() -> Result<Grid<Native>, WorkflowError>,
) -> Result<(), WorkflowError> {
    let grid = image.and_then(|bytes| nifti::decode_grid(bytes, name).ok());
    let by = if name.contains("space-MNI") {
        SaysMni::Name
    } else if image.is_some_and(|bytes| nifti::says_mni(bytes)) {
        SaysMni::Header
    } else if grid.is_some_and(|grid| grid.coincides(&atlas::template().grid().relabelled(), 1e-3)) {
        SaysMni::Grid
    } else {
        return Ok(());
    };
    if let Some(grid) = grid
        && grid.coincides(&scan()?, 1e-3)
    {
        return Ok(());
    }
    Err(WarpError::OfMni { file: name.to_owned(), by }.into())
}

/// The part of what an image shows (labels; else what is brighter than its mean) that a field of the user's own moves out of the
/// image, or does not reach.
fn left_behind(volume: &Volume<f32, Native>, map: &Map, labels: bool) -> f64 {
    let mean = volume.data.iter().map(|x| f64::from(*x)).sum::<f64>() / volume.data.len().max(1) as f64;
    let shown = |x: f32| if labels { x != 0.0 } else { f64::from(x) > mean };
    let grid = &volume.grid;
    let leaves = |n: usize| {
        let to = map.carry(grid.centre(grid.voxel(n)).mm.into());
        let v = grid.voxel_at(Position::new(to.mm[0], to.mm[1], to.mm[2]));
        to.state == PointState::Outside || (0..3).any(|a| v[a] < -0.5 || v[a] > grid.dims[a] as f64 - 0.5)
    };
    let (all, left) = (0..grid.len())
        .into_par_iter()
        .filter(|&n| shown(volume.data[n]))
        .map(|n| (1usize, usize::from(leaves(n))))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    left as f64 / all.max(1) as f64
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::nifti::{encode_displacement, encode_u8};
    use crate::mesh::TriMesh;
    use crate::mesh::format::gifti::{decode_surface_in, encode_surface};

    #[test]
    fn what_says_it_lies_in_mni_space_is_refused_unless_it_is_on_the_scans_own_grid() {
        let grid = Grid::<Native>::axis_aligned([5, 4, 3], [1.0; 3], [0.0; 3]);
        let other = Grid::<Native>::axis_aligned([5, 4, 3], [1.0; 3], [9.0; 3]);
        let mut bytes = Vec::new();
        let packed = encode_u8(&Volume::from_fn(grid, |n| n as u8));
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&packed[..]), &mut bytes).unwrap();
        let plain = bytes.clone();
        // qform_code and sform_code of NIfTI-1.
        bytes[252..256].copy_from_slice(&[0, 0, 4, 0]);
        let check = |name: &str, bytes: Option<&Vec<u8>>, scan: Grid<Native>| {
            check_not_of_mni(name, bytes, || Ok(scan)).map_err(|e| e.to_string())
        };
        assert_eq!(check("a.nii", Some(&plain), other), Ok(()));
        let said = check("a.nii", Some(&bytes), other).unwrap_err();
        assert!(said.contains("a.nii: its header says") && said.contains("sform_code"), "{said}");
        for image in [Some(&plain), None] {
            let said = check("sub-1_space-MNI152NLin6Asym_T1w.nii", image, other).unwrap_err();
            assert!(said.contains("its name says") && said.contains("rename it"), "{said}");
        }
        assert_eq!(check("a.nii", Some(&bytes), grid), Ok(()));
        // What `--to mni` writes under any name.
        let template = atlas::template().grid();
        let ours = encode_u8(&Volume::from_fn(template, |_| 0u8));
        let said = check("b.nii.gz", Some(&ours), grid).unwrap_err();
        assert!(said.contains("b.nii.gz: its grid, that of the template, says") && said.contains("resample"), "{said}");
        assert_eq!(check("b.nii.gz", Some(&ours), template.relabelled()), Ok(()));
    }

    #[test]
    fn a_field_of_the_users_own_tells_what_leaves_the_image_keeps_a_surfaces_frame_and_claims_no_tissue() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let grid = Grid::<Pre>::axis_aligned([10, 4, 4], [1.0; 3], [0.0; 3]);
        std::fs::write(at("field.nii.gz"), encode_displacement(&grid, |_| [2.0, 0.0, 0.0])).unwrap();
        std::fs::write(at("labels.nii.gz"), encode_u8(&Volume::from_fn(grid, |_| 1u8))).unwrap();
        let nodes_mm = vec![[1.0; 3], [2.0, 1.0, 1.0], [1.0, 2.0, 1.0]];
        let surface = TriMesh { nodes_mm, triangles: vec![[0, 1, 2]] };
        std::fs::write(at("a.surf.gii"), encode_surface(&surface, Space::Mni152, "a")).unwrap();
        let warped = |file: &str, output: &str| {
            let (through, reading) = (Through::Field(at("field.nii.gz")), ReadOptions::default());
            warp(&Warp { file: at(file), output: at(output), through, labels: Some(true), reading }).unwrap()
        };
        for over in ["labels.nii.gz", "field.nii.gz"] {
            let (through, reading) = (Through::Field(at("field.nii.gz")), ReadOptions::default());
            let asked = Warp { file: at("labels.nii.gz"), output: at(over), through, labels: Some(true), reading };
            assert!(matches!(warp(&asked), Err(WorkflowError::Apart(_))), "{over}");
        }
        let said = warped("labels.nii.gz", "b.nii.gz").warnings;
        assert!(matches!(said[..], [Warning::LeftBehind { percent, .. }] if (percent - 20.0).abs() < 1e-9), "{said:?}");
        let points = warped("a.surf.gii", "b.surf.gii").points.unwrap();
        assert_eq!((points.all, points.moved, points.tissue), (3, 3, 0));
        let (carried, space) = decode_surface_in(&std::fs::read(at("b.surf.gii")).unwrap(), "b").unwrap();
        assert_eq!((carried.nodes_mm[0], space), ([3.0, 1.0, 1.0], Some(Space::Mni152)));
    }
}

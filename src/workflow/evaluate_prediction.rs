//! A prediction against the later state: what its draws foretold at every place, and what was seen there.

use super::case::Case;
use super::error::{EvaluateError, WorkflowError};
use super::evaluate::evaluate_landmarks;
use super::landmark_pairs::{Landmarks, Pair, Paired, apart_mm, check_frames};
use super::lock::Lock;
use super::maps::{Map, Part, WarpTo};
use super::outcome::write_page;
use super::stage_name::{StageName, Subject};
use super::stages::{OBSERVED, Predicted, grid_of, mask_of, mni_from_pre, read_draws, transforms};
use super::user_file::{read_text, shown};
use super::warning::Warning;
use crate::artefact::{Manifest, sha256_hex, write_whole};
use crate::experiment::landmarks::Evaluation;
use crate::experiment::predict::{
    Compared, Found, HeadEvaluation, LandmarkForecast, Locator, Modes, OtherWayRound, Prediction, PredictionEvaluation,
    TakenAgainstPlan, TargetPlace, scores,
};
use crate::geometry::{Mni, Position, Post, Pre, RigidTransform};
use crate::image::Mask;
use crate::image::nifti::{ReadOptions, decode_labels};
use crate::layout::{EVALUATION_JSON, NATIVE_RESECTED, OUTCOME, PRE_NATIVE_BRAIN, PRE_NATIVE_LABELS, PREDICTION_JSON};
use crate::overlay::PointState;
use crate::register::transform_text::rigid_from_text;
use crate::segment::label::is_tissue;
use nalgebra::{UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// What was seen after an operation.
#[derive(Clone, Debug, Default)]
pub struct SeenAfterwards {
    /// A finished case of two scans of the same patient.
    pub case: Option<PathBuf>,
    /// The state of that case that is taken for true: `observed` (of the images alone, the default) or `fused`.
    pub state: Option<String>,
    /// Landmarks on both scans.
    pub landmarks: Option<Landmarks>,
    /// The rigid motion that carries a point of the later scan to the earlier one, where no case says it: 4x4 text (RAS, mm) or
    /// ITK's.
    pub pre_from_post: Option<PathBuf>,
}

impl SeenAfterwards {
    /// Why not to trust what `case` is held against it by: a quality gate that one of the two did not pass.
    ///
    /// # Errors
    /// [`WorkflowError`] of a folder that is no case.
    pub fn doubts(&self, case: &Path) -> Result<Vec<Warning>, WorkflowError> {
        let folders = [case].into_iter().chain(self.case.as_deref());
        Ok(folders.map(Case::open).collect::<Result<Vec<_>, _>>()?.iter().flat_map(Case::gate_warnings).collect())
    }
}

/// What a case was held against, and how it did.
#[derive(Clone, Debug)]
pub enum Evaluated {
    /// Landmarks carried by a case of two scans.
    Landmarks(Evaluation),
    /// A prediction.
    Prediction(PredictionEvaluation),
}

/// A case of two scans by landmarks, a prediction by what was seen afterwards.
///
/// # Errors
/// As [`evaluate_landmarks`] and [`evaluate_prediction`]; also nothing to hold it against.
pub fn evaluate_case(folder: &Path, seen: &SeenAfterwards) -> Result<Evaluated, WorkflowError> {
    if Case::open(folder)?.subject() == Some(Subject::Plan) || seen.case.is_some() {
        return evaluate_prediction(folder, seen).map(Evaluated::Prediction);
    }
    match &seen.landmarks {
        None => Err(EvaluateError::NoLandmarks { folder: folder.to_path_buf() }.into()),
        Some(_) if seen.pre_from_post.is_some() => evaluate_prediction(folder, seen).map(Evaluated::Prediction),
        Some(landmarks) => evaluate_landmarks(folder, landmarks).map(Evaluated::Landmarks),
    }
}

/// A landmark further than this from the predicted tissue belongs to no brain, mm.
const BESIDE_MM: f64 = 10.0;

/// So many draws of each way of supporting the brain are compared: pairs of them are counted, at every place.
const DRAWS: usize = 256;

/// Compares a prediction with what was seen, keeps the result in its case (landmarks by number in place of their names) and
/// makes the page again.
///
/// # Errors
/// [`WorkflowError`] for a case that is no prediction, a later case of another scan, or landmarks that cannot be used.
pub fn evaluate_prediction(folder: &Path, seen: &SeenAfterwards) -> Result<PredictionEvaluation, WorkflowError> {
    let case = Case::open(folder)?;
    if case.subject() != Some(Subject::Plan) {
        return Err(EvaluateError::NotAPrediction { folder: folder.to_path_buf() }.into());
    }
    if seen.case.is_none() && seen.landmarks.is_none() {
        return Err(EvaluateError::NothingSeen { folder: folder.to_path_buf() }.into());
    }
    let later = seen.case.as_deref().map(|against| later_case(&case, against)).transpose()?;
    let marked = seen.landmarks.as_ref().map(|l| Marked::read(l, later.as_ref(), seen.pre_from_post.as_deref()));
    let marked = marked.transpose()?;
    let _alone = Lock::take(folder, true)?;
    case.check_outcome()?;
    let (_, prediction): (_, Prediction) = case.stage(&StageName::Predict)?;
    let mut evaluation = PredictionEvaluation {
        prediction_sha256: sha256_hex(&case.read_made(PREDICTION_JSON)?),
        ..PredictionEvaluation::default()
    };
    let mut field = None;
    if let Some(later) = &later {
        let state = seen.state.as_deref().unwrap_or(OBSERVED);
        field = Some((state, Map::of_case(later, Some(state), WarpTo::Deformed, Part::Points)?.0));
        evaluation.against.push(state.to_owned());
        evaluation.later_sha256 = sha256_hex(&later.read(OUTCOME)?);
        evaluation.taken = Some(taken_against_plan(&case, later)?);
    }
    evaluation.other_way_round = marked.as_ref().and_then(|marked| marked.other_way_round);
    evaluation.landmarks_alone = marked.as_ref().map_or(0, |marked| marked.alone);
    evaluation.against.extend(marked.as_ref().map(|_| "landmarks".to_owned()));
    for head in &prediction.heads {
        let foretold = Foretold::read(&case, &head.state)?;
        let mut row =
            HeadEvaluation { head: head.head.clone(), state: head.state.clone(), ..HeadEvaluation::default() };
        if let Some((state, map)) = &field {
            let places = foretold.seen_at_nodes(map);
            if places.is_empty() {
                let folder = seen.case.clone().unwrap_or_default();
                return Err(EvaluateError::NowhereSeen { folder, state: (*state).to_owned() }.into());
            }
            row.field = Some(scores(places.len(), &|n| foretold.compared(&places[n])));
        }
        if let Some(marked) = &marked {
            foretold.landmarks(marked, &mut row)?;
        }
        evaluation.heads.push(row);
    }
    let evaluation = evaluation.with_limits();
    let mut kept = evaluation.clone();
    for (n, landmark) in kept.heads.iter_mut().flat_map(|head| head.landmark.iter_mut().enumerate()) {
        landmark.name = (n + 1).to_string();
    }
    let text = format!("{:#}\n", super::work::facts(&kept));
    write_whole(&case.path(EVALUATION_JSON), text.as_bytes())?;
    write_page(&case)?;
    Ok(evaluation)
}

/// The later case, of the same scan before.
fn later_case(prediction: &Case, against: &Path) -> Result<Case, WorkflowError> {
    let later = Case::open(against)?;
    if later.subject() != Some(Subject::Patient) {
        return Err(EvaluateError::NothingAfter { folder: against.to_path_buf() }.into());
    }
    later.check_outcome()?;
    let scan = |case: &Case, stage: StageName| {
        Manifest::of_stage(case.folder(), &stage.to_string()).and_then(|m| m.inputs.get("pre").cloned())
    };
    let (before, after) = (scan(prediction, StageName::Pose), scan(&later, StageName::Registration));
    let both = || (prediction.folder().to_path_buf(), against.to_path_buf());
    if before.is_none() || before != after {
        let (prediction, against) = both();
        return Err(EvaluateError::OtherScan { prediction, against }.into());
    }
    let grids = [prediction, &later].map(|case| grid_of::<Pre>(case, PRE_NATIVE_BRAIN));
    let [before, after] = grids;
    if !before?.coincides(&after?, 1e-3) {
        let (prediction, against) = both();
        return Err(EvaluateError::OtherGrid { prediction, against }.into());
    }
    Ok(later)
}

/// Of the brain's tissue alone: what a plan marks outside it or in fluid can neither be taken nor be seen to be.
fn taken_against_plan(prediction: &Case, later: &Case) -> Result<TakenAgainstPlan, WorkflowError> {
    let (labels, _) = decode_labels(&prediction.read(PRE_NATIVE_LABELS)?, PRE_NATIVE_LABELS, &ReadOptions::default())?;
    let tissue: Mask<Pre> = labels.relabelled::<Pre>().map(is_tissue);
    let grid = tissue.grid;
    let of = |case: &Case| -> Result<Vec<bool>, WorkflowError> {
        let mask: Mask<Pre> = mask_of(case, NATIVE_RESECTED, &grid)?;
        Ok(mask.data.iter().zip(&tissue.data).map(|(marked, tissue)| *marked && *tissue).collect())
    };
    let (planned, taken) = (of(prediction)?, of(later)?);
    let shared: Vec<bool> = planned.iter().zip(&taken).map(|(a, b)| *a && *b).collect();
    let cc = |voxels: &[bool]| {
        let count = voxels.iter().filter(|voxel| **voxel).count();
        (count as f64 * grid.voxel_volume_mm3() / 1000.0 * 1e3).round() / 1e3
    };
    Ok(TakenAgainstPlan::new(cc(&planned), cc(&taken), cc(&shared)))
}

/// Landmarks in the frame of the scan before.
struct Marked {
    file: String,
    /// How many one file alone holds.
    alone: usize,
    /// Name, place before, displacement without the rigid motion.
    rows: Vec<(String, [f64; 3], [f64; 3])>,
    /// The rigid motion by hand fits far better turned round.
    other_way_round: Option<OtherWayRound>,
}

impl Marked {
    fn read(landmarks: &Landmarks, later: Option<&Case>, by_hand: Option<&Path>) -> Result<Self, WorkflowError> {
        let file = shown(&landmarks.pre);
        let Paired { pairs: found, left_out } = Paired::read(landmarks)?;
        let pre_from_post: RigidTransform<Post, Pre> = match (by_hand, later) {
            (Some(path), _) => rigid_from_text(&read_text(path)?, &shown(path))?,
            (None, Some(later)) => transforms(later)?.0,
            (None, None) => {
                let file = landmarks.post.as_deref().map_or(file, shown);
                return Err(EvaluateError::NoPose { file }.into());
            }
        };
        // What the file would say, were it the other way round.
        let turned = pre_from_post.inverse();
        if by_hand.is_none() {
            check_frames(&found, &turned, landmarks)?;
        }
        let inverse = RigidTransform::new(turned.rotation, turned.translation_mm);
        let apart = |motion: &RigidTransform<Post, Pre>| apart_mm(found.iter().map(|(_, x, y)| (*y, *x)), motion);
        let other_way_round = OtherWayRound::of(apart(&pre_from_post), apart(&inverse));
        let moved = |(name, x, y): Pair| {
            let back = pre_from_post.apply(Position::new(y[0], y[1], y[2])).mm;
            (name, x, [0, 1, 2].map(|a| back[a] - x[a]))
        };
        let rows = found.into_iter().map(moved).collect();
        Ok(Self { file, alone: left_out.len(), rows, other_way_round: other_way_round.filter(|_| by_hand.is_some()) })
    }
}

/// Where something was seen to move: place in the mesh, displacement and its standard deviation, mm.
struct Seen {
    place: Found,
    moved_mm: [f64; 3],
    sd_mm: f64,
}

/// A state of a prediction in the frame of the scan.
struct Foretold {
    predicted: Predicted,
    mni_from_pre: RigidTransform<Pre, Mni>,
    resected: Mask<Pre>,
}

impl Foretold {
    fn read(case: &Case, state: &str) -> Result<Self, WorkflowError> {
        let mni_from_pre = mni_from_pre(case)?;
        let mut predicted = read_draws(case, state)?;
        predicted.modes.draws.retain(|draw| draw.number < DRAWS);
        turn(&mut predicted.modes, &mni_from_pre.inverse().rotation);
        let grid = grid_of::<Pre>(case, PRE_NATIVE_BRAIN)?;
        Ok(Self { predicted, mni_from_pre, resected: mask_of(case, NATIVE_RESECTED, &grid)? })
    }

    /// The nodes where a later case believes what it sees.
    fn seen_at_nodes(&self, map: &Map) -> Vec<Seen> {
        let pre_from_mni = self.mni_from_pre.inverse();
        let of = |(n, x): (usize, &[f64; 3])| {
            let x: [f64; 3] = pre_from_mni.apply(Position::new(x[0], x[1], x[2])).mm.into();
            let carried = map.carry(x);
            let place = Found { nodes: [n as u32; 4], weights: [0.25; 4], outside_mm: 0.0 };
            let moved_mm = [0, 1, 2].map(|a| carried.mm[a] - x[a]);
            let sd_mm = carried.sd_mm.unwrap_or(0.0);
            (carried.state == PointState::Tissue).then_some(Seen { place, moved_mm, sd_mm })
        };
        self.predicted.mesh.nodes_mm().iter().enumerate().filter_map(of).collect()
    }

    fn compared(&self, seen: &Seen) -> Compared {
        Compared { draws: self.predicted.modes.at(&seen.place), seen_mm: seen.moved_mm, seen_sd_mm: seen.sd_mm }
    }

    fn landmarks(&self, marked: &Marked, row: &mut HeadEvaluation) -> Result<(), WorkflowError> {
        let mut counted = Vec::new();
        for (name, x, moved_mm) in &marked.rows {
            let p: Position<Pre> = Position::new(x[0], x[1], x[2]);
            let place = Locator(&self.predicted.mesh).find(self.mni_from_pre.apply(p).mm.into());
            let (lies, counts) = match self.resected.nearest(p) {
                Some(true) => (TargetPlace::Removed.name(), false),
                _ if place.outside_mm > BESIDE_MM => ("outside", false),
                _ if place.outside_mm > 0.0 => (TargetPlace::Fluid.name(), true),
                _ => (TargetPlace::Tissue.name(), true),
            };
            let seen = Seen { place, moved_mm: *moved_mm, sd_mm: 0.0 };
            // The nearest node is no forecast of what is taken or belongs to no brain.
            let compared = counts.then(|| self.compared(&seen));
            row.landmark.push(LandmarkForecast::of((name, lies), moved_mm, compared.as_ref()));
            if counts {
                counted.push(seen);
            }
        }
        if counted.is_empty() {
            return Err(EvaluateError::NoLandmark { file: marked.file.clone() }.into());
        }
        row.landmarks = Some(scores(counted.len(), &|n| self.compared(&counted[n])));
        Ok(())
    }
}

/// Displacements in another frame.
fn turn(modes: &mut Modes, rotation: &UnitQuaternion<f64>) {
    for u in modes.modes_mm.iter_mut().flatten().chain(&mut modes.mean_mm) {
        *u = (rotation * Vector3::from(*u)).into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::nifti::{encode_mask, encode_u8};
    use crate::image::{Grid, LabelMap};
    use crate::segment::label::{BACKGROUND, CSF, WHITE_MATTER};

    #[test]
    fn what_a_plan_marks_outside_the_tissue_is_neither_planned_nor_missed() {
        let grid = Grid::<Pre>::axis_aligned([40; 3], [1.0; 3], [0.0; 3]);
        let at = |n: usize| grid.voxel(n)[0];
        let labels = LabelMap::from_fn(grid, |n| match at(n) {
            0..10 => BACKGROUND,
            10..14 => CSF,
            _ => WHITE_MATTER,
        });
        // Drawn generously over the brain's edge, and taken exactly.
        let planned = Mask::from_fn(grid, |n| (2..20).contains(&at(n)));
        let taken = Mask::from_fn(grid, |n| (14..20).contains(&at(n)));
        let folder = tempfile::tempdir().unwrap();
        let case = |name: &str, mask: &Mask<Pre>| {
            let case = Case::at(&folder.path().join(name));
            for (file, bytes) in [(PRE_NATIVE_LABELS, encode_u8(&labels)), (NATIVE_RESECTED, encode_mask(mask))] {
                std::fs::create_dir_all(case.path(file).parent().unwrap()).unwrap();
                std::fs::write(case.path(file), bytes).unwrap();
            }
            case
        };
        let found = taken_against_plan(&case("plan", &planned), &case("case", &taken)).unwrap();
        assert_eq!((found.planned_cc, found.taken_cc, found.dice), (9.6, 9.6, 1.0));
        assert!(!found.is_other());
    }
}

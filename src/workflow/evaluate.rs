//! Landmarks against a case: how far each lies from where the rigid motion, the images and the model carry it.

use super::case::Case;
use super::error::{LandmarkError, WorkflowError};
use super::lock::Lock;
use super::maps::{Map, Part, WarpTo};
use super::stages::{ESTIMATE, FUSED, OBSERVED, brain_shift, transforms};
use super::user_file::{read_input, shown};
use crate::artefact::write_whole;
use crate::experiment::landmarks::{CarriedLandmarks, Evaluation, evaluate};
use crate::geometry::Position;
use crate::layout::{ESTIMATE_STATE, LANDMARKS_JSON};
use crate::overlay::{Carried, Drawing, PointState};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Landmarks on both scans, each in its scanner's frame.
#[derive(Clone, Debug)]
pub struct Landmarks {
    /// Those of the pre-operative scan, or pairs.
    pub pre: PathBuf,
    /// Those of the post-operative one, where the first file holds no pairs.
    pub post: Option<PathBuf>,
}

fn read(path: &Path) -> Result<Drawing, WorkflowError> {
    let name = shown(path);
    let drawing = Drawing::decode(&read_input(path)?, &name)?;
    if drawing.points_mm.is_empty() { Err(LandmarkError::Empty { file: name }.into()) } else { Ok(drawing) }
}

/// Name, place before, place after.
pub(super) type Pair = (String, [f64; 3], [f64; 3]);

/// The landmarks of both scans.
pub(super) fn pairs(landmarks: &Landmarks) -> Result<Vec<Pair>, WorkflowError> {
    let pre = read(&landmarks.pre)?;
    let numbered = |n: usize| pre.names.get(n).cloned().unwrap_or_else(|| (n + 1).to_string());
    let Some(path) = &landmarks.post else {
        if pre.pairs_mm.is_empty() {
            return Err(LandmarkError::NoPairs { file: shown(&landmarks.pre) }.into());
        }
        return Ok((0..pre.points_mm.len()).map(|n| (numbered(n), pre.points_mm[n], pre.pairs_mm[n])).collect());
    };
    let post = read(path)?;
    let by_name: BTreeMap<&str, usize> = post.names.iter().enumerate().map(|(n, name)| (name.as_str(), n)).collect();
    let unique = by_name.len() == post.names.len() && !post.names.is_empty();
    let matched =
        |n: usize| Some((numbered(n), pre.points_mm[n], post.points_mm[*by_name.get(pre.names.get(n)?.as_str())?]));
    let found: Vec<Pair> = if unique { (0..pre.points_mm.len()).filter_map(matched).collect() } else { Vec::new() };
    if !found.is_empty() {
        return Ok(found);
    }
    // Without names in common the order counts, where there are as many.
    let (of_pre, of_post) = (pre.points_mm.len(), post.points_mm.len());
    if of_pre != of_post {
        let (pre, post) = (shown(&landmarks.pre), shown(path));
        return Err(LandmarkError::NoMatch { pre, post, of_pre, of_post }.into());
    }
    Ok((0..of_pre).map(|n| (numbered(n), pre.points_mm[n], post.points_mm[n])).collect())
}

/// Carries landmarks in every way that the case knows, compares them with where they were found, and keeps the result in
/// the case for its page, with numbers in place of names.
///
/// # Errors
/// [`WorkflowError`] for landmarks or a case that cannot be used.
pub fn evaluate_landmarks(folder: &Path, landmarks: &Landmarks) -> Result<Evaluation, WorkflowError> {
    let case = Case::open(folder)?;
    let pairs = pairs(landmarks)?;
    let _alone = Lock::take(folder, true)?;
    let (pre_from_post, _) = transforms(&case)?;
    let post_from_pre = pre_from_post.inverse();
    let rigid = |x: &[f64; 3]| post_from_pre.apply(Position::new(x[0], x[1], x[2])).mm.into();
    let mut carried = vec![CarriedLandmarks {
        state: "rigid".to_owned(),
        to_mm: pairs.iter().map(|(_, x, _)| rigid(x)).collect(),
        sd_mm: vec![None; pairs.len()],
    }];
    let estimate = case.path(ESTIMATE_STATE).exists().then(|| ESTIMATE.to_owned());
    let model = estimate.or(brain_shift(&case)?.and_then(|shift| shift.model));
    let with_model = model.iter().map(String::as_str).chain([FUSED]).filter(|_| model.is_some());
    let mut places: Vec<(String, bool)> = vec![("tissue".to_owned(), true); pairs.len()];
    for state in [OBSERVED].into_iter().chain(with_model) {
        let (map, _) = Map::of_case(&case, Some(state), WarpTo::Post, Part::Points)?;
        let to: Vec<Carried> = pairs.iter().map(|(_, x, _)| map.carry(*x)).collect();
        places = to.iter().map(|c| (c.state.to_string(), c.state != PointState::Removed)).collect();
        carried.push(CarriedLandmarks {
            state: state.to_owned(),
            to_mm: to.iter().map(|c| c.mm).collect(),
            sd_mm: to.iter().map(|c| c.sd_mm).collect(),
        });
    }
    let names: Vec<String> = pairs.iter().map(|(name, _, _)| name.clone()).collect();
    let found: Vec<[f64; 3]> = pairs.iter().map(|(_, _, y)| *y).collect();
    let evaluation = evaluate(&names, &places, &found, &carried);
    let mut kept = evaluation.clone();
    for (n, landmark) in kept.landmarks.iter_mut().enumerate() {
        landmark.name = (n + 1).to_string();
    }
    let text = format!("{:#}\n", super::work::facts(&kept));
    write_whole(&case.path(LANDMARKS_JSON), text.as_bytes())?;
    Ok(evaluation)
}

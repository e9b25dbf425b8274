//! Landmarks against a case: how far each lies from where the rigid motion, the images and the model carry it.

use super::case::Case;
use super::error::{LandmarkError, WorkflowError};
use super::landmark_pairs::{Landmarks, Paired, check_frames};
use super::lock::Lock;
use super::maps::{Map, Part, WarpTo};
use super::stages::{FUSED, OBSERVED, transforms};
use super::user_file::shown;
use crate::artefact::write_whole;
use crate::experiment::landmarks::{CarriedLandmarks, Evaluation, evaluate};
use crate::geometry::Position;
use crate::layout::LANDMARKS_JSON;
use crate::overlay::{Carried, PointState};
use crate::report::case::results_sha256;
use std::path::Path;

/// Carries landmarks in every way that the case knows, compares them with where they were found, and keeps the result in
/// the case for its page, with numbers in place of names.
///
/// # Errors
/// [`WorkflowError`] for landmarks or a case that cannot be used.
pub fn evaluate_landmarks(folder: &Path, landmarks: &Landmarks) -> Result<Evaluation, WorkflowError> {
    let case = Case::open(folder)?;
    let Paired { pairs, left_out } = Paired::read(landmarks)?;
    let _alone = Lock::take(folder, true)?;
    let (pre_from_post, _) = transforms(&case)?;
    let post_from_pre = pre_from_post.inverse();
    check_frames(&pairs, &post_from_pre, landmarks)?;
    let rigid = |x: &[f64; 3]| post_from_pre.apply(Position::new(x[0], x[1], x[2])).mm.into();
    let mut carried = vec![CarriedLandmarks {
        state: "rigid".to_owned(),
        to_mm: pairs.iter().map(|(_, x, _)| rigid(x)).collect(),
        sd_mm: vec![None; pairs.len()],
    }];
    let model = case.model()?;
    let with_model = model.iter().map(String::as_str).chain([FUSED]).filter(|_| model.is_some());
    let mut seen_in: Vec<Vec<PointState>> = Vec::new();
    for state in [OBSERVED].into_iter().chain(with_model) {
        let (map, _) = Map::of_case(&case, Some(state), WarpTo::Post, Part::Points)?;
        let to: Vec<Carried> = pairs.iter().map(|(_, x, _)| map.carry(*x)).collect();
        seen_in.push(to.iter().map(|c| c.state).collect());
        carried.push(CarriedLandmarks {
            state: state.to_owned(),
            to_mm: to.iter().map(|c| c.mm).collect(),
            sd_mm: to.iter().map(|c| c.sd_mm).collect(),
        });
    }
    let places: Vec<(String, bool)> = (0..pairs.len()).map(|n| place(seen_in.iter().map(|states| states[n]))).collect();
    if !places.iter().any(|(_, counts)| *counts) {
        return Err(LandmarkError::NoneInside { file: shown(&landmarks.pre) }.into());
    }
    let names: Vec<String> = pairs.iter().map(|(name, _, _)| name.clone()).collect();
    let found: Vec<[f64; 3]> = pairs.iter().map(|(_, _, y)| *y).collect();
    let evaluation = Evaluation { left_out, ..evaluate(&names, &places, &found, &carried) };
    let mut kept = Evaluation { of_sha256: results_sha256(folder)?, left_out: Vec::new(), ..evaluation.clone() };
    for (n, landmark) in kept.landmarks.iter_mut().enumerate() {
        landmark.name = (n + 1).to_string();
    }
    let text = format!("{:#}\n", super::work::facts(&kept));
    write_whole(&case.path(LANDMARKS_JSON), text.as_bytes())?;
    Ok(evaluation)
}

/// Where a landmark lies, and whether it counts, by where each state has it. All rows of the summary are of the same landmarks, so
/// one that any state moves with the brain counts in all: a state whose field ends short of it has its error there, too.
fn place(states: impl Iterator<Item = PointState>) -> (String, bool) {
    // The first of those that are farthest inside.
    let inside = |state: &PointState| match state {
        PointState::Tissue => 0,
        PointState::Fluid | PointState::Moved => 1,
        PointState::Removed => 2,
        PointState::Outside | PointState::Rigid => 3,
    };
    let state = states.min_by_key(inside).unwrap_or(PointState::Tissue);
    (state.to_string(), state.moves_with_the_brain())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_landmark_counts_where_any_state_moves_it_in_whatever_order_they_come() {
        use PointState::{Fluid, Outside, Removed, Tissue};
        for (states, expected) in [
            ([Tissue, Outside], ("tissue", true)),
            ([Fluid, Outside], ("fluid", true)),
            ([Fluid, Tissue], ("tissue", true)),
            ([Removed, Removed], ("removed", false)),
            ([Outside, Outside], ("outside", false)),
        ] {
            for order in [states, [states[1], states[0]]] {
                let (name, counts) = place(order.into_iter());
                assert_eq!((name.as_str(), counts), expected, "{order:?}");
            }
        }
    }
}

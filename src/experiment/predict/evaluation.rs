//! A prediction against what was seen afterwards, as `sim/evaluation.json` keeps it.

use super::ellipsoid::Scatter;
use super::score::{Compared, Scores};
use crate::experiment::landmarks::fits_far_better;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A prediction against what was seen. Lengths in mm, displacements in the pre-operative scanner's frame, RAS+.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PredictionEvaluation {
    /// SHA-256 of the `sim/prediction.json` that was evaluated.
    pub prediction_sha256: String,
    /// SHA-256 of the `sim/outcome.json` of the later case, as that was when this was made; empty without such a case.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub later_sha256: String,
    /// What it was compared with: `observed`, `fused` (states of the later case), `landmarks`.
    pub against: Vec<String>,
    /// What was taken against what was to be taken, where the later case says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taken: Option<TakenAgainstPlan>,
    /// Each way of lying; the first is the state `predicted`.
    pub heads: Vec<HeadEvaluation>,
    /// How the rigid motion between the scans fits the landmarks, where it fits them far better turned round.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_way_round: Option<OtherWayRound>,
    /// How many landmarks one of the two files alone holds: not compared.
    #[serde(default)]
    pub landmarks_alone: usize,
    /// What the figures do not say by themselves, in plain words.
    pub limits: Vec<String>,
}

/// One way of lying.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeadEvaluation {
    /// As it was said: `supine`, `prone` ...
    pub head: String,
    /// Name of its state among the case's files.
    pub state: String,
    /// Over the nodes of the prediction's mesh where the later case believes what it sees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<Scores>,
    /// Over the landmarks outside the tissue that was to be taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub landmarks: Option<Scores>,
    /// A row for each landmark.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub landmark: Vec<LandmarkForecast>,
}

/// One landmark.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LandmarkForecast {
    /// Its name or number.
    pub name: String,
    /// Where it lies: `tissue`, `fluid`, `removed`, `outside`. What lies in tissue that was to be taken, or far from the brain, is listed
    /// and not counted: nothing was foretold of it.
    pub place: String,
    /// How far it was seen to move, mm: its error where nothing is foretold.
    pub seen_mm: f64,
    /// How far it was expected to move, mm. This and what follows is absent where nothing was foretold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected_mm: Option<f64>,
    /// Standard deviation of that (root of the trace of the covariance), mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd_mm: Option<f64>,
    /// Distance between the two places, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error_mm: Option<f64>,
    /// Whether it was seen inside the ellipsoid that holds 95 % of the draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside_95: Option<bool>,
}

impl LandmarkForecast {
    /// A landmark (name, where it lies) that was seen to move so, mm, and what was foretold of it, where anything was.
    pub fn of((name, place): (&str, &str), moved_mm: &[f64; 3], foretold: Option<&Compared>) -> Self {
        let rounded = |x: f64| (x * 1e3).round() / 1e3 + 0.0;
        let seen = Vector3::from(*moved_mm);
        let told =
            Self { name: name.to_owned(), place: place.to_owned(), seen_mm: rounded(seen.norm()), ..Self::default() };
        let Some(foretold) = foretold else { return told };
        let scatter = Scatter::of(&foretold.draws);
        let mean = Vector3::from(scatter.mean_mm());
        Self {
            expected_mm: Some(rounded(mean.norm())),
            sd_mm: Some(rounded(scatter.sd_mm())),
            error_mm: Some(rounded((mean - seen).norm())),
            inside_95: Some(scatter.distance(moved_mm) <= scatter.radius(0.95)),
            ..told
        }
    }
}

/// A rigid motion that seems to be the other way round.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(clippy::struct_field_names, reason = "the unit is in the name")]
pub struct OtherWayRound {
    /// How far the landmarks of one scan lie from those of the other as it is given, mm (root mean square).
    pub given_rms_mm: f64,
    /// The same by its inverse, mm.
    pub inverse_rms_mm: f64,
}

impl OtherWayRound {
    /// Something to say, where the inverse fits far better.
    pub fn of(given_rms_mm: f64, inverse_rms_mm: f64) -> Option<Self> {
        fits_far_better(inverse_rms_mm, given_rms_mm).then_some(Self { given_rms_mm, inverse_rms_mm })
    }
}

/// What was taken against the plan, in the pre-operative scan's grid: of the brain's tissue as the prediction's labels have it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TakenAgainstPlan {
    /// Tissue that was to be taken, cc.
    pub planned_cc: f64,
    /// Tissue that was taken, cc.
    pub taken_cc: f64,
    /// How far the two agree: twice what they share over their sum.
    pub dice: f64,
}

impl TakenAgainstPlan {
    /// Below this another operation was done than the one foretold.
    const OTHER_OPERATION: f64 = 0.5;

    /// Volumes (cc) of the plan, of what was taken, and of what they share.
    pub fn new(planned_cc: f64, taken_cc: f64, shared_cc: f64) -> Self {
        let dice = 2.0 * shared_cc / (planned_cc + taken_cc).max(f64::MIN_POSITIVE);
        Self { planned_cc, taken_cc, dice }
    }

    /// Whether the operation was another one.
    pub fn is_other(&self) -> bool {
        self.dice < Self::OTHER_OPERATION
    }
}

/// What the figures of an evaluation do not say by themselves.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum EvaluationLimit {
    /// One patient was compared, however many places.
    #[error(
        "The places of one brain move together: one patient says little about how often the reach holds. Many patients do."
    )]
    OnePatient,
    /// Nothing can be told from so little.
    #[error(
        "What was seen ({seen_mm:.2} mm) is smaller than its own error ({error_mm:.2} mm): this operation moved too little, or was \
         seen too poorly, to judge the forecast by."
    )]
    WithinError {
        /// Root mean square of what was seen.
        seen_mm: f64,
        /// Median of its standard deviation.
        error_mm: f64,
    },
    /// The operation was not the one that was planned.
    #[error(
        "Other tissue was taken ({:.1} cc) than was planned ({:.1} cc; they agree to {:.2} of 1): part of the difference is the \
         plan's.",
        .0.taken_cc, .0.planned_cc, .0.dice
    )]
    OtherOperation(TakenAgainstPlan),
    /// What is taken for true holds a model itself.
    #[error(
        "The fused state holds a model of the same kind as the prediction: where the images say little the two agree by \
         construction. The observed state is of the images alone."
    )]
    FusedTruth,
    /// The rigid motion was given the wrong way round.
    #[error(
        "The rigid motion between the scans leaves the landmarks {:.0} mm apart, and its inverse {:.0} mm: it seems to carry the earlier scan \
         to the later one. Give the one from the later scan to the earlier.",
        .0.given_rms_mm, .0.inverse_rms_mm
    )]
    OtherWayRound(OtherWayRound),
    /// Landmarks have an error of their own, which is not known.
    #[error("Landmarks are taken to be without error.")]
    LandmarksAreTrue,
    /// Landmarks that belong to none of the other scan.
    #[error("{0} landmarks stand in one of the two files alone and were not compared.")]
    LandmarksAlone(usize),
}

impl PredictionEvaluation {
    /// Says what the figures do not.
    #[must_use]
    pub fn with_limits(mut self) -> Self {
        self.limits = self.found_limits().iter().map(ToString::to_string).collect();
        self
    }

    /// What the figures do not say.
    pub fn found_limits(&self) -> Vec<EvaluationLimit> {
        let fields = || self.heads.iter().filter_map(|head| head.field);
        let within = fields().find(Scores::is_within_error);
        let within = within.map(|scores| (scores.seen_rms_mm, scores.seen_sd_median_mm));
        let fused = self.against.iter().any(|state| state == "fused");
        let landmarks = self.heads.iter().any(|head| head.landmarks.is_some());
        [
            self.other_way_round.map(EvaluationLimit::OtherWayRound),
            fields().next().map(|_| EvaluationLimit::OnePatient),
            within.map(|(seen_mm, error_mm)| EvaluationLimit::WithinError { seen_mm, error_mm }),
            self.taken.filter(TakenAgainstPlan::is_other).map(EvaluationLimit::OtherOperation),
            fused.then_some(EvaluationLimit::FusedTruth),
            landmarks.then_some(EvaluationLimit::LandmarksAreTrue),
            (self.landmarks_alone > 0).then_some(EvaluationLimit::LandmarksAlone(self.landmarks_alone)),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_foretold_of_a_landmark_that_is_taken() {
        let draws = (0..8).map(|n| (0.125, [0, 1, 2].map(|a| f64::from((n >> a) & 1) + 1.0))).collect();
        let compared = Compared { draws, seen_mm: [1.5; 3], seen_sd_mm: 0.0 };
        let told = LandmarkForecast::of(("a", "tissue"), &[1.5; 3], Some(&compared));
        assert_eq!((told.inside_95, told.error_mm, told.expected_mm), (Some(true), Some(0.0), Some(2.598)), "{told:?}");
        let taken = LandmarkForecast::of(("a", "removed"), &[1.5; 3], None);
        assert_eq!((taken.seen_mm, taken.inside_95, taken.sd_mm), (2.598, None, None));
        let json = serde_json::to_string(&taken).unwrap();
        assert!(!json.contains("expected_mm") && !json.contains("inside_95") && !json.contains("error_mm"), "{json}");
    }

    #[test]
    fn another_operation_and_a_fused_truth_are_said_in_words_and_one_as_planned_is_not() {
        let of = |shared_cc: f64, against: &str| {
            let taken = Some(TakenAgainstPlan::new(20.0, 30.0, shared_cc));
            let head = HeadEvaluation { field: Some(Scores::default()), ..HeadEvaluation::default() };
            let against = vec![against.to_owned()];
            PredictionEvaluation { against, taken, heads: vec![head], ..PredictionEvaluation::default() }.with_limits()
        };
        let other = of(5.0, "fused");
        assert!((other.taken.unwrap().dice - 0.2).abs() < 1e-12);
        let said = "Other tissue was taken (30.0 cc) than was planned (20.0 cc; they agree to 0.20 of 1): part of the difference \
                    is the plan's.";
        assert!(other.limits.len() == 3 && other.limits[1] == said, "{:?}", other.limits);
        assert!(other.found_limits().contains(&EvaluationLimit::FusedTruth));
        assert_eq!(of(18.0, "observed").found_limits(), [EvaluationLimit::OnePatient]);
    }

    #[test]
    fn a_motion_that_fits_far_better_turned_round_is_said_to_and_a_shift_is_none() {
        assert_eq!(
            (OtherWayRound::of(9.0, 7.0), OtherWayRound::of(4.0, 0.1), OtherWayRound::of(3.0, 30.0)),
            (None, None, None)
        );
        let other_way_round = OtherWayRound::of(31.0, 4.0);
        let found = PredictionEvaluation { other_way_round, ..PredictionEvaluation::default() }.with_limits();
        assert!(found.limits[0].contains("31 mm apart, and its inverse 4 mm"), "{:?}", found.limits);
    }

    #[test]
    fn what_is_seen_within_its_error_is_said_to_judge_nothing() {
        let of = |seen_rms_mm: f64| {
            let scores = Scores { places: 9, seen_rms_mm, seen_sd_median_mm: 2.0, ..Scores::default() };
            let head = HeadEvaluation { field: Some(scores), ..HeadEvaluation::default() };
            PredictionEvaluation { heads: vec![head], ..PredictionEvaluation::default() }.with_limits().limits
        };
        assert!(of(1.0).iter().any(|limit| limit.contains("smaller than its own error")));
        assert!(!of(3.0).iter().any(|limit| limit.contains("smaller than its own error")));
    }
}

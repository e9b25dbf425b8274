//! A prediction in numbers, as `sim/prediction.json` keeps it.

use super::check::Check;
use super::cut::Planned;
use super::fluid::FluidOfHead;
use super::heads::HeadComparison;
use super::shares::Shares;
use super::support::SupportWeight;
use super::uncertain::Cause;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A prediction. Lengths in mm, positions and directions in the pre-operative scanner's frame, RAS+.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Prediction {
    /// What is taken.
    pub plan: Planned,
    /// What counts as a shift, mm.
    pub threshold_mm: f64,
    /// Draws for each way of supporting the brain.
    pub draws: usize,
    /// Each way of lying; the first is the state `predicted`.
    pub heads: Vec<HeadPrediction>,
    /// With which head least moves, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<HeadComparison>,
    /// What was not known, and its prior.
    pub unknowns: Vec<UnknownOutcome>,
    /// Tissues that were not drawn but held at the mean of their prior (tumour, oedema): shear modulus, Pa.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub held_shear_modulus_pa: BTreeMap<String, f64>,
    /// How the brain may be supported, and how probable that was taken to be before any way was left out.
    pub supports: Vec<SupportWeight>,
    /// How far draws read from the response surface are off those solved whole.
    pub checks: Vec<Check>,
    /// What was assumed, in plain words.
    pub assumptions: Vec<String>,
}

/// One way of lying.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeadPrediction {
    /// `supine`, `prone`, `left`, `right`, `sitting` or the direction that was given.
    pub head: String,
    /// Name of its state among the case's files: `predicted`, `predicted-prone`.
    pub state: String,
    /// The way down.
    pub down: [f64; 3],
    /// Largest mean displacement of a node, mm.
    pub largest_mm: f64,
    /// Where that is, mm.
    pub largest_at_mm: [f64; 3],
    /// Median over the nodes of the mean displacement, mm.
    pub median_mm: f64,
    /// Median over the nodes of its standard deviation (root of the trace of the covariance), mm.
    pub sd_median_mm: f64,
    /// Largest of the nodes' own 95 % reaches, mm: 95 % of the draws move that one node less.
    pub reach95_largest_mm: f64,
    /// In 95 % of the draws no node moves farther, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub farthest_95_mm: Option<f64>,
    /// Tissue that is expected to move by more than the threshold, cc: probabilities summed over the tissue.
    pub over_threshold_cc: f64,
    /// Which unknown contributes how much to the variance.
    pub shares: Shares,
    /// Where the fluid stands, where that was known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fluid: Option<FluidOfHead>,
    /// Equilibria that were solved for it, checks apart.
    pub states_solved: usize,
    /// Its draws of all ways of supporting the brain, and those among them that were solved themselves: the others were read from the
    /// response surface. Absent from predictions of before this was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub draws_solved: Option<DrawsSolved>,
    /// How the brain is supported in its draws, and how much that counts: a way without an equilibrium is left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub supports: Vec<SupportWeight>,
    /// Points that were asked for.
    pub targets: Vec<TargetPrediction>,
}

/// How many draws were solved themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrawsSolved {
    /// Those that were solved.
    pub solved: usize,
    /// All.
    pub of: usize,
}

/// Where a target lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TargetPlace {
    /// In tissue.
    #[default]
    Tissue,
    /// In fluid: it goes with the nearest tissue.
    Fluid,
    /// In tissue that is to be taken: nothing is said of where it goes.
    Removed,
}

impl TargetPlace {
    /// The word of tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tissue => "tissue",
            Self::Fluid => "fluid",
            Self::Removed => "removed",
        }
    }
}

/// A point of the scan, and where it is expected.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TargetPrediction {
    /// Its number in the file, from 1.
    pub target: usize,
    /// Its name there, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Where it lies.
    pub place: TargetPlace,
    /// Where it is, mm.
    pub at_mm: [f64; 3],
    /// Where it is expected, mm.
    pub expected_mm: [f64; 3],
    /// Length of the mean displacement, mm.
    pub shift_mm: f64,
    /// Root of the trace of the covariance, mm.
    pub sd_mm: f64,
    /// Half axes of the ellipsoid around the expected place that holds 95 % of the draws, the longest first, mm.
    pub half_axes_mm: [f64; 3],
    /// Their directions.
    pub axes: [[f64; 3]; 3],
    /// Probability of moving more than the threshold.
    pub over_threshold: f64,
}

impl TargetPrediction {
    /// What it is called to a reader: its number, and its name where it has one.
    pub fn called(&self) -> String {
        self.name.as_ref().map_or_else(|| self.target.to_string(), |name| format!("{} {name}", self.target))
    }
}

/// An unknown with its prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UnknownOutcome {
    /// Its name with the unit.
    pub name: String,
    /// What it belongs to.
    pub cause: Cause,
    /// The middle of its prior.
    pub median: f64,
    /// 95 % of its prior lie between.
    pub interval_95: [f64; 2],
}

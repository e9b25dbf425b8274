//! The brain shift in numbers, as `sim/brain_shift.json` keeps it.

use super::explained::Explained;
use super::fused::Left;
use super::shift::ShiftField;
use crate::experiment::estimate::Unexplained;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The brain shift of a case. Lengths in mm, positions in the pre-operative scan's frame, RAS.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BrainShift {
    /// The state of the model: `estimate`, or the best sample's name. The scan that is carried is carried by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Every state, the model's first.
    pub states: Vec<StateShift>,
    /// Which share of the seen shift the model explains, in the depth of the brain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explained: Option<Explained>,
    /// What the model leaves unexplained, as a process; absent where nothing is left.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub discrepancy: Option<Discrepancy>,
}

/// One state's field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateShift {
    /// `estimate`, `sample-05`, `fused`, `observed`.
    pub state: String,
    /// Largest displacement of tissue, mm.
    pub largest_mm: f64,
    /// Median displacement of tissue, mm.
    pub median_mm: f64,
    /// Where the largest is, mm, RAS, pre-operative scan.
    pub largest_at_mm: [f64; 3],
    /// Median standard deviation over the tissue (root of the trace of the covariance), mm.
    pub sd_median_mm: f64,
    /// Smallest determinant of the field's gradient.
    pub jacobian_min: f64,
    /// Voxels of tissue where the state folds and the field was smoothed: not believed.
    pub smoothed_voxels: usize,
    /// Tissue whose displacement is believed, cc.
    pub believed_cc: f64,
}

/// The process over what the model leaves of the seen displacement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Discrepancy {
    /// Standard deviation of one component, mm: no less than what a body made from scans misses always.
    pub size_mm: f64,
    /// Length over which it changes, mm.
    pub length_mm: f64,
    /// Size of what is left without the rigid remainder, as a factor on the registration's noise: the model's beyond 1.
    pub noise_factor: f64,
    /// Size of what looks like a remainder of the rigid registration, mm.
    #[serde(default)]
    pub rigid_mm: f64,
    /// Nodes it is conditioned on.
    pub nodes: usize,
}

impl StateShift {
    /// The numbers of a field; zeros where no tissue is believed.
    pub fn of(state: &str, field: &ShiftField) -> Self {
        let (largest_mm, median_mm, at) = field.sizes().unwrap_or_default();
        let mut sd: Vec<f32> =
            field.believed.iter().zip(&field.sd_mm).filter(|(b, _)| **b).map(|(_, sd)| *sd).collect();
        let count = sd.len();
        let median = (count > 0).then(|| *sd.select_nth_unstable_by(count / 2, f32::total_cmp).1);
        Self {
            state: state.to_owned(),
            largest_mm: rounded(largest_mm),
            median_mm: rounded(median_mm),
            largest_at_mm: at.map(rounded),
            sd_median_mm: rounded(median.map_or(0.0, f64::from)),
            jacobian_min: rounded(field.jacobian_min),
            smoothed_voxels: field.changed,
            believed_cc: rounded(count as f64 * field.forward.grid.voxel_volume_mm3() / 1000.0),
        }
    }
}

impl Discrepancy {
    /// The numbers of what is left.
    pub fn of(left: &Left) -> Self {
        let Unexplained { noise, discrepancy } = left.unexplained;
        Self {
            size_mm: rounded(discrepancy.sd_mm),
            length_mm: rounded(discrepancy.length_mm),
            noise_factor: rounded(left.size_mm / noise.sd_mm),
            rigid_mm: rounded(left.rigid_mm),
            nodes: left.places,
        }
    }
}

/// Micrometres: more than any use needs.
fn rounded(x: f64) -> f64 {
    (x * 1e3).round() / 1e3
}

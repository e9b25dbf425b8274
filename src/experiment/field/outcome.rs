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
    /// Largest displacement of tissue that is believed, mm; this and the next three are 0 where none is.
    pub largest_mm: f64,
    /// Median displacement of the same, mm.
    pub median_mm: f64,
    /// Where the largest is, mm, RAS, pre-operative scan.
    pub largest_at_mm: [f64; 3],
    /// Median standard deviation over the same (root of the trace of the covariance), mm.
    pub sd_median_mm: f64,
    /// Smallest determinant of the field's gradient.
    pub jacobian_min: f64,
    /// Voxels of tissue where the state folds and the field was smoothed: not believed.
    pub smoothed_voxels: usize,
    /// Tissue whose displacement is believed, cc.
    pub believed_cc: f64,
    /// Tissue that is left out of all sizes because the state folds there, cc; absent in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_believed_cc: Option<f64>,
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
        let voxel_mm3 = field.forward.grid.voxel_volume_mm3();
        Self {
            state: state.to_owned(),
            largest_mm: rounded(largest_mm),
            median_mm: rounded(median_mm),
            largest_at_mm: at.map(rounded),
            sd_median_mm: rounded(median.map_or(0.0, f64::from)),
            jacobian_min: rounded(field.jacobian_min),
            smoothed_voxels: field.changed,
            believed_cc: rounded(count as f64 * voxel_mm3 / 1000.0),
            // A single voxel is not rounded away.
            not_believed_cc: Some(rounded(field.changed as f64 * voxel_mm3) / 1000.0),
        }
    }

    /// Whether any of its displacement is believed; where none is, its sizes say nothing.
    pub fn is_believed(&self) -> bool {
        self.believed_cc > 0.0
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Grid, Volume};

    /// Four voxels of 8 mm3 of tissue, the last one moved far.
    fn field(believed: [bool; 4]) -> ShiftField {
        let grid = Grid::axis_aligned([4, 1, 1], [2.0; 3], [0.0; 3]);
        let vectors = vec![[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [9.0, 0.0, 0.0]];
        ShiftField {
            whole: grid,
            first: [0; 3],
            forward: Volume::from_data(grid, vectors.clone()),
            inverse: Volume::from_data(grid, vectors),
            sd_mm: vec![0.5; 4],
            reach95_mm: vec![10.0; 4],
            believed: believed.to_vec(),
            jacobian_min: 0.05,
            changed: believed.iter().filter(|b| !**b).count(),
        }
    }

    #[test]
    fn what_is_left_out_of_the_sizes_is_counted_and_no_tissue_is_not_tissue_that_stands_still() {
        let folded = StateShift::of("estimate", &field([true, true, true, false]));
        assert_eq!((folded.largest_mm, folded.believed_cc, folded.not_believed_cc), (3.0, 0.024, Some(0.008)));
        assert!(folded.is_believed());
        let none = StateShift::of("estimate", &field([false; 4]));
        assert!(!none.is_believed() && none.not_believed_cc == Some(0.032), "{none:?}");
    }

    #[test]
    fn a_file_from_before_what_is_left_out_was_counted_is_still_read() {
        let shift = StateShift::of("estimate", &field([true; 4]));
        let mut old = serde_json::to_value(&shift).unwrap();
        old.as_object_mut().unwrap().remove("not_believed_cc").unwrap();
        let read: StateShift = serde_json::from_value(old).unwrap();
        assert_eq!(read, StateShift { not_believed_cc: None, ..shift });
    }
}

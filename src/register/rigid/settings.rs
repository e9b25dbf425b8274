//! What steers a rigid registration.

use super::RegisterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a rigid registration is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RigidSettings {
    /// Resolutions in mm, coarse to fine.
    pub levels_mm: Vec<f64>,
    /// Resolution of the search over starting poses, in mm.
    pub start_level_mm: f64,
    /// Bins of the joint histogram on each axis.
    pub histogram_bins: usize,
    /// About how many points are sampled at the finest level; coarser levels take what they have, up to this.
    pub samples: usize,
    /// A step shorter than this ends the search at the finest level, in mm.
    pub tolerance_mm: f64,
    /// Whether the mirror image is tried too, to warn of exchanged sides; useless against a symmetric template.
    pub try_mirror: bool,
    /// How much longer along an axis a head may be in one of two scans of it than in the other, percent: more is a wrong voxel
    /// size in one header, and no motion takes one scan onto the other.
    pub largest_size_difference_percent: f64,
    /// Seed of the sampling pattern.
    pub seed: u64,
}

impl Default for RigidSettings {
    fn default() -> Self {
        Self {
            levels_mm: vec![4.0, 2.0, 1.0],
            start_level_mm: 8.0,
            histogram_bins: 48,
            samples: 250_000,
            tolerance_mm: 1e-3,
            try_mirror: true,
            largest_size_difference_percent: 3.5,
            seed: 1,
        }
    }
}

impl RigidSettings {
    /// Refuses settings out of range, by name.
    ///
    /// # Errors
    /// [`RegisterError::Setting`] or [`RegisterError::NoLevels`].
    pub fn check(&self) -> Result<(), RegisterError> {
        let refuse = |name, value, rule| Err(RegisterError::Setting { name, value, rule });
        if self.levels_mm.is_empty() {
            return Err(RegisterError::NoLevels);
        }
        if let Some(&bad) = self.levels_mm.iter().find(|&&l| !(l > 0.0 && l <= 16.0)) {
            return refuse("levels_mm", bad, "one or more resolutions between 0 and 16 mm");
        }
        if let Some(pair) = self.levels_mm.windows(2).find(|pair| pair[1] >= pair[0]) {
            return refuse("levels_mm", pair[1], "finer than the one before it: resolutions go from coarse to fine");
        }
        if !(self.start_level_mm > 0.0 && self.start_level_mm <= 16.0) {
            return refuse("start_level_mm", self.start_level_mm, "between 0 and 16 mm");
        }
        if !(8..=255).contains(&self.histogram_bins) {
            return refuse("histogram_bins", self.histogram_bins as f64, "between 8 and 255");
        }
        if self.samples < 1000 {
            return refuse("samples", self.samples as f64, "at least 1000");
        }
        if !(self.largest_size_difference_percent > 0.0 && self.largest_size_difference_percent <= 100.0) {
            let value = self.largest_size_difference_percent;
            return refuse("largest_size_difference_percent", value, "above 0 and at most 100 percent");
        }
        if !(self.tolerance_mm > 0.0 && self.tolerance_mm <= 1.0) {
            return refuse("tolerance_mm", self.tolerance_mm, "above 0 and at most 1 mm");
        }
        Ok(())
    }
}

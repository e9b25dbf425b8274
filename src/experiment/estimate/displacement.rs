//! Where in the brain the images say how far the tissue has moved.
//!
//! A deformable registration of the scan before the operation to the scan after it is surest in the depth of the brain: at
//! the skull, where tissue slides past bone, and at the cavity, where there is no tissue to be found again, its
//! smoothness ties what moves to what does not.

use super::{CorrelatedErrors, Process};
use crate::experiment::depth::depth_mm;
use crate::experiment::setting::{SettingError, first_broken};
use crate::mesh::TetMesh;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How far a displacement seen in the images is believed; the table `[estimate.displacement]` of the settings.
///
/// Depth was chosen on synthetic patients, whose displacement is known (docs/evidence/choices.md). Noise and length are what the
/// registration shows of a pair that has not moved, and what is left of the noise what it shows of pairs whose displacement is known
/// (docs/evidence/estimate.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DisplacementSettings {
    /// Nodes nearer than this to the brain's outside or to the margin are left out, mm.
    pub depth_mm: f64,
    /// Standard deviation of one component, mm.
    pub noise_mm: f64,
    /// Standard deviation of one component once the registration's own error is taken out, mm: what the model leaves is held
    /// against this.
    pub corrected_noise_mm: f64,
    /// Length over which errors are alike, mm: that of Matern's covariance of order 3/2.
    pub correlation_mm: f64,
    /// Most nodes that are looked at; those between them say the same.
    pub places: usize,
    /// How many times at least the registration's own error is measured on the estimate's state and taken out (twice more
    /// where the state has since moved by more than the noise); 0 for never.
    pub re_registrations: usize,
}

impl Default for DisplacementSettings {
    fn default() -> Self {
        Self {
            depth_mm: 10.0,
            noise_mm: 0.2,
            corrected_noise_mm: 0.1,
            correlation_mm: 20.0,
            places: 400,
            re_registrations: 1,
        }
    }
}

impl DisplacementSettings {
    /// Refuses what nothing can be observed with.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        first_broken(&[
            ("depth_mm", &self.depth_mm, self.depth_mm >= 0.0, "0 or more"),
            ("noise_mm", &self.noise_mm, positive(self.noise_mm), "above 0"),
            ("corrected_noise_mm", &self.corrected_noise_mm, positive(self.corrected_noise_mm), "above 0"),
            ("correlation_mm", &self.correlation_mm, positive(self.correlation_mm), "above 0"),
            ("places", &self.places, (10..=4000).contains(&self.places), "10 to 4000"),
        ])
    }

    /// The nodes deep enough, each with its displacement (mm) by `seen`, a map from the rest position (mm).
    pub fn observed(&self, mesh: &TetMesh, seen: impl Fn([f64; 3]) -> [f64; 3] + Sync) -> Vec<(u32, [f64; 3])> {
        let depths_mm = depth_mm(mesh);
        let deep = |n: &usize| depths_mm[*n] >= self.depth_mm;
        let nodes: Vec<usize> = (0..mesh.nodes_mm().len()).filter(deep).collect();
        nodes.into_par_iter().map(|n| (n as u32, seen(mesh.nodes_mm()[n]))).collect()
    }

    /// How far the displacements are believed, when the rigid registration is expected to be off by `rigid_mm`.
    pub fn errors(&self, rigid_mm: f64) -> CorrelatedErrors {
        let noise = Process { sd_mm: self.noise_mm, length_mm: self.correlation_mm };
        CorrelatedErrors {
            noise,
            corrected_mm: self.corrected_noise_mm.min(self.noise_mm),
            rigid_mm: rigid_mm.max(1e-6),
            places: self.places,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    #[test]
    fn what_is_left_of_the_noise_is_no_more_than_there_was() {
        let settings = DisplacementSettings { noise_mm: 0.05, ..DisplacementSettings::default() };
        assert_eq!(settings.errors(0.2).corrected_mm, 0.05);
        let settings = DisplacementSettings::default();
        assert!(settings.errors(0.2).corrected_mm < settings.errors(0.2).noise.sd_mm);
    }

    #[test]
    fn only_nodes_deep_enough_are_believed_and_see_the_map_at_rest() {
        let mesh = block(6);
        let settings = DisplacementSettings { depth_mm: 12.0, ..DisplacementSettings::default() };
        let seen = settings.observed(&mesh, |x| [0.1 * x[0], 0.0, -x[2]]);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for x in mesh.nodes_mm() {
            for a in 0..3 {
                (low[a], high[a]) = (low[a].min(x[a]), high[a].max(x[a]));
            }
        }
        let deep = |x: &[f64; 3]| (0..3).all(|a| x[a] - low[a] > 12.0 - 1e-9 && high[a] - x[a] > 12.0 - 1e-9);
        let expected = mesh.nodes_mm().iter().filter(|x| deep(x)).count();
        assert!(expected > 0 && expected < mesh.nodes_mm().len());
        assert_eq!(seen.len(), expected);
        for (n, u) in seen {
            let x = mesh.nodes_mm()[n as usize];
            assert!(deep(&x));
            assert_eq!(u, [0.1 * x[0], 0.0, -x[2]]);
        }
    }
}

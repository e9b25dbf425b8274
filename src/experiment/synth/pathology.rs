//! What else than the operation is the matter with a synthetic patient.

use super::scans::Scans;
use crate::experiment::smooth_noise::SmoothNoise;
use crate::material::random::CounterRng;
use nalgebra::Point3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What else is the matter; by default nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pathology {
    /// Scans with oedema: darker white matter around what is going to be resected, or around the cavity.
    pub oedema: Scans,
    /// How far the oedema reaches, in mm (1 to 40).
    pub oedema_mm: f64,
    /// How much darker its white matter is at the resection, as a share of its intensity (up to 0.7).
    pub oedema_fraction: f64,
    /// Volume of an old lesion, in cubic centimetres: a stroke's cavity, full of fluid, in both scans, away from the resection. 0 is
    /// none; otherwise 1 to 80.
    pub old_lesion_cc: f64,
    /// How many times as large the ventricles are as the head's own (1 to 4).
    pub ventricle_factor: f64,
}

impl Default for Pathology {
    fn default() -> Self {
        Self { oedema: Scans::None, oedema_mm: 15.0, oedema_fraction: 0.35, old_lesion_cc: 0.0, ventricle_factor: 1.0 }
    }
}

impl Pathology {
    /// Fields with value and range, in the order of the struct.
    pub(super) fn ranges(&self) -> [(&'static str, f64, f64, f64); 4] {
        // Less than a cubic centimetre would be a lacune, which the seeded wall would dissolve.
        let least_cc = if self.old_lesion_cc == 0.0 { 0.0 } else { 1.0 };
        [
            ("pathology.oedema_mm", self.oedema_mm, 1.0, 40.0),
            ("pathology.oedema_fraction", self.oedema_fraction, 0.0, 0.7),
            ("pathology.old_lesion_cc", self.old_lesion_cc, least_cc, 80.0),
            ("pathology.ventricle_factor", self.ventricle_factor, 1.0, 4.0),
        ]
    }

    /// The oedema of a patient; `None` where it would darken nothing.
    pub(super) fn oedema(&self, seed: u64) -> Option<Oedema> {
        let some = self.oedema != Scans::None && self.oedema_fraction > 0.0;
        some.then(|| Oedema {
            reach_mm: self.oedema_mm,
            fraction: self.oedema_fraction,
            fingers: SmoothNoise::new(CounterRng::new(seed, 701), 14.0),
            scans: self.oedema,
        })
    }
}

/// Water in the white matter around a resection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Oedema {
    reach_mm: f64,
    fraction: f64,
    fingers: SmoothNoise,
    /// Where it is seen.
    pub scans: Scans,
}

impl Oedema {
    /// The intensity of white matter `wall_mm` from the resection's wall (negative inside).
    pub fn of_white_matter(&self, intensity: f64, p: Point3<f64>, wall_mm: f64) -> f64 {
        // It runs along the white matter in fingers: shorter here, longer there, never beyond its reach.
        let reach_mm = self.reach_mm * (0.75 + 0.25 * self.fingers.at(p.into()));
        let t = (1.0 - wall_mm.max(0.0) / reach_mm).clamp(0.0, 1.0);
        intensity * (1.0 - self.fraction * t * t * (3.0 - 2.0 * t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oedema_darkens_by_its_share_at_the_wall_less_further_off_and_nothing_beyond_its_reach() {
        let oedema = Pathology { oedema: Scans::Pre, ..Pathology::default() }.oedema(3).unwrap();
        for n in 0..50 {
            let p = Point3::new(f64::from(n), 7.0, -3.0);
            let at = |mm| oedema.of_white_matter(200.0, p, mm);
            assert!((at(0.0) - 130.0).abs() < 1e-9 && (at(-4.0) - 130.0).abs() < 1e-9);
            assert!(at(2.0) > at(0.0) && at(5.0) > at(2.0) && at(15.0) == 200.0);
        }
    }

    #[test]
    fn nothing_is_the_matter_by_default() {
        assert!(Pathology::default().oedema(1).is_none());
    }
}

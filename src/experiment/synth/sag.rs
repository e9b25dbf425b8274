//! How the brain moves once part of it is gone.

use super::field::{Field, in_template};
use super::frame::Patient;
use super::head::Head;
use super::resection::Resection;
use super::settings::SynthSettings;
use crate::image::Grid;
use crate::material::random::CounterRng;
use nalgebra::{Point3, Vector3};

/// Where gravity pulls in the patient: the patient lies on the back, the head turned a little by the seed. Unit length.
pub fn gravity(seed: u64) -> Vector3<f64> {
    let tilt = Vector3::from(CounterRng::new(seed, 301).direction(0));
    (Vector3::new(0.0, -1.0, 0.0) + 0.35 * tilt).normalize()
}

/// A 2 mm grid over the brain of any patient.
pub fn grid() -> Grid<Patient> {
    Grid::axis_aligned([93, 117, 96], [2.0; 3], [-92.0, -134.0, -88.0])
}

/// A smooth sag: along gravity over some 3 cm around the cavity and into the cavity near its wall, fading to nothing
/// within a centimetre of the skull. The largest displacement is `sag_mm`.
pub fn smooth(head: &Head, anatomy: &Field, resection: &Resection, settings: &SynthSettings) -> Field {
    let down = gravity(settings.seed);
    let shape = |p: Point3<f64>| {
        let q = in_template(anatomy, p);
        let depth_mm = head.skull_mm.trilinear(q).map_or(0.0, |d| f64::from(-d));
        let t = (depth_mm / 10.0).clamp(0.0, 1.0);
        let free = t * t * (3.0 - 2.0 * t);
        let far_mm = resection.distance_mm(p).max(0.0);
        let inward = resection.centroid - p;
        let inward = inward / inward.norm().max(18.0);
        free * (down * (-(far_mm / 32.0).powi(2)).exp() + 0.6 * inward * (-(far_mm / 16.0).powi(2)).exp())
    };
    let largest = Field::sampled(grid(), shape).largest_mm();
    let scale = if largest > 0.0 { settings.sag_mm / largest } else { 0.0 };
    Field::sampled(grid(), |p| scale * shape(p))
}

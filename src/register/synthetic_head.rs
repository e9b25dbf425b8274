//! A head given by formulas, for tests: defined everywhere, so that it can be imaged at any pose without interpolation.

use nalgebra::Point3;

/// 1 inside an ellipsoid, 0 outside, with an edge about 1.5 mm wide for a body about 70 mm in size.
fn soft(p: Point3<f64>, centre: [f64; 3], radii: [f64; 3]) -> f64 {
    let e: f64 = (0..3).map(|a| ((p[a] - centre[a]) / radii[a]).powi(2)).sum::<f64>().sqrt();
    1.0 / (1.0 + ((e - 1.0) * 90.0).exp())
}

/// Folded tissue with an eccentric dark mass that breaks the symmetry, zero outside the brain.
pub(super) fn brain_value(p: Point3<f64>) -> f64 {
    let brain = soft(p, [0.0, -2.0, 4.0], [65.0, 81.0, 71.0]);
    let mass = soft(p, [32.0, -25.0, 20.0], [16.0, 20.0, 14.0]);
    let folds = (p.x * 0.31).sin() * (p.y * 0.23 + 1.0).sin() * (p.z * 0.27 + p.x * 0.05).cos();
    brain * (620.0 + 140.0 * (3.0 * folds).tanh() - 350.0 * mass)
}

/// The brain within a dark skull, a bright scalp and a nose.
pub(super) fn head_value(p: Point3<f64>) -> f64 {
    let scalp = soft(p, [0.0, 0.0, 0.0], [78.0, 95.0, 85.0]);
    let skull = soft(p, [0.0, 0.0, 2.0], [72.0, 89.0, 79.0]);
    let brain = soft(p, [0.0, -2.0, 4.0], [65.0, 81.0, 71.0]);
    let nose = soft(p, [0.0, 97.0, -30.0], [12.0, 16.0, 18.0]);
    900.0 * (scalp - skull).max(0.0) + 700.0 * nose * (1.0 - scalp) + 120.0 * skull * (1.0 - brain) + brain_value(p)
}

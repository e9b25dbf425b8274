//! The laws every hyperelastic model must obey, checked once for all of them.

use super::hyperelastic::Hyperelastic;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Deformations that tell laws apart: general, equal, nearly equal and distinct principal stretches, shear.
fn displacement_gradients() -> Vec<Matrix3<f64>> {
    let diag = |a: f64, b: f64, c: f64| Matrix3::from_diagonal(&Vector3::new(a - 1.0, b - 1.0, c - 1.0));
    let turn = *Rotation3::from_scaled_axis(Vector3::new(0.3, -0.7, 0.4)).matrix();
    let general = Matrix3::new(0.12, -0.05, 0.08, 0.03, -0.09, 0.06, -0.07, 0.1, 0.05);
    vec![
        Matrix3::zeros(),
        diag(0.95, 0.95, 0.95),
        diag(1.1, 1.1, 0.9),
        diag(1.1, 1.1 + 1e-9, 0.93),
        diag(1.2, 1.0, 0.9),
        Matrix3::new(0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        general,
        turn * (Matrix3::identity() + diag(1.15, 0.9, 0.97)) * turn.transpose() - Matrix3::identity(),
    ]
}

/// [`check_hyperelastic_within`] at deformations of up to a half.
///
/// # Panics
/// When a law is broken; the message names it.
pub fn check_hyperelastic(law: &dyn Hyperelastic) {
    check_hyperelastic_within(law, 1.0);
}

/// Panics unless stress is the derivative of energy, the tangent that of stress and symmetric, energy and stress
/// vanish at rest, a rotation after the deformation changes the energy not at all and turns the stress, and the
/// small-strain shear modulus is the one the law states. `size` multiplies the deformations, for laws of a small domain.
/// Meant for tests.
///
/// # Panics
/// When a law is broken; the message names it.
pub fn check_hyperelastic_within(law: &dyn Hyperelastic, size: f64) {
    let scale = law.small_strain_shear_modulus_pa().abs();
    let step = 1e-6;
    let turn = *Rotation3::from_scaled_axis(Vector3::new(-0.5, 0.2, 0.9)).matrix();
    assert!(law.energy_density_pa(&Matrix3::zeros()).abs() <= 1e-12 * scale, "energy is zero at rest");
    assert!(law.first_piola_kirchhoff_pa(&Matrix3::zeros()).abs().max() <= 1e-10 * scale, "stress is zero at rest");
    for h in displacement_gradients().into_iter().map(|h| h * size) {
        let stress = law.first_piola_kirchhoff_pa(&h);
        let tangent = law.tangent_pa(&h);
        let (stress_scale, tangent_scale) = (stress.abs().max().max(scale), tangent.abs().max().max(scale));
        assert!((tangent - tangent.transpose()).abs().max() <= 1e-9 * tangent_scale, "tangent is symmetric at {h}");
        for entry in 0..9 {
            let (mut plus, mut minus) = (h, h);
            plus[entry] += step;
            minus[entry] -= step;
            let slope = (law.energy_density_pa(&plus) - law.energy_density_pa(&minus)) / (2.0 * step);
            assert!(
                (slope - stress[entry]).abs() <= 1e-6 * stress_scale,
                "stress is the derivative of energy: entry {entry} at {h}"
            );
            let slope = (law.first_piola_kirchhoff_pa(&plus) - law.first_piola_kirchhoff_pa(&minus)) / (2.0 * step);
            for row in 0..9 {
                let error = (slope[row] - tangent[(row, entry)]).abs();
                assert!(error <= 1e-6 * tangent_scale, "tangent is the derivative of stress: ({row}, {entry}) at {h}");
            }
        }
        let turned = turn * (Matrix3::identity() + h) - Matrix3::identity();
        let energy = law.energy_density_pa(&h);
        assert!(
            (law.energy_density_pa(&turned) - energy).abs() <= 1e-9 * energy.abs().max(scale),
            "objectivity of energy at {h}"
        );
        assert!(
            (law.first_piola_kirchhoff_pa(&turned) - turn * stress).abs().max() <= 1e-9 * stress_scale,
            "objectivity of stress at {h}"
        );
    }
    let shear = law.tangent_pa(&Matrix3::zeros())[(3, 3)];
    assert!(
        (shear - scale).abs() <= 1e-9 * scale,
        "small-strain shear modulus is the one stated: {shear} against {scale}"
    );
}

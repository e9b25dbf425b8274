//! Stable neo-Hookean law.

use super::curve::UniaxialCurve;
use super::definition::{Card, Estimated, Law, LawParameter, Range, Role, Values, Volume};
use super::hyperelastic::{Hyperelastic, Tangent};
use super::stability::Stability;
use super::volume::{OfVolume, add_tangent_of_volume, cofactors, lame_lambda_pa, volume_change};
use nalgebra::Matrix3;

/// The law for files and sensitivities. It is not fitted: a fitted neo-Hookean modulus is its modulus.
pub struct Definition;

impl Law for Definition {
    fn card(&self) -> &'static Card {
        &Card {
            name: "stable-neo-hookean",
            formula: "mu/2 (I1 - 3) - mu/2 ln((I1 + 1)/4) - 3 mu/4 (J - 1) + lambda/2 (J - 1)^2, mu and lambda the paper's",
            source: "Smith, de Goes and Kim, Stable neo-Hookean flesh simulation, ACM TOG 37, 2018, eq. 14",
            parameters: &[LawParameter {
                name: "shear_modulus_pa",
                meaning: "shear modulus of small strains, Pa",
                role: Role::Modulus,
                range: Range::POSITIVE,
                default: None,
            }],
            of_terms: false,
            shear_modulus: "`shear_modulus_pa`",
            continued: false,
        }
    }

    fn shear_modulus_pa(&self, values: &[f64]) -> f64 {
        values[0]
    }

    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic> {
        Box::new(StableNeoHookean { shear_modulus_pa: values[0], lame_lambda_pa: volume.lame_lambda_pa })
    }

    fn curves(&self) -> &'static [&'static dyn UniaxialCurve] {
        &[]
    }

    fn measured(&self, _values: &[f64]) -> Option<([f64; 2], Stability)> {
        None
    }

    fn estimated(&self) -> Estimated {
        Estimated::Not
    }

    fn examples(&self) -> Vec<Values> {
        vec![vec![1000.0], vec![333.28]]
    }
}

/// Psi = mu/2 (I1 - 3) - mu/2 ln((I1 + 1)/4) - 3 mu/4 (J - 1) + lambda/2 (J - 1)^2: finite for every F, at rest only in
/// rotations (Smith, de Goes and Kim, "Stable neo-Hookean flesh simulation", ACM TOG 2018, eq. 14, expanded so that
/// lambda stands apart). The names match small strains: the paper's mu and lambda are 4/3 mu and lambda + 5/6 mu.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableNeoHookean {
    /// Shear modulus of small strains, Pa.
    pub shear_modulus_pa: f64,
    /// First Lame constant of small strains, Pa.
    pub lame_lambda_pa: f64,
}

impl StableNeoHookean {
    /// From the shear modulus and Poisson's ratio.
    pub fn new(shear_modulus_pa: f64, poisson_ratio: f64) -> Self {
        Self { shear_modulus_pa, lame_lambda_pa: lame_lambda_pa(shear_modulus_pa, poisson_ratio) }
    }

    /// The paper's mu.
    fn mu(&self) -> f64 {
        4.0 / 3.0 * self.shear_modulus_pa
    }

    fn of_volume(&self, j_minus_1: f64) -> OfVolume {
        let lambda = self.lame_lambda_pa + 5.0 / 6.0 * self.shear_modulus_pa;
        let slope = 0.75 * self.mu();
        OfVolume {
            value: (0.5 * lambda * j_minus_1 - slope) * j_minus_1,
            first: lambda * j_minus_1 - slope,
            second: lambda,
        }
    }
}

impl Hyperelastic for StableNeoHookean {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        let i1_minus_3 = 2.0 * h.trace() + h.norm_squared();
        0.5 * self.mu() * (i1_minus_3 - (0.25 * i1_minus_3).ln_1p()) + self.of_volume(volume_change(h)).value
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let f = Matrix3::identity() + h;
        let i1 = f.norm_squared();
        f * (self.mu() * (1.0 - 1.0 / (i1 + 1.0))) + cofactors(&f) * self.of_volume(volume_change(h)).first
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let f = Matrix3::identity() + h;
        let i1 = f.norm_squared();
        let (scale, outer) = (self.mu() * (1.0 - 1.0 / (i1 + 1.0)), 2.0 * self.mu() / (i1 + 1.0).powi(2));
        let mut tangent = Tangent::from_fn(|row, col| outer * f[row] * f[col] + if row == col { scale } else { 0.0 });
        add_tangent_of_volume(&mut tangent, self.of_volume(volume_change(h)), &f);
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.shear_modulus_pa
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::check_hyperelastic;

    #[test]
    fn stable_neo_hookean_obeys_the_laws_of_hyperelasticity() {
        check_hyperelastic(&StableNeoHookean::new(1000.0, 0.45));
        check_hyperelastic(&StableNeoHookean::new(333.28, 0.3));
    }

    #[test]
    fn a_flat_element_is_pushed_back() {
        let law = StableNeoHookean::new(1000.0, 0.45);
        let flat = Matrix3::from_diagonal(&nalgebra::Vector3::new(0.0, 0.0, -1.0));
        assert!(law.energy_density_pa(&flat).is_finite());
        assert!(law.first_piola_kirchhoff_pa(&flat)[(2, 2)] < 0.0);
    }
}

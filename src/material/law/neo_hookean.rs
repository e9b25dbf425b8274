//! Compressible neo-Hookean law.

use super::curve::{Data, Search, Slope, Start, UniaxialCurve};
use super::definition::{Card, Estimated, Law, LawParameter, Range, Role, Values, Volume};
use super::hyperelastic::{Hyperelastic, Tangent};
use super::stability::{Stability, StabilityRange};
use super::volume::{VolumeLogarithm, add_tangent_of_volume, cofactors, lame_lambda_pa, volume_change};
use crate::material::form::first_uniaxial;
use nalgebra::Matrix3;

/// The law for files, fits and sensitivities.
pub struct Definition;

impl Law for Definition {
    fn card(&self) -> &'static Card {
        &Card {
            name: "neo-hookean",
            formula: "mu/2 (I1 - 3) - mu ln J + lambda/2 ln^2 J",
            source: "Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, 2nd ed., eq. 6.27",
            parameters: &[LawParameter {
                name: "shear_modulus_pa",
                meaning: "shear modulus mu, Pa",
                role: Role::Modulus,
                range: Range::POSITIVE,
                default: None,
            }],
            of_terms: false,
            shear_modulus: "`shear_modulus_pa`",
            continued: true,
        }
    }

    fn shear_modulus_pa(&self, values: &[f64]) -> f64 {
        values[0]
    }

    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic> {
        let Volume { lame_lambda_pa, inversion_threshold } = volume;
        Box::new(NeoHookean { shear_modulus_pa: values[0], lame_lambda_pa, inversion_threshold })
    }

    fn curves(&self) -> &'static [&'static dyn UniaxialCurve] {
        &[&Self]
    }

    fn measured(&self, _values: &[f64]) -> Option<([f64; 2], Stability)> {
        None
    }

    fn estimated(&self) -> Estimated {
        Estimated::Modulus
    }

    fn examples(&self) -> Vec<Values> {
        vec![vec![1000.0], vec![333.28]]
    }
}

/// W = mu/2 (I1 - 3). Stable at every stretch if and only if mu > 0.
impl UniaxialCurve for Definition {
    fn name(&self) -> &'static str {
        "neo-hookean"
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["mu_pa"]
    }

    fn energy_pa(&self, parameters: &[f64], stretch: f64) -> f64 {
        0.5 * parameters[0] * first_uniaxial(stretch)
    }

    fn energy_slope_pa(&self, _parameters: &[f64], stretch: f64) -> Slope {
        [0.5 * first_uniaxial(stretch), 0.0, 0.0]
    }

    fn stress_pa(&self, parameters: &[f64], l: f64) -> f64 {
        parameters[0] * (l - l.powi(-2))
    }

    fn stress_slope_pa(&self, _parameters: &[f64], l: f64) -> Slope {
        [l - l.powi(-2), 0.0, 0.0]
    }

    fn starts(&self, search: Search, data: &Data) -> Vec<Start> {
        match search {
            Search::Published => vec![Start::new(&[1000.0], &[1e-3], &[f64::INFINITY])],
            Search::Exact => vec![Start::new(&[data.modulus_pa], &[0.0], &[f64::INFINITY])],
        }
    }

    fn stability(&self, parameters: &[f64], _window: [f64; 2]) -> Stability {
        Stability::all(StabilityRange::of(parameters[0] > 0.0, false))
    }

    fn values(&self, parameters: &[f64]) -> Vec<f64> {
        vec![parameters[0]]
    }

    /// The published program's W' is W itself and its denominator mu W + offset.
    fn published_slope(&self, parameters: &[f64], stretch: f64, log_offset_pa: f64) -> Option<f64> {
        let energy = self.energy_pa(parameters, stretch);
        Some(energy / (parameters[0] * energy + log_offset_pa))
    }
}

/// Psi = mu/2 (I1 - 3) - mu ln J + lambda/2 ln^2 J, infinite for J <= 0 (Bonet and Wood, "Nonlinear Continuum
/// Mechanics for Finite Element Analysis", 2nd ed., eq. 6.27; the paper's law).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean {
    /// mu, Pa.
    pub shear_modulus_pa: f64,
    /// lambda, Pa.
    pub lame_lambda_pa: f64,
    /// Volume ratio below which ln J is continued by its Taylor polynomial, so that inverted elements have a finite
    /// energy and are pushed back; 0: never, the energy is infinite there.
    pub inversion_threshold: f64,
}

impl NeoHookean {
    /// From the shear modulus and Poisson's ratio: lambda = 2 mu nu / (1 - 2 nu).
    pub fn new(shear_modulus_pa: f64, poisson_ratio: f64) -> Self {
        Self {
            shear_modulus_pa,
            lame_lambda_pa: lame_lambda_pa(shear_modulus_pa, poisson_ratio),
            inversion_threshold: 0.0,
        }
    }
}

impl NeoHookean {
    fn logarithm(&self) -> VolumeLogarithm {
        VolumeLogarithm { floor: self.inversion_threshold }
    }
}

impl Hyperelastic for NeoHookean {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        let (mu, lambda) = (self.shear_modulus_pa, self.lame_lambda_pa);
        // I1 - 3 = 2 tr H + |H|^2.
        0.5 * mu * (2.0 * h.trace() + h.norm_squared()) + self.logarithm().energy(mu, lambda, volume_change(h)).value
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let f = Matrix3::identity() + h;
        let of_volume = self.logarithm().energy(self.shear_modulus_pa, self.lame_lambda_pa, volume_change(h));
        f * self.shear_modulus_pa + cofactors(&f) * of_volume.first
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let of_volume = self.logarithm().energy(self.shear_modulus_pa, self.lame_lambda_pa, volume_change(h));
        let mut tangent = Tangent::identity() * self.shear_modulus_pa;
        add_tangent_of_volume(&mut tangent, of_volume, &(Matrix3::identity() + h));
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.shear_modulus_pa
    }

    fn neo_hookean(&self) -> Option<[f64; 3]> {
        Some([self.shear_modulus_pa, self.lame_lambda_pa, self.inversion_threshold])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::check_hyperelastic;

    #[test]
    fn neo_hookean_obeys_the_laws_of_hyperelasticity() {
        check_hyperelastic(&NeoHookean::new(1000.0, 0.45));
        check_hyperelastic(&NeoHookean::new(333.28, 0.3));
        // Continued below J = 0.97, so that the battery's compressed states lie in the continuation.
        check_hyperelastic(&NeoHookean { inversion_threshold: 0.97, ..NeoHookean::new(1000.0, 0.45) });
    }
}

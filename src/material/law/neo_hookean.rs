//! Compressible neo-Hookean law.

use super::volume::{VolumeLogarithm, add_tangent_of_volume, cofactors, lame_lambda_pa, volume_change};
use super::{Hyperelastic, Tangent};
use nalgebra::Matrix3;

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

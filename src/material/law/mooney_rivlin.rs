//! Compressible Mooney-Rivlin law.

use super::volume::{VolumeLogarithm, add_tangent_of_volume, cofactors, lame_lambda_pa, volume_change};
use super::{Hyperelastic, Tangent};
use nalgebra::Matrix3;

/// Psi = C1 (I1 - 3) + C2 (I2 - 3) - 2 (C1 + 2 C2) ln J + lambda/2 ln^2 J, infinite for J <= 0 (Holzapfel,
/// "Nonlinear Solid Mechanics", 2000, eq. 6.147, with a logarithmic volume term). mu = 2 (C1 + C2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MooneyRivlin {
    /// C1, Pa.
    pub c1_pa: f64,
    /// C2, Pa.
    pub c2_pa: f64,
    /// lambda, Pa.
    pub lame_lambda_pa: f64,
    /// Volume ratio below which ln J is continued by its Taylor polynomial; 0: never.
    pub inversion_threshold: f64,
}

impl MooneyRivlin {
    /// From C1, C2 and Poisson's ratio.
    pub fn new(c1_pa: f64, c2_pa: f64, poisson_ratio: f64) -> Self {
        let lame_lambda_pa = lame_lambda_pa(2.0 * (c1_pa + c2_pa), poisson_ratio);
        Self { c1_pa, c2_pa, lame_lambda_pa, inversion_threshold: 0.0 }
    }

    fn of_volume(&self, h: &Matrix3<f64>) -> super::volume::OfVolume {
        let logarithm = VolumeLogarithm { floor: self.inversion_threshold };
        logarithm.energy(2.0 * (self.c1_pa + 2.0 * self.c2_pa), self.lame_lambda_pa, volume_change(h))
    }
}

impl Hyperelastic for MooneyRivlin {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        // With E = C - I: I1 - 3 = tr E and I2 - 3 = 2 tr E + (tr^2 E - tr E^2) / 2.
        let e = h + h.transpose() + h.transpose() * h;
        let tr = e.trace();
        let i2_minus_3 = 2.0 * tr + 0.5 * (tr * tr - e.norm_squared());
        self.c1_pa * tr + self.c2_pa * i2_minus_3 + self.of_volume(h).value
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let f = Matrix3::identity() + h;
        let c = f.transpose() * f;
        f * (2.0 * (self.c1_pa + self.c2_pa * c.trace())) - f * c * (2.0 * self.c2_pa)
            + cofactors(&f) * self.of_volume(h).first
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let f = Matrix3::identity() + h;
        let (c, b) = (f.transpose() * f, f * f.transpose());
        let (c1, c2) = (2.0 * self.c1_pa, 2.0 * self.c2_pa);
        let mut tangent = Tangent::from_fn(|row, col| {
            let (i, j, k, l) = (row % 3, row / 3, col % 3, col / 3);
            let (ik, jl) = (f64::from(u8::from(i == k)), f64::from(u8::from(j == l)));
            let second =
                2.0 * f[row] * f[col] + c.trace() * ik * jl - ik * c[(l, j)] - f[(i, l)] * f[(k, j)] - b[(i, k)] * jl;
            c1 * ik * jl + c2 * second
        });
        add_tangent_of_volume(&mut tangent, self.of_volume(h), &f);
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        2.0 * (self.c1_pa + self.c2_pa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::check_hyperelastic;

    #[test]
    fn mooney_rivlin_obeys_the_laws_of_hyperelasticity() {
        check_hyperelastic(&MooneyRivlin::new(300.0, 200.0, 0.45));
        check_hyperelastic(&MooneyRivlin::new(700.0, -100.0, 0.3));
        check_hyperelastic(&MooneyRivlin { inversion_threshold: 0.97, ..MooneyRivlin::new(300.0, 200.0, 0.45) });
    }
}

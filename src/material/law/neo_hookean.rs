//! Compressible neo-Hookean law.

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
}

impl NeoHookean {
    /// From the shear modulus and Poisson's ratio: lambda = 2 mu nu / (1 - 2 nu).
    pub fn new(shear_modulus_pa: f64, poisson_ratio: f64) -> Self {
        Self { shear_modulus_pa, lame_lambda_pa: 2.0 * shear_modulus_pa * poisson_ratio / (1.0 - 2.0 * poisson_ratio) }
    }
}

/// det(I + H) - 1 without the cancellation of forming F.
fn volume_change(h: &Matrix3<f64>) -> f64 {
    let minors = h[(0, 0)] * h[(1, 1)] - h[(0, 1)] * h[(1, 0)] + h[(1, 1)] * h[(2, 2)] - h[(1, 2)] * h[(2, 1)]
        + h[(0, 0)] * h[(2, 2)]
        - h[(0, 2)] * h[(2, 0)];
    h.trace() + minors + h.determinant()
}

impl Hyperelastic for NeoHookean {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        let (mu, lambda) = (self.shear_modulus_pa, self.lame_lambda_pa);
        let j_minus_1 = volume_change(h);
        if j_minus_1 <= -1.0 {
            return f64::INFINITY;
        }
        let ln_j = j_minus_1.ln_1p();
        // I1 - 3 = 2 tr H + |H|^2.
        0.5 * mu * (2.0 * h.trace() + h.norm_squared()) - mu * ln_j + 0.5 * lambda * ln_j * ln_j
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let (mu, lambda) = (self.shear_modulus_pa, self.lame_lambda_pa);
        let f = Matrix3::identity() + h;
        let ln_j = volume_change(h).ln_1p();
        let f_inv_t = f.try_inverse().map_or(Matrix3::repeat(f64::NAN), |m| m.transpose());
        // F - F^-T = H + (I - F^-T) and I - F^-T = F^-T H^T: no cancellation near rest.
        (h + f_inv_t * h.transpose()) * mu + f_inv_t * (lambda * ln_j)
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let (mu, lambda) = (self.shear_modulus_pa, self.lame_lambda_pa);
        let f = Matrix3::identity() + h;
        let ln_j = volume_change(h).ln_1p();
        let g = f.try_inverse().map_or(Matrix3::repeat(f64::NAN), |m| m.transpose());
        // dF^-T_ab / dF_cd = -F^-T_ad F^-T_cb.
        Tangent::from_fn(|row, col| {
            let (a, b, c, d) = (row % 3, row / 3, col % 3, col / 3);
            let identity = if row == col { mu } else { 0.0 };
            identity + (mu - lambda * ln_j) * g[(a, d)] * g[(c, b)] + lambda * g[(a, b)] * g[(c, d)]
        })
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
    }
}

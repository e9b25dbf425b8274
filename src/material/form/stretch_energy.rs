//! What every form is: an energy density in the principal stretches.

use super::number::Number;

/// A form: energy density in the principal stretches.
pub trait StretchEnergy {
    /// W(l), Pa (J/m3), on the uniaxial isochoric path; zero at l = 1, not a number outside the form's domain.
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N;
    /// Psi of three principal stretches, Pa. Isochoric forms take l_i J^(-1/3).
    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N;
    /// Shear modulus at rest, Pa: W is 3/2 of it times the squared strain.
    fn small_strain_shear_modulus_pa(&self) -> f64;
    /// Psi with the change of volume ruled by this first Lame constant (Pa) at rest instead of by a term of the form's
    /// own: isochoric forms get K/2 ln^2 J with K = lambda + 2/3 mu.
    fn energy_with_lambda_pa<N: Number>(&self, stretches: [N; 3], lame_lambda_pa: f64) -> N {
        self.energy_pa(stretches) + of_volume(stretches, lame_lambda_pa, self.small_strain_shear_modulus_pa())
    }
}

/// K/2 ln^2 J with K = lambda + 2/3 mu.
pub(super) fn of_volume<N: Number>(stretches: [N; 3], lame_lambda_pa: f64, shear_modulus_pa: f64) -> N {
    let ln_j = (stretches[0] * stretches[1] * stretches[2]).ln();
    ln_j * ln_j * (0.5 * (lame_lambda_pa + 2.0 / 3.0 * shear_modulus_pa))
}

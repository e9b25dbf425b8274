//! Gent's form of limited extensibility.

use super::invariant::{first, first_uniaxial, isochoric};
use super::number::Number;
use super::stretch_energy::StretchEnergy;

/// Psi = -(mu Jm / 2) ln(1 - (I1 - 3) / Jm). Gent, Rubber Chem Technol 69, 1996. Only where I1 - 3 < Jm: beyond, the
/// energy is not a number. Mihai et al. 2015 report beta = 1 / Jm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gent {
    /// mu, Pa.
    pub shear_modulus_pa: f64,
    /// Jm, the bound of I1 - 3.
    pub jm: f64,
}

impl Gent {
    fn of_invariant<N: Number>(&self, i1: N) -> N {
        (i1 * (-1.0 / self.jm)).ln_1p() * (-0.5 * self.shear_modulus_pa * self.jm)
    }
}

impl StretchEnergy for Gent {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        self.of_invariant(first_uniaxial(stretch))
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        self.of_invariant(first(isochoric(stretches).0))
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.shear_modulus_pa
    }
}

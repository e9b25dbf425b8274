//! Incompressible neo-Hookean form.

use super::invariant::{first, first_uniaxial, isochoric};
use super::number::Number;
use super::stretch_energy::StretchEnergy;

/// Psi = mu/2 (I1 - 3). Rivlin, Phil Trans R Soc A 240, 1948. Defined for every stretch; stable for mu > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean {
    /// mu, Pa.
    pub shear_modulus_pa: f64,
}

impl StretchEnergy for NeoHookean {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        first_uniaxial(stretch) * (0.5 * self.shear_modulus_pa)
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        first(isochoric(stretches).0) * (0.5 * self.shear_modulus_pa)
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.shear_modulus_pa
    }
}

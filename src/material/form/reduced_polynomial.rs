//! Reduced polynomial (Yeoh without its quadratic term).

use super::invariant::{first, first_uniaxial, isochoric};
use super::number::Number;
use super::stretch_energy::StretchEnergy;

/// Psi = c10 (I1 - 3) + c30 (I1 - 3)^3. Yeoh, Rubber Chem Technol 63, 1990; fitted in vivo by Schiavone et al. 2009.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReducedPolynomial {
    /// c10, Pa.
    pub c10_pa: f64,
    /// c30, Pa.
    pub c30_pa: f64,
}

impl ReducedPolynomial {
    fn of_invariant<N: Number>(&self, i1: N) -> N {
        i1 * self.c10_pa + i1 * i1 * i1 * self.c30_pa
    }
}

impl StretchEnergy for ReducedPolynomial {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        self.of_invariant(first_uniaxial(stretch))
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        self.of_invariant(first(isochoric(stretches).0))
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        2.0 * self.c10_pa
    }
}

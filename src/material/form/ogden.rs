//! Ogden forms in the two conventions of the brain literature.

use super::invariant::{isochoric, ogden_uniaxial, power_sum};
use super::number::Number;
use super::stretch_energy::StretchEnergy;

/// Psi = sum_p mu_p / (2 a_p) (sum_i l_i^(2 a_p) - 3), the convention of Mihai et al. 2015 and 2017: a = 1 is
/// neo-Hookean mu/2 (I1 - 3), a = -1 is -mu/2 (I2 - 3). Large coefficients of opposite sign: trust it in its window only.
#[derive(Clone, Debug, PartialEq)]
pub struct OgdenMihai {
    /// mu_p (Pa) and a_p of each term.
    pub terms: Vec<(f64, f64)>,
}

impl StretchEnergy for OgdenMihai {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        self.terms
            .iter()
            .fold(N::constant(0.0), |sum, &(mu, a)| sum + ogden_uniaxial(stretch, 2.0 * a) * (mu / (2.0 * a)))
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        let (iso, _) = isochoric(stretches);
        self.terms.iter().fold(N::constant(0.0), |sum, &(mu, a)| sum + power_sum(iso, 2.0 * a) * (mu / (2.0 * a)))
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.terms.iter().map(|(mu, a)| mu * a).sum()
    }
}

/// Psi = 2 mu / a^2 (sum_i l_i^a - 3), the modified one-term form of Miller and Chinzei 2002 and Budday et al. 2017,
/// in which mu is the small-strain shear modulus. Defined for every stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OgdenModified {
    /// mu, Pa.
    pub shear_modulus_pa: f64,
    /// a.
    pub alpha: f64,
}

impl StretchEnergy for OgdenModified {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        ogden_uniaxial(stretch, self.alpha) * (2.0 * self.shear_modulus_pa / (self.alpha * self.alpha))
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        power_sum(isochoric(stretches).0, self.alpha) * (2.0 * self.shear_modulus_pa / (self.alpha * self.alpha))
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.shear_modulus_pa
    }
}

//! Exponential forms: Demiray's, and the Fung variant of Mihai et al.

use super::invariant::{first, first_uniaxial, isochoric};
use super::number::Number;
use super::stretch_energy::StretchEnergy;

/// Psi = mu / (2 b) (exp(b (I1 - 3)) - 1). Demiray, J Biomech 5, 1972; fitted to brain by Budday et al. 2017.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demiray {
    /// mu, Pa.
    pub shear_modulus_pa: f64,
    /// b.
    pub beta: f64,
}

impl Demiray {
    fn of_invariant<N: Number>(&self, i1: N) -> N {
        (i1 * self.beta).exp_m1() * (0.5 * self.shear_modulus_pa / self.beta)
    }
}

impl StretchEnergy for Demiray {
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

/// Psi = c / (2 a) (a (I1 - 3) + exp(a (I1 - 3)) - 1): the Fung law of Mihai et al. 2015 with its extra linear term,
/// so that the small-strain shear modulus is 2 c.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FungMihai {
    /// c, Pa.
    pub c_pa: f64,
    /// a.
    pub alpha: f64,
}

impl FungMihai {
    fn of_invariant<N: Number>(&self, i1: N) -> N {
        let scaled = i1 * self.alpha;
        (scaled + scaled.exp_m1()) * (0.5 * self.c_pa / self.alpha)
    }
}

impl StretchEnergy for FungMihai {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        self.of_invariant(first_uniaxial(stretch))
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        self.of_invariant(first(isochoric(stretches).0))
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        2.0 * self.c_pa
    }
}

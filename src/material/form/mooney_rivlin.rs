//! Two-term Mooney-Rivlin form.

use super::invariant::{first, first_uniaxial, isochoric, second, second_uniaxial};
use super::number::Number;
use super::stretch_energy::StretchEnergy;

/// Psi = c1 (I1 - 3) + c2 (I2 - 3). Mooney, J Appl Phys 11, 1940; Rivlin 1948. Defined for every stretch. Mihai et
/// al. 2015 report C/2 = c; Budday et al. 2017 report mu and c2 with c1 = mu/2 - c2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MooneyRivlin {
    /// c1, Pa.
    pub c1_pa: f64,
    /// c2, Pa.
    pub c2_pa: f64,
}

impl StretchEnergy for MooneyRivlin {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        first_uniaxial(stretch) * self.c1_pa + second_uniaxial(stretch) * self.c2_pa
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        let (iso, _) = isochoric(stretches);
        first(iso) * self.c1_pa + second(iso) * self.c2_pa
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        2.0 * (self.c1_pa + self.c2_pa)
    }
}

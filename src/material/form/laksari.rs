//! Three-term Mooney-Rivlin form of Laksari et al. 2012, and the curve the published program made of it.

use super::invariant::{first, first_uniaxial, isochoric, second, second_uniaxial};
use super::number::Number;
use super::stretch_energy::{StretchEnergy, of_volume};

/// Psi = c10 (I1 - 3) + c01 (I2 - 3) + c11 (I1 - 3)(I2 - 3) + K / a^2 (a ln J + J^-a - 1) with isochoric invariants
/// (Laksari, Shafieian and Darvish, J Biomech 45, 2012, with the volumetric term of Ogden). The volumetric term is
/// zero on the isochoric path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laksari {
    /// c10, Pa.
    pub c10_pa: f64,
    /// c01, Pa.
    pub c01_pa: f64,
    /// c11, Pa.
    pub c11_pa: f64,
    /// K, Pa.
    pub k_pa: f64,
    /// a, the exponent of the volumetric term.
    pub a: f64,
    /// Poisson's ratio; only the published program's volume change uses it.
    pub poisson_ratio: f64,
}

impl Laksari {
    fn of_invariants<N: Number>(&self, i1: N, i2: N) -> N {
        i1 * self.c10_pa + i2 * self.c01_pa + i1 * i2 * self.c11_pa
    }
}

impl StretchEnergy for Laksari {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        self.of_invariants(first_uniaxial(stretch), second_uniaxial(stretch))
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        let (iso, volume_ratio) = isochoric(stretches);
        let swelling = volume_ratio.ln() * self.a;
        let volumetric = (swelling + (-swelling).exp_m1()) * (self.k_pa / (self.a * self.a));
        self.of_invariants(first(iso), second(iso)) + volumetric
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        2.0 * (self.c10_pa + self.c01_pa)
    }

    /// In place of its own volume term, whose published K is that of no tissue.
    fn energy_with_lambda_pa<N: Number>(&self, stretches: [N; 3], lame_lambda_pa: f64) -> N {
        let (iso, _) = isochoric(stretches);
        let volumetric = of_volume(stretches, lame_lambda_pa, self.small_strain_shear_modulus_pa());
        self.of_invariants(first(iso), second(iso)) + volumetric
    }
}

/// The curve of the published program: J = l^(1 - 2 nu), A = J^(-2/3) (l^2 + 2/l), and for the second invariant
/// J^(-2/3) (l^4 + 2 l^-2), the sum of fourth powers. About ten times too stiff and with stress at rest; kept so
/// that the published figures can be reproduced. It exists on the uniaxial path only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaksariAsCoded(pub Laksari);

impl LaksariAsCoded {
    /// W(l) of the published program, Pa.
    pub fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        let Laksari { c10_pa, c01_pa, c11_pa, k_pa, a, poisson_ratio } = self.0;
        let volume_ratio = stretch.powf(1.0 - 2.0 * poisson_ratio);
        let scale = volume_ratio.powf(-2.0 / 3.0);
        let square = stretch * stretch;
        let one = N::constant(1.0);
        let first = scale * (square + one * 2.0 / stretch) - 3.0;
        let fourth = scale * (square * square + one * 2.0 / square) - 3.0;
        let swelling = volume_ratio.ln() * a;
        first * c10_pa
            + fourth * c01_pa
            + first * fourth * c11_pa
            + (swelling + (-swelling).exp_m1()) * (k_pa / (a * a))
    }
}

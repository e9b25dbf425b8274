//! Small-strain Hooke law on Biot strains.

use super::number::Number;
use super::stretch_energy::StretchEnergy;

/// Psi = mu sum e_i^2 + (La/2) (sum e_i)^2 with e_i = l_i - 1 (rotation removed), mu = E / (2 (1 + nu)),
/// La = E nu / ((1 + nu)(1 - 2 nu)). Form of the linear and elastography studies; on the isochoric path the trace is
/// of second order, so W is neo-Hookean to leading order. Defined for every stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    /// Young's modulus E, Pa.
    pub young_modulus_pa: f64,
    /// Poisson's ratio nu.
    pub poisson_ratio: f64,
}

impl Linear {
    fn lame_pa(&self) -> (f64, f64) {
        let (e, nu) = (self.young_modulus_pa, self.poisson_ratio);
        (e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))
    }
}

impl StretchEnergy for Linear {
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        let side = (stretch.ln() * -0.5).exp_m1() + 1.0;
        self.energy_pa([stretch, side, side])
    }

    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N {
        let (mu, lambda) = self.lame_pa();
        hooke(stretches, mu, lambda)
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.lame_pa().0
    }

    /// mu stays, lambda is the one given.
    fn energy_with_lambda_pa<N: Number>(&self, stretches: [N; 3], lame_lambda_pa: f64) -> N {
        hooke(stretches, self.lame_pa().0, lame_lambda_pa)
    }
}

fn hooke<N: Number>(stretches: [N; 3], mu: f64, lambda: f64) -> N {
    let [a, b, c] = stretches.map(|l| l - 1.0);
    let trace = a + b + c;
    (a * a + b * b + c * c) * mu + trace * trace * (0.5 * lambda)
}

//! Compressible Mooney-Rivlin law.

use super::curve::{Data, Search, Slope, Start, UniaxialCurve};
use super::definition::{
    Card, Estimated, Law, LawParameter, Range, Role, Shape, ShapeKnown, ShapeScale, Values, Volume,
};
use super::hyperelastic::{Hyperelastic, Tangent};
use super::stability::{Stability, StabilityRange};
use super::volume::{OfVolume, VolumeLogarithm, add_tangent_of_volume, cofactors, lame_lambda_pa, volume_change};
use crate::material::form::{first_uniaxial, second_uniaxial};
use nalgebra::Matrix3;

/// The law for files, fits and sensitivities.
pub struct Definition;

const fn modulus(name: &'static str, meaning: &'static str) -> LawParameter {
    LawParameter { name, meaning, role: Role::Modulus, range: Range::ANY, default: None }
}

impl Law for Definition {
    fn card(&self) -> &'static Card {
        &Card {
            name: "mooney-rivlin",
            formula: "C1 (I1 - 3) + C2 (I2 - 3) - 2 (C1 + 2 C2) ln J + lambda/2 ln^2 J",
            source: "Holzapfel, Nonlinear Solid Mechanics, 2000, eq. 6.147, with a logarithmic volume term",
            parameters: const { &[modulus("c1_pa", "C1, Pa"), modulus("c2_pa", "C2, Pa")] },
            of_terms: false,
            shear_modulus: "2 (`c1_pa` + `c2_pa`)",
            continued: true,
        }
    }

    fn shear_modulus_pa(&self, values: &[f64]) -> f64 {
        2.0 * (values[0] + values[1])
    }

    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic> {
        let Volume { lame_lambda_pa, inversion_threshold } = volume;
        Box::new(MooneyRivlin { c1_pa: values[0], c2_pa: values[1], lame_lambda_pa, inversion_threshold })
    }

    fn curves(&self) -> &'static [&'static dyn UniaxialCurve] {
        &[&Self]
    }

    fn measured(&self, _values: &[f64]) -> Option<([f64; 2], Stability)> {
        None
    }

    fn estimated(&self) -> Estimated {
        Estimated::Shaped(&SHAPE)
    }

    fn examples(&self) -> Vec<Values> {
        vec![vec![300.0, 200.0], vec![700.0, -100.0]]
    }
}

/// The share of C1 in the sum, which is half the modulus: mu = 2 (C1 + C2).
pub static SHAPE: Shape = Shape {
    law: &Definition,
    name: "share of c1_pa in c1_pa + c2_pa",
    scale: ShapeScale::Share,
    known: ShapeKnown::AnyShare,
    values: |shear_modulus_pa, log_odds| {
        let (sum, share) = (0.5 * shear_modulus_pa, ShapeScale::Share.value(log_odds));
        vec![share * sum, (1.0 - share) * sum]
    },
    number: |values| (values[0] / values[1]).ln(),
    slopes: |log_odds| {
        let share = ShapeScale::Share.value(log_odds);
        vec![("c1_pa", 1.0 - share), ("c2_pa", -share)]
    },
};

/// W = c1 (I1 - 3) + c2 (I2 - 3). With g = l^4 + 2 l rising: W'' = 2 l^-4 (c1 g(l) + 3 c2); W' = 2 (l - l^-2)(c1 + c2/l);
/// (l W')' = c1 (4 l + 2 l^-2) + c2 (2 + 4 l^-3). Both constants not negative: stable at every stretch.
impl UniaxialCurve for Definition {
    fn name(&self) -> &'static str {
        "mooney-rivlin"
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["c1_pa", "c2_pa"]
    }

    fn energy_pa(&self, parameters: &[f64], stretch: f64) -> f64 {
        parameters[0] * first_uniaxial(stretch) + parameters[1] * second_uniaxial(stretch)
    }

    fn energy_slope_pa(&self, _parameters: &[f64], stretch: f64) -> Slope {
        [first_uniaxial(stretch), second_uniaxial(stretch), 0.0]
    }

    fn stress_pa(&self, parameters: &[f64], l: f64) -> f64 {
        2.0 * (l - l.powi(-2)) * (parameters[0] + parameters[1] / l)
    }

    fn stress_slope_pa(&self, _parameters: &[f64], l: f64) -> Slope {
        let neo_hookean = l - l.powi(-2);
        [2.0 * neo_hookean, 2.0 * neo_hookean / l, 0.0]
    }

    fn starts(&self, search: Search, data: &Data) -> Vec<Start> {
        let none = [f64::INFINITY; 2];
        match search {
            Search::Published => vec![Start::new(&[1000.0, 1000.0], &[0.1, 0.1], &none)],
            Search::Exact => vec![Start::new(&[0.25 * data.modulus_pa; 2], &[0.0, 0.0], &none)],
        }
    }

    fn stability(&self, parameters: &[f64], window: [f64; 2]) -> Stability {
        let (c1, c2) = (parameters[0], parameters[1]);
        let everywhere = c1 >= 0.0 && c2 >= 0.0 && c1 + c2 > 0.0;
        let at_ends = |f: &dyn Fn(f64) -> bool| StabilityRange::of(everywhere, window.into_iter().all(f));
        let g = |l: f64| l.powi(4) + 2.0 * l;
        // c1 (4 l^4 + 2 l) + c2 (2 l^3 + 4) > 0: the ratio of the two polynomials is monotonic in l.
        let true_stress = |l: f64| c1 * (4.0 * l.powi(4) + 2.0 * l) + c2 * (2.0 * l.powi(3) + 4.0) > 0.0;
        Stability {
            energy_grows: at_ends(&|l| c1 * l + c2 >= 0.0),
            convex: at_ends(&|l| c1 * g(l) + 3.0 * c2 > 0.0),
            true_stress_rises: at_ends(&true_stress),
        }
    }

    fn values(&self, parameters: &[f64]) -> Vec<f64> {
        parameters.to_vec()
    }
}

/// Psi = C1 (I1 - 3) + C2 (I2 - 3) - 2 (C1 + 2 C2) ln J + lambda/2 ln^2 J, infinite for J <= 0 (Holzapfel,
/// "Nonlinear Solid Mechanics", 2000, eq. 6.147, with a logarithmic volume term). mu = 2 (C1 + C2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MooneyRivlin {
    /// C1, Pa.
    pub c1_pa: f64,
    /// C2, Pa.
    pub c2_pa: f64,
    /// lambda, Pa.
    pub lame_lambda_pa: f64,
    /// Volume ratio below which ln J is continued by its Taylor polynomial; 0: never.
    pub inversion_threshold: f64,
}

impl MooneyRivlin {
    /// From C1, C2 and Poisson's ratio.
    pub fn new(c1_pa: f64, c2_pa: f64, poisson_ratio: f64) -> Self {
        let lame_lambda_pa = lame_lambda_pa(2.0 * (c1_pa + c2_pa), poisson_ratio);
        Self { c1_pa, c2_pa, lame_lambda_pa, inversion_threshold: 0.0 }
    }

    fn of_volume(&self, h: &Matrix3<f64>) -> OfVolume {
        let logarithm = VolumeLogarithm { floor: self.inversion_threshold };
        logarithm.energy(2.0 * (self.c1_pa + 2.0 * self.c2_pa), self.lame_lambda_pa, volume_change(h))
    }
}

impl Hyperelastic for MooneyRivlin {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        // With E = C - I: I1 - 3 = tr E and I2 - 3 = 2 tr E + (tr^2 E - tr E^2) / 2.
        let e = h + h.transpose() + h.transpose() * h;
        let tr = e.trace();
        let i2_minus_3 = 2.0 * tr + 0.5 * (tr * tr - e.norm_squared());
        self.c1_pa * tr + self.c2_pa * i2_minus_3 + self.of_volume(h).value
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let f = Matrix3::identity() + h;
        let c = f.transpose() * f;
        f * (2.0 * (self.c1_pa + self.c2_pa * c.trace())) - f * c * (2.0 * self.c2_pa)
            + cofactors(&f) * self.of_volume(h).first
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let f = Matrix3::identity() + h;
        let (c, b) = (f.transpose() * f, f * f.transpose());
        let (c1, c2) = (2.0 * self.c1_pa, 2.0 * self.c2_pa);
        let mut tangent = Tangent::from_fn(|row, col| {
            let (i, j, k, l) = (row % 3, row / 3, col % 3, col / 3);
            let (ik, jl) = (f64::from(u8::from(i == k)), f64::from(u8::from(j == l)));
            let second =
                2.0 * f[row] * f[col] + c.trace() * ik * jl - ik * c[(l, j)] - f[(i, l)] * f[(k, j)] - b[(i, k)] * jl;
            c1 * ik * jl + c2 * second
        });
        add_tangent_of_volume(&mut tangent, self.of_volume(h), &f);
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        2.0 * (self.c1_pa + self.c2_pa)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::check_hyperelastic;

    #[test]
    fn mooney_rivlin_obeys_the_laws_of_hyperelasticity() {
        check_hyperelastic(&MooneyRivlin::new(300.0, 200.0, 0.45));
        check_hyperelastic(&MooneyRivlin::new(700.0, -100.0, 0.3));
        check_hyperelastic(&MooneyRivlin { inversion_threshold: 0.97, ..MooneyRivlin::new(300.0, 200.0, 0.45) });
    }
}

//! Gent's law: tissue that stretches no further than a limit.

use super::curve::{Data, Search, Slope, Start, UniaxialCurve};
use super::definition::{
    Card, Estimated, Law, LawParameter, Range, Role, Shape, ShapeKnown, ShapeScale, Values, Volume,
};
use super::hyperelastic::{Hyperelastic, Tangent};
use super::stability::{Stability, StabilityRange};
use super::volume::{OfVolume, VolumeLogarithm, add_tangent_of_volume, cofactors, volume_change};
use crate::material::form::first_uniaxial;
use nalgebra::Matrix3;

/// The law for files, fits and sensitivities.
pub struct Definition;

impl Law for Definition {
    fn card(&self) -> &'static Card {
        &Card {
            name: "gent",
            formula: "-mu Jm/2 ln(1 - (I1 - 3 - 2 ln J)/Jm) + lambda/2 ln^2 J",
            source: "Gent, Rubber Chem. Technol. 69, 1996; compressible as the neo-Hookean law, whose energy is what is limited",
            parameters: &[
                LawParameter {
                    name: "shear_modulus_pa",
                    meaning: "shear modulus mu at rest, Pa",
                    role: Role::Modulus,
                    range: Range::POSITIVE,
                    default: None,
                },
                LawParameter {
                    name: "jm",
                    meaning: "Jm, the limit of I1 - 3 (with a change of volume, of I1 - 3 - 2 ln J)",
                    role: Role::Shape,
                    range: Range::POSITIVE,
                    default: None,
                },
            ],
            of_terms: false,
            shear_modulus: "`shear_modulus_pa`",
            continued: true,
        }
    }

    fn shear_modulus_pa(&self, values: &[f64]) -> f64 {
        values[0]
    }

    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic> {
        let Volume { lame_lambda_pa, inversion_threshold } = volume;
        Box::new(Gent { shear_modulus_pa: values[0], jm: values[1], lame_lambda_pa, inversion_threshold })
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
        vec![vec![1000.0, 2.0], vec![333.28, 1.008267796]]
    }
}

/// The modulus is a parameter itself; the limit is positive and spans powers of ten, so its logarithm is the number.
pub static SHAPE: Shape = Shape {
    law: &Definition,
    name: "jm",
    scale: ShapeScale::Logarithm,
    known: ShapeKnown::Studies,
    values: |shear_modulus_pa, log_jm| vec![shear_modulus_pa, log_jm.exp()],
    number: |values| values[1].ln(),
    slopes: |_| vec![("jm", 1.0)],
};

/// How near the limit may come to the data's largest I1 - 3, as a factor on it.
const NEAREST_LIMIT: f64 = 1.0001;

/// A limit so far away is none.
const FARTHEST_LIMIT: f64 = 1e4;

/// W = -mu Jm/2 ln(1 - x/Jm) with x = I1 - 3, where x < Jm.
/// W' = mu (l - l^-2) / (1 - x/Jm), and both W'' and (l W')' are sums of positive terms for mu > 0: stable where there is
/// an energy, and there is none beyond.
impl UniaxialCurve for Definition {
    fn name(&self) -> &'static str {
        "gent"
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["mu_pa", "jm"]
    }

    fn energy_pa(&self, parameters: &[f64], stretch: f64) -> f64 {
        let (mu, jm) = (parameters[0], parameters[1]);
        -0.5 * mu * jm * (-first_uniaxial(stretch) / jm).ln_1p()
    }

    fn energy_slope_pa(&self, parameters: &[f64], stretch: f64) -> Slope {
        let (mu, jm) = (parameters[0], parameters[1]);
        let share = first_uniaxial(stretch) / jm;
        let logarithm = (-share).ln_1p();
        [-0.5 * jm * logarithm, -0.5 * mu * (logarithm + share / (1.0 - share)), 0.0]
    }

    fn stress_pa(&self, parameters: &[f64], l: f64) -> f64 {
        parameters[0] * (l - l.powi(-2)) / (1.0 - first_uniaxial(l) / parameters[1])
    }

    fn stress_slope_pa(&self, parameters: &[f64], l: f64) -> Slope {
        let (mu, jm) = (parameters[0], parameters[1]);
        let share = first_uniaxial(l) / jm;
        let neo_hookean = l - l.powi(-2);
        [neo_hookean / (1.0 - share), -mu * neo_hookean * share / (jm * (1.0 - share).powi(2)), 0.0]
    }

    /// From a limit close to the data and from one far off: the cost may have a valley at each. The published program had
    /// no such law, its searches are ours.
    fn starts(&self, _search: Search, data: &Data) -> Vec<Start> {
        let largest = data.stretches.iter().map(|l| first_uniaxial(*l)).fold(0.0, f64::max);
        let (low, high) = ([0.0, NEAREST_LIMIT * largest], [f64::INFINITY, FARTHEST_LIMIT]);
        let start =
            |factor: f64| Start::new(&[data.modulus_pa, (factor * largest).min(0.5 * FARTHEST_LIMIT)], &low, &high);
        vec![start(1.5), start(20.0)]
    }

    fn stability(&self, parameters: &[f64], window: [f64; 2]) -> Stability {
        let (mu, jm) = (parameters[0], parameters[1]);
        let inside = window.into_iter().all(|l| first_uniaxial(l) < jm);
        Stability::all(StabilityRange::of(false, mu > 0.0 && jm > 0.0 && inside))
    }

    fn values(&self, parameters: &[f64]) -> Vec<f64> {
        parameters.to_vec()
    }
}

/// Psi of [`Definition`], infinite for J <= 0 and for I1 - 3 - 2 ln J >= Jm. That number is twice the neo-Hookean energy over mu:
/// never negative, and of second order at rest, so that mu and lambda are those of small strains whatever Jm is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gent {
    /// mu, Pa.
    pub shear_modulus_pa: f64,
    /// Jm.
    pub jm: f64,
    /// lambda, Pa.
    pub lame_lambda_pa: f64,
    /// Volume ratio below which ln J is continued by its Taylor polynomial; 0: never.
    pub inversion_threshold: f64,
}

impl Gent {
    fn logarithm(&self, h: &Matrix3<f64>) -> OfVolume {
        VolumeLogarithm { floor: self.inversion_threshold }.of(volume_change(h))
    }

    /// -shear ln J + lambda/2 ln^2 J.
    fn of_volume(&self, h: &Matrix3<f64>, shear: f64) -> OfVolume {
        VolumeLogarithm { floor: self.inversion_threshold }.energy(shear, self.lame_lambda_pa, volume_change(h))
    }

    /// (I1 - 3 - 2 ln J) / Jm with I1 - 3 = 2 tr H + |H|^2.
    fn share(&self, h: &Matrix3<f64>) -> f64 {
        (2.0 * h.trace() + h.norm_squared() - 2.0 * self.logarithm(h).value) / self.jm
    }
}

impl Hyperelastic for Gent {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        let share = self.share(h);
        if share >= 1.0 {
            return f64::INFINITY;
        }
        -0.5 * self.shear_modulus_pa * self.jm * (-share).ln_1p() + self.of_volume(h, 0.0).value
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let f = Matrix3::identity() + h;
        let scale = self.shear_modulus_pa / (1.0 - self.share(h));
        f * scale + cofactors(&f) * self.of_volume(h, scale).first
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let f = Matrix3::identity() + h;
        let scale = self.shear_modulus_pa / (1.0 - self.share(h));
        let outer = 2.0 * scale / (self.jm * (1.0 - self.share(h)));
        let grown = f - cofactors(&f) * self.logarithm(h).first;
        let mut tangent =
            Tangent::from_fn(|row, col| outer * grown[row] * grown[col] + if row == col { scale } else { 0.0 });
        add_tangent_of_volume(&mut tangent, self.of_volume(h, scale), &f);
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.shear_modulus_pa
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::{Material, NeoHookean};

    #[test]
    fn a_limit_far_away_is_none() {
        let law = Material::new(&Definition, vec![1000.0, 1e9], 0.45).law();
        let neo = NeoHookean::new(1000.0, 0.45);
        let h = Matrix3::new(0.12, -0.05, 0.08, 0.03, -0.09, 0.06, -0.07, 0.1, 0.05);
        assert!((law.energy_density_pa(&h) - neo.energy_density_pa(&h)).abs() < 1e-6);
        assert!((law.first_piola_kirchhoff_pa(&h) - neo.first_piola_kirchhoff_pa(&h)).abs().max() < 1e-5);
    }

    #[test]
    fn beyond_the_limit_there_is_no_energy() {
        let law = Material::new(&Definition, vec![1000.0, 0.06], 0.45).law();
        let stretched =
            |l: f64| Matrix3::from_diagonal(&nalgebra::Vector3::new(l - 1.0, l.powf(-0.5) - 1.0, l.powf(-0.5) - 1.0));
        assert!(law.energy_density_pa(&stretched(1.14)).is_finite());
        assert_eq!(law.energy_density_pa(&stretched(1.2)), f64::INFINITY);
    }
}

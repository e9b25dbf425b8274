//! Which unknown contributes how much: first-order shares of the variance.
//!
//! The share of X is Var(E[u | X]) / Var(u) (Sobol, Mathematics and Computers in Simulation 55, 2001), variances summed over
//! components and nodes. What is missing to one is what unknowns do only together.

use super::response::Response;
use super::uncertain::{Cause, Uncertainty};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// First-order shares of the variance, each between 0 and 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shares {
    /// Of the tissues' stiffness.
    pub stiffness: f64,
    /// Of the load: effective density, or the part of the fluid that has drained.
    pub load: f64,
    /// Of the direction of gravity.
    pub direction: f64,
    /// Of the room under the skull.
    pub room: f64,
    /// Of Poisson's ratio, where it was drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poisson: Option<f64>,
    /// Of how the brain is supported.
    pub supports: f64,
    /// Of what unknowns do together.
    pub together: f64,
}

/// Pairs of draws behind every share.
const PAIRS: usize = 2048;

/// One way of supporting the body: its weight, its answer and its unknowns.
pub type Supported<'a> = (f64, &'a Response, &'a Uncertainty);

/// Displacements of one draw: their mean over the supports, and the mean of their squares.
struct Drawn {
    mixed: Vec<f64>,
    square: f64,
}

/// The shares over the nodes of the responses, from pairs of draws that have one cause in common (Saltelli et al., Computer
/// Physics Communications 181, 2010; both draws count for mean and variance). All must have the same nodes; unknowns of one
/// cause are drawn alike.
pub fn variance_shares(models: &[Supported<'_>]) -> Shares {
    let weights: f64 = models.iter().map(|m| m.0).sum::<f64>().max(f64::MIN_POSITIVE);
    let dimensions = models.iter().map(|(_, _, u)| u.list.len()).max().unwrap_or(0);
    let drawn = |point: &(dyn Fn(&Uncertainty) -> Vec<f64> + Sync)| -> Drawn {
        let mut drawn = Drawn { mixed: Vec::new(), square: 0.0 };
        for (weight, response, uncertainty) in models {
            let u = response.at(&point(uncertainty));
            drawn.mixed.resize(3 * u.len(), 0.0);
            drawn.mixed.iter_mut().zip(u.iter().flatten()).for_each(|(sum, u)| *sum += weight / weights * u);
            drawn.square += weight / weights * u.iter().flatten().map(|u| u * u).sum::<f64>();
        }
        drawn
    };
    let first = |n: usize| drawn(&|uncertainty| uncertainty.draw(n));
    let firsts: Vec<Drawn> = (0..PAIRS).into_par_iter().map(first).collect();
    let share = |cause: Cause| -> f64 {
        if models.iter().all(|(_, _, u)| u.of(cause).is_empty()) {
            return 0.0;
        }
        let second = |n: usize| drawn(&|uncertainty| in_common(uncertainty, cause, n, dimensions));
        let seconds: Vec<Drawn> = (0..PAIRS).into_par_iter().map(second).collect();
        let mut mean = vec![0.0; firsts[0].mixed.len()];
        let (mut square, mut product) = (0.0, 0.0);
        for (a, b) in firsts.iter().zip(&seconds) {
            square += 0.5 * (a.square + b.square);
            for ((mean, a), b) in mean.iter_mut().zip(&a.mixed).zip(&b.mixed) {
                *mean += 0.5 * (a + b);
                product += a * b;
            }
        }
        let count = PAIRS as f64;
        let of_mean = mean.iter().map(|m| (m / count).powi(2)).sum::<f64>();
        let variance = (square / count - of_mean).max(f64::MIN_POSITIVE);
        ((product / count - of_mean) / variance).clamp(0.0, 1.0)
    };
    let [stiffness, load, direction, room, poisson] = Cause::ALL.map(share);
    let supports = share_of_supports(models, weights, &firsts);
    // Found from draws, they may be a hair more than all there is.
    let sum = (stiffness + load + direction + room + supports + poisson).max(1.0);
    let [stiffness, load, direction, room, supports, poisson] =
        [stiffness, load, direction, room, supports, poisson].map(|share| share / sum);
    let together = (1.0 - stiffness - load - direction - room - supports - poisson).max(0.0);
    let drawn = models.iter().any(|(_, _, u)| !u.of(Cause::Poisson).is_empty());
    Shares { stiffness, load, direction, room, poisson: drawn.then_some(poisson), supports, together }
}

/// The variance between the means of the supports.
fn share_of_supports(models: &[Supported<'_>], weights: f64, firsts: &[Drawn]) -> f64 {
    let count = firsts.len() as f64;
    let mean_of = |all: &mut dyn Iterator<Item = Vec<f64>>| -> Vec<f64> {
        let mut mean: Vec<f64> = Vec::new();
        for values in all {
            mean.resize(values.len(), 0.0);
            mean.iter_mut().zip(values).for_each(|(mean, v)| *mean += v / count);
        }
        mean
    };
    let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    let of_mean = square(&mean_of(&mut firsts.iter().map(|drawn| drawn.mixed.clone())));
    let between: f64 = models
        .iter()
        .map(|(weight, response, uncertainty)| {
            let draws: Vec<Vec<f64>> = (0..firsts.len())
                .into_par_iter()
                .map(|n| response.at(&uncertainty.draw(n)).into_iter().flatten().collect())
                .collect();
            weight / weights * square(&mean_of(&mut draws.into_iter()))
        })
        .sum();
    let variance = (firsts.iter().map(|drawn| drawn.square).sum::<f64>() / count - of_mean).max(f64::MIN_POSITIVE);
    ((between - of_mean) / variance).clamp(0.0, 1.0)
}

/// A draw that has the unknowns of one cause in common with draw `n`, all others apart from it.
fn in_common(uncertainty: &Uncertainty, cause: Cause, n: usize, dimensions: usize) -> Vec<f64> {
    let mut z = uncertainty.normals(n, dimensions);
    let same = uncertainty.normals(n, 0);
    for place in uncertainty.of(cause) {
        z[place] = same[place];
    }
    uncertainty.point(&z)
}

#[cfg(test)]
mod tests {
    use super::super::response::tests::{linear_body, response};
    use super::super::uncertain::tests::of_two_tissues;
    use super::super::uncertain::{Reading, Uncertain};
    use super::*;
    use crate::experiment::estimate::{Scale, Unknown};
    use crate::experiment::sample::Tissue;

    /// One modulus, one density: u is lognormal, and of lognormal variables all is known.
    fn one_and_one(of_modulus: f64, of_density: f64) -> Uncertainty {
        let unknown = |unknown: Unknown, mean: f64, sd: f64, cause| {
            let prior = unknown.prior(mean, sd);
            Uncertain { unknown, prior, cause, reading: Reading::Itself }
        };
        Uncertainty::new(vec![
            unknown(Unknown::ShearModulus(Tissue::whole_brain().remove(0)), 6.0, of_modulus, Cause::Stiffness),
            unknown(Unknown::Density, 4.0, of_density, Cause::Load),
        ])
    }

    #[test]
    fn shares_of_one_modulus_and_one_density_are_the_formulas_within_two_points() {
        for (a, b) in [(0.35, 0.56), (0.5, 0.2), (0.3, 0.3)] {
            let uncertainty = one_and_one(a, b);
            let body = |p: &[f64]| vec![[0.0, (p[1] - p[0]).exp(), 0.0], [0.3 * (p[1] - p[0]).exp(), 0.0, 0.0]];
            let surface = response(&body, &uncertainty);
            let found = variance_shares(&[(1.0, &surface, &uncertainty)]);
            let of = |s: f64| (s * s).exp_m1();
            let whole = of(a.hypot(b));
            let expected = [of(a) / whole, of(b) / whole];
            assert!((found.stiffness - expected[0]).abs() < 0.02, "{found:?} {expected:?}");
            assert!((found.load - expected[1]).abs() < 0.02, "{found:?} {expected:?}");
            assert!((found.together - (1.0 - expected[0] - expected[1])).abs() < 0.02);
            assert_eq!((found.direction, found.room, found.supports), (0.0, 0.0, 0.0));
        }
    }

    /// Mean and mean square of a function of a standard normal variable.
    fn moments(f: &dyn Fn(f64) -> f64) -> [f64; 2] {
        let at = |n: i32| -8.0 + 0.01 * f64::from(n);
        let density = |z: f64| (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
        [1, 2].map(|power| (0..=1600).map(|n| 0.01 * density(at(n)) * f(at(n)).powi(power)).sum())
    }

    #[test]
    fn poissons_share_of_a_confined_column_is_the_formula_within_two_points() {
        // Pressed between walls a column gives way by its load over E (1 - nu) / ((1 + nu) (1 - 2 nu)) = mu (lambda / mu + 2).
        let compliance = |ratio: f64| {
            let nu = Scale::LameRatio.value(ratio);
            let young = 2.0 * (1.0 + nu);
            (1.0 + nu) * (1.0 - 2.0 * nu) / (young * (1.0 - nu))
        };
        for (of_modulus, of_density, of_ratio) in [(0.35, 0.56, 0.7), (0.5, 0.2, 0.4), (0.2, 0.1, 0.7)] {
            let middle = Scale::LameRatio.number(0.45);
            let prior = Unknown::PoissonRatio.prior(middle, of_ratio);
            let (unknown, reading) = (Unknown::PoissonRatio, Reading::Itself);
            let ratio = Uncertain { unknown, prior, cause: Cause::Poisson, reading };
            let list = one_and_one(of_modulus, of_density).list.into_iter().chain([ratio]).collect();
            let uncertainty = Uncertainty::new(list);
            let body = |p: &[f64]| vec![[0.0, 40.0 * (p[1] - p[0]).exp() * compliance(p[2]), 0.0]];
            let surface = response(&body, &uncertainty);
            let found = variance_shares(&[(1.0, &surface, &uncertainty)]);
            let lognormal = |sd: f64| [(0.5 * sd * sd).exp(), (2.0 * sd * sd).exp()];
            let factors =
                [lognormal(of_modulus), lognormal(of_density), moments(&|z| compliance(middle + z * of_ratio))];
            let all = |n: usize| factors.iter().map(|m| m[n]).product::<f64>();
            let whole = all(1) - all(0).powi(2);
            // The others at their means, squared.
            let expected = factors.map(|[mean, square]| (square / (mean * mean) - 1.0) * all(0).powi(2) / whole);
            let shares = [found.stiffness, found.load, found.poisson.unwrap()];
            assert!(shares.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.02), "{found:?} {expected:?}");
            assert!((found.together - (1.0 - expected.iter().sum::<f64>())).abs() < 0.02, "{found:?} {expected:?}");
        }
        let none = one_and_one(0.3, 0.3);
        let body = |p: &[f64]| vec![[0.0, (p[1] - p[0]).exp(), 0.0]];
        let surface = response(&body, &none);
        assert_eq!(variance_shares(&[(1.0, &surface, &none)]).poisson, None, "what is not drawn has no share");
    }

    #[test]
    fn supports_that_move_the_body_differently_have_the_share_of_their_means() {
        let uncertainty = one_and_one(0.1, 0.1);
        let of = |size: f64| move |p: &[f64]| vec![[size * (p[1] - p[0] + 2.0).exp(), 0.0, 0.0]];
        let (small, large) = (response(&of(1.0), &uncertainty), response(&of(3.0), &uncertainty));
        let found = variance_shares(&[(0.5, &small, &uncertainty), (0.5, &large, &uncertainty)]);
        // u = m e with m 1 or 3 and e lognormal: Var = E m^2 E e^2 - (E m E e)^2.
        let e2 = 0.02f64.exp();
        let expected = 1.0 / (5.0 * e2 - 4.0);
        assert!((found.supports - expected).abs() < 0.01, "{found:?} {expected}");
    }

    #[test]
    fn all_shares_and_what_is_left_make_one() {
        let uncertainty = of_two_tissues(1.0);
        let surface = response(&linear_body, &uncertainty);
        let found = variance_shares(&[(1.0, &surface, &uncertainty)]);
        let sum = found.stiffness + found.load + found.direction + found.room + found.supports + found.together;
        assert!((sum - 1.0).abs() < 1e-9 && found.load > 0.3 && found.direction > 0.005, "{found:?}");
    }
}

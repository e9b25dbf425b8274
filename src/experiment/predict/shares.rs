//! Which unknown contributes how much: first-order shares of the variance.
//!
//! The share of X is Var(E[u | X]) / Var(u) (Sobol, Mathematics and Computers in Simulation 55, 2001), variances summed over
//! components and nodes. What is missing to one is what unknowns do only together.

use super::low_discrepancy::normals;
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
    /// Of how the brain is supported.
    pub supports: f64,
    /// Of what unknowns do together.
    pub together: f64,
}

/// Values of the unknown whose share is found.
const OUTER: usize = 256;
/// Draws of all others for each of them.
const INNER: usize = 64;
/// Draws behind the whole variance.
const WHOLE: usize = 2048;

/// One way of supporting the body: its weight, its answer and its unknowns.
pub type Supported<'a> = (f64, &'a Response, &'a Uncertainty);

/// The shares over the nodes of the responses. All must have the same nodes; unknowns of one cause are drawn alike.
pub fn variance_shares(models: &[Supported<'_>]) -> Shares {
    let weights: f64 = models.iter().map(|m| m.0).sum::<f64>().max(f64::MIN_POSITIVE);
    let mixed = |at: &dyn Fn(&Uncertainty) -> Vec<f64>| -> Vec<f64> {
        let mut sum: Vec<f64> = Vec::new();
        for (weight, response, uncertainty) in models {
            let u = response.at(&at(uncertainty));
            sum.resize(3 * u.len(), 0.0);
            sum.iter_mut().zip(u.iter().flatten()).for_each(|(sum, u)| *sum += weight / weights * u);
        }
        sum
    };
    // Supports are known in turn: their share is the variance of their means, the rest of the whole that within each.
    let (mut of_supports, mut whole) = (Moments::default(), Moments::default());
    for (weight, response, uncertainty) in models {
        let draws: Vec<Vec<f64>> = (0..WHOLE)
            .into_par_iter()
            .map(|n| response.at(&uncertainty.draw(n)).into_iter().flatten().collect())
            .collect();
        let mut mean = Moments::default();
        for u in &draws {
            mean.add(1.0, u);
            whole.add(weight / weights, u);
        }
        of_supports.add(weight / weights, &mean.mean());
    }
    let variance = whole.variance().max(f64::MIN_POSITIVE);
    let share = |cause: Cause| -> f64 {
        if models.iter().all(|(_, _, u)| u.of(cause).is_empty()) {
            return 0.0;
        }
        let means: Vec<Vec<f64>> = (0..OUTER)
            .into_par_iter()
            .map(|outer| {
                let mut mean = Moments::default();
                for inner in 0..INNER {
                    mean.add(1.0, &mixed(&|uncertainty| known(uncertainty, cause, outer, inner)));
                }
                mean.mean()
            })
            .collect();
        let mut outer = Moments::default();
        means.iter().for_each(|mean| outer.add(1.0, mean));
        (outer.variance() / variance).clamp(0.0, 1.0)
    };
    let [stiffness, load, direction, room] = Cause::ALL.map(share);
    let supports = (of_supports.variance() / variance).clamp(0.0, 1.0);
    let together = (1.0 - stiffness - load - direction - room - supports).clamp(0.0, 1.0);
    Shares { stiffness, load, direction, room, supports, together }
}

/// A point whose unknowns of one cause are those of draw `outer`, all others those of draw `inner`.
fn known(uncertainty: &Uncertainty, cause: Cause, outer: usize, inner: usize) -> Vec<f64> {
    let mut z = normals(inner, 0, uncertainty.list.len());
    let own = uncertainty.of(cause);
    for (place, value) in own.iter().zip(normals(outer, 0, own.len())) {
        z[*place] = value;
    }
    uncertainty.point(&z)
}

/// Weighed sums of a vector and of its square.
#[derive(Default)]
struct Moments {
    weight: f64,
    sum: Vec<f64>,
    squares: f64,
}

impl Moments {
    fn add(&mut self, weight: f64, values: &[f64]) {
        self.sum.resize(values.len(), 0.0);
        self.weight += weight;
        self.sum.iter_mut().zip(values).for_each(|(sum, v)| *sum += weight * v);
        self.squares += weight * values.iter().map(|v| v * v).sum::<f64>();
    }

    fn mean(&self) -> Vec<f64> {
        self.sum.iter().map(|s| s / self.weight).collect()
    }

    fn variance(&self) -> f64 {
        (self.squares / self.weight - self.mean().iter().map(|m| m * m).sum::<f64>()).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::response::tests::{linear_body, response};
    use super::super::uncertain::Uncertain;
    use super::super::uncertain::tests::of_two_tissues;
    use super::*;
    use crate::experiment::estimate::Unknown;
    use crate::experiment::sample::Tissue;

    /// One modulus, one density: u is lognormal, and of lognormal variables all is known.
    fn one_and_one(of_modulus: f64, of_density: f64) -> Uncertainty {
        let unknown = |unknown: Unknown, mean: f64, sd: f64, cause| {
            let prior = unknown.prior(mean, sd);
            Uncertain { unknown, prior, cause, levels_mm: Vec::new() }
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

//! What is not known before an operation, with what is known of it.

use super::low_discrepancy::normals_of;
use crate::experiment::estimate::{LogPrior, Unknown, joint_precision};
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What an unknown belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cause {
    /// How stiff the tissue is.
    Stiffness,
    /// How much of its weight the fluid no longer carries.
    Load,
    /// How exactly the head lies.
    Direction,
    /// How far the skull stands off.
    Room,
    /// How little the tissue yields to a change of volume: Poisson's ratio.
    Poisson,
}

impl Cause {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Stiffness, Self::Load, Self::Direction, Self::Room, Self::Poisson];
}

/// What a prior's variable is of the solver's number.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Reading {
    /// The number itself.
    #[default]
    Itself,
    /// ln(part of the fluid that has drained) of a level, by the levels (mm) when 0, 1/n, 2/n ... 1 of it has.
    Drained(Vec<f64>),
    /// How far a level is below this one, mm.
    Below(f64),
}

/// One unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertain {
    /// What it is to the solver.
    pub unknown: Unknown,
    /// What is known of it.
    pub prior: LogPrior,
    /// What it belongs to.
    pub cause: Cause,
    /// What the prior is of.
    pub reading: Reading,
}

impl Uncertain {
    fn sd(&self) -> f64 {
        self.prior.sd.unwrap_or(0.0)
    }

    /// The solver's number where the prior's variable has this value.
    fn number(&self, value: f64) -> f64 {
        let levels_mm = match &self.reading {
            Reading::Itself => return value,
            // Fluid above carries no more.
            Reading::Below(top_mm) => return top_mm - value.max(0.0),
            Reading::Drained(levels_mm) => levels_mm,
        };
        let Some(last) = levels_mm.len().checked_sub(1) else { return value };
        let place = value.exp().clamp(0.0, 1.0) * last as f64;
        let low = (place as usize).min(last.saturating_sub(1));
        let high = (low + 1).min(last);
        levels_mm[low] + (place - low as f64) * (levels_mm[high] - levels_mm[low])
    }
}

/// Everything that is not known, with its joint prior.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    /// The unknowns; those of one cause are independent of the others.
    pub list: Vec<Uncertain>,
    /// L of the covariance L L^T of the prior's variables.
    factor: DMatrix<f64>,
    /// Of the points that draws are made from.
    seed: u64,
}

impl Uncertainty {
    /// The joint prior; an unknown of no spread counts as known.
    pub fn new(list: Vec<Uncertain>) -> Self {
        let list: Vec<Uncertain> = list.into_iter().filter(|u| u.sd() > 0.0).collect();
        let priors: Vec<LogPrior> = list.iter().map(|u| u.prior.clone()).collect();
        let apart = || DMatrix::from_diagonal(&DVector::from_iterator(list.len(), list.iter().map(Uncertain::sd)));
        let joint = joint_precision(&priors).try_inverse().and_then(DMatrix::cholesky);
        let factor = joint.map_or_else(apart, |cholesky| cholesky.l());
        Self { list, factor, seed: 0 }
    }

    /// The same with draws from the points of this seed.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// The same without what belongs to one cause: a body held at its base has no room.
    #[must_use]
    pub fn without(&self, cause: Cause) -> Self {
        Self::new(self.list.iter().filter(|u| u.cause != cause).cloned().collect()).with_seed(self.seed)
    }

    /// The unknowns as the solver takes them.
    pub fn unknowns(&self) -> Vec<Unknown> {
        self.list.iter().map(|u| u.unknown.clone()).collect()
    }

    /// The solver's numbers where standard normal variables have these values, one for each unknown.
    pub fn point(&self, normals: &[f64]) -> Vec<f64> {
        let away = &self.factor * DVector::from_column_slice(&normals[..self.list.len()]);
        self.list.iter().zip(away.iter()).map(|(u, d)| u.number(u.prior.mean + d)).collect()
    }

    /// The numbers of one draw.
    pub fn draw(&self, index: usize) -> Vec<f64> {
        self.point(&self.normals(index, 0))
    }

    /// The standard normal variables of one draw, one for each unknown, in the dimensions from `first` on.
    pub(super) fn normals(&self, index: usize, first: usize) -> Vec<f64> {
        normals_of(self.seed, index, first, self.list.len())
    }

    /// The numbers in the middle of the prior.
    pub fn centre(&self) -> Vec<f64> {
        self.point(&vec![0.0; self.list.len()])
    }

    /// Standard deviation of every number.
    pub fn sds(&self) -> Vec<f64> {
        let half = |u: &Uncertain| 0.5 * (u.number(u.prior.mean + u.sd()) - u.number(u.prior.mean - u.sd())).abs();
        self.list.iter().map(half).collect()
    }

    /// Variance of a sum of the prior's variables with these weights, one for each unknown.
    pub fn variance(&self, weights: &[f64]) -> f64 {
        (self.factor.transpose() * DVector::from_column_slice(weights)).norm_squared()
    }

    /// The places of the unknowns of a cause.
    pub fn of(&self, cause: Cause) -> Vec<usize> {
        (0..self.list.len()).filter(|&n| self.list[n].cause == cause).collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::experiment::estimate::Turn;
    use crate::experiment::sample::Tissue;

    fn unknown(unknown: Unknown, mean: f64, sd: f64, cause: Cause) -> Uncertain {
        let prior = unknown.prior(mean, sd);
        Uncertain { unknown, prior, cause, reading: Reading::Itself }
    }

    /// Two tissues, a density and two turns.
    pub fn of_two_tissues(sd: f64) -> Uncertainty {
        let tissues = Tissue::grey_and_white();
        let modulus =
            |n: usize, pa: f64| unknown(Unknown::ShearModulus(tissues[n].clone()), pa.ln(), 0.4 * sd, Cause::Stiffness);
        Uncertainty::new(vec![
            modulus(0, 1200.0),
            modulus(1, 700.0),
            unknown(Unknown::Density, 100f64.ln(), 0.5 * sd, Cause::Load),
            unknown(Unknown::GravityTurn(Turn::Nodding), 0.0, 0.17 * sd, Cause::Direction),
            unknown(Unknown::GravityTurn(Turn::Rolling), 0.0, 0.17 * sd, Cause::Direction),
        ])
    }

    #[test]
    fn draws_have_the_priors_covariance() {
        let mut list = of_two_tissues(1.0).list;
        list[1].prior.correlation = vec![0.6];
        let all = Uncertainty::new(list);
        let draws: Vec<Vec<f64>> = (0..512).map(|n| all.draw(n)).collect();
        let mean = |a: usize| draws.iter().map(|d| d[a]).sum::<f64>() / 512.0;
        let covariance =
            |a: usize, b: usize| draws.iter().map(|d| (d[a] - mean(a)) * (d[b] - mean(b))).sum::<f64>() / 512.0;
        assert!((covariance(0, 1) / 0.16 - 0.6).abs() < 0.05 && (covariance(0, 0) / 0.16 - 1.0).abs() < 0.05);
        assert!((all.variance(&[1.0, 1.0, 0.0, 0.0, 0.0]) - 2.0 * 0.16 * 1.6).abs() < 1e-12);
        assert!(covariance(0, 2).abs() < 0.01 && (mean(1) - 700f64.ln()).abs() < 0.01);
    }

    #[test]
    fn the_level_falls_with_what_has_drained() {
        let level = Uncertain {
            reading: Reading::Drained(vec![60.0, 40.0, 0.0]),
            ..unknown(Unknown::CsfLevel, 0.25f64.ln(), 0.4, Cause::Load)
        };
        let all = Uncertainty::new(vec![level]);
        assert!((all.centre()[0] - 50.0).abs() < 1e-9);
        assert!(all.point(&[1.0])[0] < 50.0 && all.point(&[9.0])[0] == 0.0 && all.sds()[0] > 1.0);
        let known = Uncertain { reading: Reading::Below(60.0), ..unknown(Unknown::CsfLevel, 20.0, 3.0, Cause::Load) };
        let all = Uncertainty::new(vec![known]);
        assert_eq!((all.centre()[0], all.point(&[1.0])[0], all.sds()[0]), (40.0, 37.0, 3.0));
    }
}

//! A population from what the scans of its members say: Gaussian throughout given the spreads, which are integrated over on a
//! grid (Gelman et al., Bayesian Data Analysis, section 5.4, with readings of unequal and correlated noise).

use super::grid::Grid;
use super::mixture::{Part, mean_and_sd, quantile};
use super::moments::Moments;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use thiserror::Error;

/// Scale of the spreads' half-normal prior, of ln(parameter): people differ by a factor of e^0.5 = 1.6, or of 2.7 at two
/// scales. Wide beside what elastography reports between healthy people (10 to 20 %), so that the cohort decides.
pub const SPREAD_SCALE: f64 = 0.5;
/// Standard deviation of the means' prior: a factor of 7 about a thousand Pa (a hundred kg/m3), which is next to nothing.
pub const MEAN_SD: f64 = 2.0;
/// More parameters than this would take too many cells.
pub const MOST_PARAMETERS: usize = 4;
/// How often the grid closes in.
const CLOSER: usize = 3;

/// More parameters than can be inferred together.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{} parameters ({}) are more than the {MOST_PARAMETERS} that are inferred together", .0.len(), .0.join(", "))]
pub struct TooMany(pub Vec<String>);

/// A mean and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Inferred {
    /// The posterior's mean.
    pub mean: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Its 95 % interval.
    pub interval_95: [f64; 2],
}

/// One patient's parameter, with what the others say of it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Shrunken {
    /// The parameter: `shear_modulus_pa of grey_matter`.
    pub name: String,
    /// The most probable value, in the unit of the name.
    pub value: f64,
    /// Standard deviation of its logarithm.
    pub log_sd: f64,
    /// Its 95 % interval.
    pub interval_95: [f64; 2],
}

/// One set of spreads that was tried.
#[derive(Clone, Debug)]
struct Tried {
    spreads: Vec<f64>,
    log_density: f64,
    /// Of the population's mean, given these spreads.
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// What a cohort says of people.
#[derive(Clone, Debug)]
pub struct Population {
    names: Vec<String>,
    grid: Grid,
    weights: Vec<f64>,
    tried: Vec<Tried>,
}

impl Population {
    /// Infers the population that these patients come from.
    ///
    /// # Errors
    /// [`TooMany`].
    pub fn infer(names: &[String], patients: &[Moments]) -> Result<Self, TooMany> {
        if names.len() > MOST_PARAMETERS || names.is_empty() {
            return Err(TooMany(names.to_vec()));
        }
        let parts: Vec<(DMatrix<f64>, DVector<f64>)> = patients.iter().map(Moments::parts).collect();
        let first = DVector::from_iterator(names.len(), names.iter().map(|name| usual(name).ln()));
        let on = |grid: Grid| {
            let tried: Vec<Tried> =
                (0..grid.len()).into_par_iter().map(|n| tried(&parts, &first, grid.at(n))).collect();
            let best = tried.iter().map(|t| t.log_density).fold(f64::MIN, f64::max);
            let raw: Vec<f64> = tried.iter().map(|t| (t.log_density - best).exp()).collect();
            let sum: f64 = raw.iter().sum();
            let weights = raw.into_iter().map(|w| w / sum).collect();
            Self { names: names.to_vec(), grid, weights, tried }
        };
        let mut found = on(Grid::whole(names.len(), SPREAD_SCALE));
        for _ in 0..CLOSER {
            let spreads: Vec<(f64, f64)> = (0..names.len()).map(|n| found.spread(n)).map(|s| (s.mean, s.sd)).collect();
            found = on(found.grid.around(&spreads));
        }
        Ok(found)
    }

    /// The mean of ln(parameter) over people.
    pub fn mean(&self, parameter: usize) -> Inferred {
        self.inferred(|t| (t.mean[parameter], t.covariance[(parameter, parameter)]))
    }

    /// The standard deviation of ln(parameter) between people.
    pub fn spread(&self, parameter: usize) -> Inferred {
        let of = |f: &dyn Fn(f64) -> f64| -> f64 {
            self.weights.iter().zip(&self.tried).map(|(w, t)| w * f(t.spreads[parameter])).sum()
        };
        let mean = of(&|s| s);
        let sd = of(&|s| (s - mean).powi(2)).sqrt();
        let at = |share| self.grid.quantile(&self.weights, parameter, share);
        Inferred { mean, sd, interval_95: [at(0.025), at(0.975)] }
    }

    /// ln(parameter) of the next patient, before anything is seen of them.
    pub fn next(&self, parameter: usize) -> Inferred {
        self.inferred(|t| (t.mean[parameter], t.covariance[(parameter, parameter)] + t.spreads[parameter].powi(2)))
    }

    /// One of the patients, with what the others say of people.
    pub fn shrunken(&self, patient: &Moments) -> Vec<Shrunken> {
        let (precision, information) = patient.parts();
        let given: Vec<(DVector<f64>, DMatrix<f64>)> = self
            .tried
            .iter()
            .map(|t| {
                let variance = variances(&t.spreads);
                let damped = damped(&precision, &variance);
                // Posterior given the mean: G h + (I + T P)^-1 mean, G = T (I + P T)^-1.
                let own = &variance * &damped;
                let pulled = damped.transpose();
                let mean = &own * &information + &pulled * &t.mean;
                (mean, own + &pulled * &t.covariance * pulled.transpose())
            })
            .collect();
        let of = |(n, name): (usize, &String)| {
            let parts = self.weights.iter().zip(&given).map(|(w, (m, c))| (*w, m[n], c[(n, n)].max(0.0).sqrt()));
            let found = inferred(&parts.collect::<Vec<Part>>());
            let interval_95 = found.interval_95.map(f64::exp);
            Shrunken { name: name.clone(), value: found.mean.exp(), log_sd: found.sd, interval_95 }
        };
        self.names.iter().enumerate().filter(|(n, _)| patient.tells_of(*n)).map(of).collect()
    }

    fn inferred(&self, of: impl Fn(&Tried) -> (f64, f64)) -> Inferred {
        let part = |(weight, tried): (&f64, &Tried)| {
            let (mean, variance) = of(tried);
            (*weight, mean, variance.max(0.0).sqrt())
        };
        inferred(&self.weights.iter().zip(&self.tried).map(part).collect::<Vec<Part>>())
    }
}

/// Parts of no weight cost time and say nothing.
const NO_WEIGHT: f64 = 1e-12;

fn inferred(parts: &[Part]) -> Inferred {
    let kept: Vec<Part> = parts.iter().filter(|(w, ..)| *w > NO_WEIGHT).copied().collect();
    let (mean, sd) = mean_and_sd(&kept);
    Inferred { mean, sd, interval_95: [quantile(&kept, 0.025), quantile(&kept, 0.975)] }
}

/// What a parameter is about, in its unit: the middle of the means' prior.
fn usual(name: &str) -> f64 {
    if name.contains("density") { 100.0 } else { 1000.0 }
}

fn variances(spreads: &[f64]) -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_iterator(spreads.len(), spreads.iter().map(|s| s * s)))
}

/// (I + P T)^-1; it exists for every P and T without negative directions.
fn damped(precision: &DMatrix<f64>, variance: &DMatrix<f64>) -> DMatrix<f64> {
    let count = precision.nrows();
    let sum = DMatrix::identity(count, count) + precision * variance;
    sum.try_inverse().unwrap_or_else(|| DMatrix::zeros(count, count))
}

/// Whether a patient's scans alone, from what is known before any patient, halve what is not known of a parameter. A cohort of
/// patients who do not leaves the hierarchy's own priors.
pub(super) fn narrows(patient: &Moments, parameter: usize) -> bool {
    let (precision, _) = patient.parts();
    let count = precision.nrows();
    let before = DMatrix::identity(count, count) * MEAN_SD.powi(-2);
    let after = (before + precision).try_inverse();
    after.is_some_and(|variances| variances[(parameter, parameter)] <= (0.5 * MEAN_SD).powi(2))
}

/// The density of these spreads and the population's mean under them. A patient's own logarithms are integrated out: the scans'
/// say is then a reading of the mean with precision W = (P^-1 + T)^-1.
fn tried(patients: &[(DMatrix<f64>, DVector<f64>)], first: &DVector<f64>, spreads: Vec<f64>) -> Tried {
    let count = first.len();
    let variance = variances(&spreads);
    let weak = MEAN_SD.powi(-2);
    let mut sum = DMatrix::identity(count, count) * weak;
    let mut pulled = first * weak;
    let mut log_density: f64 = spreads.iter().map(|s| -0.5 * (s / SPREAD_SCALE).powi(2)).sum();
    for (precision, information) in patients {
        let damped = damped(precision, &variance);
        let mean = &damped * information;
        log_density += 0.5 * damped.determinant().ln() + 0.5 * (information.transpose() * &variance * &mean)[(0, 0)];
        sum += &damped * precision;
        pulled += mean;
    }
    let covariance = sum.try_inverse().unwrap_or_else(|| DMatrix::identity(count, count));
    let covariance = 0.5 * (&covariance + covariance.transpose());
    let mean = &covariance * &pulled;
    log_density += 0.5 * covariance.determinant().ln() + 0.5 * pulled.dot(&mean);
    Tried { spreads, log_density, mean, covariance }
}

//! The spreads of highest posterior density, and how sure they are.

use super::evidence::Evidence;
use super::spreads::{SPREADS, Spreads};
use super::study::Studies;
use crate::material::meta_model;
use crate::material::random::CounterRng;
use crate::material::slope::{STEEP, left_over};
use argmin::core::{CostFunction, Error, Executor, Gradient};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use nalgebra::{DMatrix, linalg::Cholesky};
use rayon::prelude::*;
use std::cell::RefCell;
use thiserror::Error as ThisError;

/// Starts besides the given one: the posterior has had one mode from all of them.
const STARTS: u64 = 2;
/// Steps of a search at most.
const ITERATIONS: u64 = 200;
/// Step of the differences of gradients behind the Laplace approximation, in logarithms.
const DIFFERENCE: f64 = 1e-4;

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, ThisError)]
pub enum FitError {
    /// No curve with a point away from rest.
    #[error("the studies have no curve with a positive energy away from rest: add at least one study")]
    NoCurve,
    /// No start got anywhere.
    #[error("the likelihood of these studies is finite from no start: look for a curve with absurd moduli")]
    NotFinite,
    /// A law that cannot be fitted to what is predicted.
    #[error(transparent)]
    Law(#[from] meta_model::FitError),
}

/// The search has ended on a slope.
#[derive(Clone, Copy, Debug, PartialEq, ThisError)]
#[error(
    "the search of the spreads ended before their probability was greatest: its slope is {slope:.1e} for each point, where \
     {STEEP:.0e} and less is flat; look for a study with absurd moduli, or try another --seed"
)]
pub struct Unfinished {
    /// Norm of the gradient over the points.
    pub slope: f64,
}

impl StudyLevelFit {
    /// Whether the search came to where the probability is greatest of these studies.
    pub fn warning(&self, studies: &Studies) -> Option<Unfinished> {
        left_over(self.gradient_norm, studies.points()).map(|slope| Unfinished { slope })
    }
}

/// The fitted model.
#[derive(Clone, Debug)]
pub struct StudyLevelFit {
    /// The spreads.
    pub spreads: Spreads,
    /// Sd of the logarithm of each spread (Laplace), in the order of their list; infinite where the studies do not bound it.
    pub log_sds: [f64; SPREADS],
    /// Log likelihood there.
    pub log_likelihood: f64,
    /// Log probability of the studies with the spreads integrated out (Laplace); minus infinity where they are not bounded.
    pub log_evidence: f64,
    /// Norm of the gradient of the log posterior density there, in logarithms.
    pub gradient_norm: f64,
    /// Minus the second derivatives of the log posterior density there, in logarithms.
    pub(super) curvature: DMatrix<f64>,
}

/// A point, its value and its gradient.
type Seen = (Vec<f64>, f64, Vec<f64>);

struct Search<'a> {
    studies: &'a Studies,
    /// Values are divided by it.
    scale: f64,
    last: RefCell<Option<Seen>>,
}

impl Search<'_> {
    /// Minus the log posterior density with its gradient, scaled.
    fn evaluate(&self, at: &[f64]) -> (f64, Vec<f64>) {
        if let Some((point, value, slope)) = &*self.last.borrow()
            && point == at
        {
            return (*value, slope.clone());
        }
        let (value, slope) = match density(self.studies, at) {
            Some((value, slope)) => (-value / self.scale, slope.iter().map(|s| -s / self.scale).collect()),
            // A point that cannot be evaluated is worse than any other: the line search turns back.
            None => (f64::MAX.sqrt(), vec![0.0; SPREADS]),
        };
        *self.last.borrow_mut() = Some((at.to_vec(), value, slope.clone()));
        (value, slope)
    }
}

/// Logarithms beyond these leave nothing but rounding.
const LOG_LIMIT: f64 = 12.0;

pub(super) fn density(studies: &Studies, logs: &[f64]) -> Option<(f64, [f64; SPREADS])> {
    let logs: [f64; SPREADS] = logs.try_into().ok()?;
    if logs.iter().any(|x| x.is_nan() || x.abs() >= LOG_LIMIT) {
        return None;
    }
    let spreads = Spreads::from_logs(&logs);
    let evidence = Evidence::new(studies, &spreads)?;
    let (prior, slope) = spreads.log_prior();
    Some((evidence.log_likelihood + prior, std::array::from_fn(|n| evidence.gradient[n] + slope[n])))
}

impl CostFunction for &Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, at: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.evaluate(at).0)
    }
}

impl Gradient for &Search<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, at: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.evaluate(at).1)
    }
}

fn descend(studies: &Studies, from: Vec<f64>) -> (Vec<f64>, f64) {
    let search = Search { studies, scale: studies.points().max(1) as f64, last: RefCell::new(None) };
    let (value, _) = search.evaluate(&from);
    let solver = LBFGS::new(MoreThuenteLineSearch::new(), SPREADS)
        .with_tolerance_grad(1e-8)
        .and_then(|solver| solver.with_tolerance_cost(1e-12));
    let found = solver.and_then(|solver| {
        Executor::new(&search, solver).configure(|state| state.param(from.clone()).max_iters(ITERATIONS)).run()
    });
    match found {
        Ok(mut result) => {
            let cost = result.state.get_best_cost();
            (result.state.take_best_param().unwrap_or(from), cost)
        }
        // A line search that cannot go on ends the start where it began.
        Err(_) => (from, value),
    }
}

/// Fits the spreads to studies, from `start` and seeded starts around it.
///
/// # Errors
/// [`FitError`].
pub fn fit(studies: &Studies, start: &Spreads, seed: u64) -> Result<StudyLevelFit, FitError> {
    if studies.points() == 0 {
        return Err(FitError::NoCurve);
    }
    let logs: Vec<f64> = start.to_array().iter().map(|s| s.ln()).collect();
    let rng = CounterRng::new(seed, 0);
    let begin = |number: u64| -> Vec<f64> {
        let moved = |(n, log): (usize, &f64)| log + 0.5 * rng.normal(number * SPREADS as u64 + n as u64);
        if number == 0 { logs.clone() } else { logs.iter().enumerate().map(moved).collect() }
    };
    let found: Vec<_> = (0..=STARTS).into_par_iter().map(|number| descend(studies, begin(number))).collect();
    let best = found.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(at, _)| at).ok_or(FitError::NotFinite)?;
    closed(studies, &best)
}

/// The fit from one start alone: for studies of which one is left out.
///
/// # Errors
/// [`FitError`].
pub fn refit(studies: &Studies, start: &Spreads) -> Result<StudyLevelFit, FitError> {
    let (at, _) = descend(studies, start.to_array().iter().map(|s| s.ln()).collect());
    closed(studies, &at)
}

fn closed(studies: &Studies, at: &[f64]) -> Result<StudyLevelFit, FitError> {
    let logs: [f64; SPREADS] = at.try_into().map_err(|_| FitError::NotFinite)?;
    let spreads = Spreads::from_logs(&logs);
    let evidence = Evidence::new(studies, &spreads).ok_or(FitError::NotFinite)?;
    let (density_there, slope) = density(studies, at).ok_or(FitError::NotFinite)?;
    let mut curvature = DMatrix::zeros(SPREADS, SPREADS);
    for n in 0..SPREADS {
        let beside = |step: f64| {
            let mut moved = at.to_vec();
            moved[n] += step;
            density(studies, &moved).map(|(_, slope)| slope).ok_or(FitError::NotFinite)
        };
        let (up, down) = (beside(DIFFERENCE)?, beside(-DIFFERENCE)?);
        for m in 0..SPREADS {
            curvature[(m, n)] = (down[m] - up[m]) / (2.0 * DIFFERENCE);
        }
    }
    let curvature = 0.5 * (&curvature + curvature.transpose());
    let (log_sds, log_evidence) = match Cholesky::new(curvature.clone()) {
        Some(factor) => {
            let covariance = factor.inverse();
            let half_log: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
            let volume = 0.5 * SPREADS as f64 * std::f64::consts::TAU.ln() - half_log;
            (std::array::from_fn(|n| covariance[(n, n)].sqrt()), density_there + volume)
        }
        None => ([f64::INFINITY; SPREADS], f64::NEG_INFINITY),
    };
    let gradient_norm = slope.iter().map(|s| s * s).sum::<f64>().sqrt();
    Ok(StudyLevelFit {
        spreads,
        log_sds,
        log_likelihood: evidence.log_likelihood,
        log_evidence,
        gradient_norm,
        curvature,
    })
}

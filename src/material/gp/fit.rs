//! Hyperparameters of greatest likelihood: limited-memory BFGS from several seeded starts.
//!
//! The likelihood has several local optima (the flat tasks can hang on the shared curve or on their own), so one start
//! is not enough. Every start is searched for a short while, the best are searched to the end.

use super::gradient::negative_log_likelihood_and_gradient;
use super::hyperparameters::Hyperparameters;
use crate::material::random::CounterRng;
use crate::material::slope::{STEEP, left_over};
use crate::material::task::TASKS;
use crate::material::training::TrainingData;
use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use thiserror::Error as ThisError;

/// How hyperparameters are searched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FitSettings {
    /// Rank of the coregionalisation, 1 or more.
    pub rank: usize,
    /// Seed of the starts.
    pub seed: u64,
    /// Starts.
    pub starts: usize,
    /// Iterations of each start before the best are chosen.
    pub first_iterations: usize,
    /// Starts that are searched to the end.
    pub finalists: usize,
    /// Iterations of a finalist at most.
    pub iterations: usize,
    /// Added to every noise variance, (ln Pa)^2.
    pub noise_floor: f64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self { rank: 1, seed: 0, starts: 6, first_iterations: 150, finalists: 1, iterations: 600, noise_floor: 1e-8 }
    }
}

/// Settings or data that nothing can be fitted with.
#[derive(Clone, Debug, PartialEq, ThisError)]
pub enum FitRefusal {
    /// A setting out of range.
    #[error("`{field}` is {value}; it must be {rule}: change its option or the table [gp] of the settings file")]
    Setting {
        /// The setting.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// No start got anywhere.
    #[error(
        "the likelihood is not finite from any of {starts} starts: raise `noise_floor` in the table [gp] of the \
         settings file (it is {noise_floor})"
    )]
    NoStart {
        /// Starts tried.
        starts: usize,
        /// The floor.
        noise_floor: f64,
    },
}

/// Where one start ended.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StartRecord {
    /// Number of the start.
    pub start: usize,
    /// Negative log likelihood where it ended.
    pub negative_log_likelihood: f64,
    /// Iterations.
    pub iterations: u64,
    /// Whether it was among those searched to the end.
    pub finalist: bool,
}

/// The best hyperparameters found.
#[derive(Clone, Debug, PartialEq)]
pub struct HyperparameterFit {
    /// They.
    pub hyperparameters: Hyperparameters,
    /// Their negative log marginal likelihood.
    pub negative_log_likelihood: f64,
    /// Norm of the gradient there, in the variables of the search.
    pub gradient_norm: f64,
    /// All starts, in order.
    pub starts: Vec<StartRecord>,
}

/// Why hyperparameters may not be those of greatest likelihood.
#[derive(Clone, Copy, Debug, PartialEq, ThisError)]
pub enum FitWarning {
    /// The search has ended on a slope.
    #[error(
        "the search of the hyperparameters ended before the likelihood was greatest: its slope is {slope:.1e} for each observation, \
         where {STEEP:.0e} and less is flat; raise `iterations` (it is {iterations}) and `starts` in the table [gp] of the settings file"
    )]
    Unfinished {
        /// Norm of the gradient over the observations.
        slope: f64,
        /// Iterations of a finalist at most.
        iterations: usize,
    },
    /// The built-in hyperparameters explain the same data better.
    #[error(
        "the hyperparameters found explain the studies worse than the published ones do (negative log likelihood {found:.3} against \
         {published:.3}): raise `starts` and `iterations` in the table [gp] of the settings file"
    )]
    WorseThanPublished {
        /// Negative log likelihood found.
        found: f64,
        /// That of the published ones.
        published: f64,
    },
}

impl HyperparameterFit {
    /// What is to be told of it beside the negative log likelihood of the published hyperparameters on the same data.
    pub fn warnings(&self, settings: &FitSettings, data: &TrainingData, published: f64) -> Vec<FitWarning> {
        let slope = left_over(self.gradient_norm, data.observations());
        let unfinished = slope.map(|slope| FitWarning::Unfinished { slope, iterations: settings.iterations });
        let found = self.negative_log_likelihood;
        // Less than a hundredth is no other explanation.
        let worse = (found > published + 0.01).then_some(FitWarning::WorseThanPublished { found, published });
        unfinished.into_iter().chain(worse).collect()
    }
}

/// Weights are searched in units of this, ln Pa, so that all variables are of like size.
const WEIGHT_UNIT: f64 = 20.0;
/// Pairs of steps kept: as many as there are variables at rank 1, since valleys are long and narrow.
const MEMORY: usize = 40;
/// Logarithms beyond these would overflow or stop mattering; there the slope is zero.
const LOG_LIMITS: [f64; 2] = [-60.0, 20.0];

/// A point with its value and gradient, scaled.
struct Evaluation {
    at: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

/// Hyperparameters as a point of the search: ln lengthscale, weights, ln kappa, ln noise variance.
struct Search<'a> {
    data: &'a TrainingData,
    rank: usize,
    noise_floor: f64,
    /// The value is divided by it, so that the first step (the gradient itself) is of order one.
    scale: f64,
    /// Value and gradient at the last point: the line search asks for them one after the other.
    last: RefCell<Option<Evaluation>>,
}

impl Search<'_> {
    fn hyperparameters(&self, at: &[f64]) -> Hyperparameters {
        let exp = |x: f64| x.clamp(LOG_LIMITS[0], LOG_LIMITS[1]).exp();
        let (kappa, noise) = at[1 + TASKS * self.rank..].split_at(TASKS);
        Hyperparameters {
            lengthscale: exp(at[0]),
            weights: at[1..=TASKS * self.rank]
                .chunks(TASKS)
                .map(|w| std::array::from_fn(|t| WEIGHT_UNIT * w[t]))
                .collect(),
            kappa: std::array::from_fn(|t| exp(kappa[t])),
            noise_variance: std::array::from_fn(|t| exp(noise[t])),
            noise_floor: self.noise_floor,
        }
    }

    fn evaluate(&self, at: &[f64]) -> (f64, Vec<f64>) {
        if let Some(last) = &*self.last.borrow()
            && last.at == at
        {
            return (last.value, last.gradient.clone());
        }
        let hyperparameters = self.hyperparameters(at);
        let (value, slopes) = negative_log_likelihood_and_gradient(&hyperparameters, self.data);
        let inside = |x: f64| f64::from(u8::from(x > LOG_LIMITS[0] && x < LOG_LIMITS[1]));
        let mut gradient = vec![slopes.lengthscale * hyperparameters.lengthscale * inside(at[0])];
        gradient.extend(slopes.weights.iter().flatten().map(|slope| slope * WEIGHT_UNIT));
        let logs = &at[gradient.len()..];
        let kappa = slopes.kappa.iter().zip(&hyperparameters.kappa);
        let noise = slopes.noise_variance.iter().zip(&hyperparameters.noise_variance);
        gradient.extend(kappa.chain(noise).zip(logs).map(|((slope, value), log)| slope * value * inside(*log)));
        for slope in &mut gradient {
            *slope /= self.scale;
        }
        // A point that cannot be evaluated is worse than any other: the line search turns back.
        let value = if value.is_finite() { value / self.scale } else { f64::MAX.sqrt() };
        *self.last.borrow_mut() = Some(Evaluation { at: at.to_vec(), value, gradient: gradient.clone() });
        (value, gradient)
    }

    fn start(&self, rng: CounterRng, number: usize) -> Vec<f64> {
        let first = (number * 4096) as u64;
        let mut at = vec![rng.between(first, 0.05_f64.ln(), 0.6_f64.ln())];
        // Curves of one sign shared by all tasks in the first rank (all energies have the same shape), of either sign
        // in the others. They start small and grow: starts at the final size end in worse optima.
        let weight = |t: usize| {
            let size = rng.between(first + 1 + t as u64, 0.3, 0.7);
            if t < TASKS { size } else { 0.2 * rng.normal(first + 1 + t as u64) }
        };
        at.extend((0..TASKS * self.rank).map(weight));
        at.extend((0..2 * TASKS as u64).map(|t| rng.between(first + 2048 + t, -4.0, 2.0)));
        at
    }
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

/// Follows one start; the point it ends at, its value (scaled) and the iterations taken.
fn descend(search: &Search, from: Vec<f64>, iterations: usize) -> (Vec<f64>, f64, u64) {
    let (value, _) = search.evaluate(&from);
    let solver = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY)
        .with_tolerance_grad(1e-9)
        .and_then(|solver| solver.with_tolerance_cost(1e-13));
    let found = solver.and_then(|solver| {
        Executor::new(search, solver).configure(|state| state.param(from.clone()).max_iters(iterations as u64)).run()
    });
    match found {
        Ok(mut result) => {
            let (cost, iterations) = (result.state.get_best_cost(), result.state.get_iter());
            (result.state.take_best_param().unwrap_or(from), cost, iterations)
        }
        // A line search that cannot go on ends the start where it began.
        Err(_) => (from, value, 0),
    }
}

/// Searches the hyperparameters of greatest likelihood.
///
/// # Errors
/// [`FitRefusal`].
pub fn fit_hyperparameters(data: &TrainingData, settings: &FitSettings) -> Result<HyperparameterFit, FitRefusal> {
    let whole = |field, value: usize, most: usize, rule| {
        let inside = (1..=most).contains(&value);
        if inside { Ok(()) } else { Err(FitRefusal::Setting { field, value: value as f64, rule }) }
    };
    whole("rank", settings.rank, TASKS, "from 1 to 12")?;
    whole("starts", settings.starts, 10_000, "from 1 to 10000")?;
    whole("finalists", settings.finalists, settings.starts, "from 1 to the number of starts")?;
    whole("first_iterations", settings.first_iterations, 1_000_000, "1 or more")?;
    whole("iterations", settings.iterations, 1_000_000, "1 or more")?;
    if !(settings.noise_floor > 0.0 && settings.noise_floor.is_finite()) {
        let (field, value) = ("noise_floor", settings.noise_floor);
        return Err(FitRefusal::Setting { field, value, rule: "positive" });
    }
    let search = || Search {
        data,
        rank: settings.rank,
        noise_floor: settings.noise_floor,
        scale: data.observations().max(1) as f64,
        last: RefCell::new(None),
    };
    let rng = CounterRng::new(settings.seed, 0);
    let first = |number: usize| {
        let search = search();
        descend(&search, search.start(rng, number), settings.first_iterations)
    };
    let mut found: Vec<_> = (0..settings.starts).into_par_iter().map(first).collect();
    let mut order: Vec<usize> = (0..settings.starts).collect();
    order.sort_by(|a, b| found[*a].1.total_cmp(&found[*b].1).then(a.cmp(b)));
    order.truncate(settings.finalists);
    let last = |number: &usize| descend(&search(), found[*number].0.clone(), settings.iterations);
    let finals: Vec<_> = order.par_iter().map(last).collect();
    for (number, (at, value, iterations)) in order.iter().zip(finals) {
        found[*number] = (at, value, found[*number].2 + iterations);
    }
    let best = order.iter().copied().min_by(|a, b| found[*a].1.total_cmp(&found[*b].1).then(a.cmp(b)));
    let search = search();
    let refusal = FitRefusal::NoStart { starts: settings.starts, noise_floor: settings.noise_floor };
    let best = best.filter(|best| found[*best].1 < 1e100).ok_or(refusal)?;
    let (_, gradient) = search.evaluate(&found[best].0);
    let record = |(start, (_, value, iterations)): (usize, &(Vec<f64>, f64, u64))| StartRecord {
        start,
        negative_log_likelihood: value * search.scale,
        iterations: *iterations,
        finalist: order.contains(&start),
    };
    Ok(HyperparameterFit {
        hyperparameters: search.hyperparameters(&found[best].0),
        negative_log_likelihood: found[best].1 * search.scale,
        gradient_norm: search.scale * gradient.iter().map(|g| g * g).sum::<f64>().sqrt(),
        starts: found.iter().enumerate().map(record).collect(),
    })
}

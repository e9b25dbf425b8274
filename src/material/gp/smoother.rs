//! Posterior of one task by the modified Bryson-Frazier smoother: no covariance is ever inverted, so kappa = 0 and
//! vanishing noise are harmless (Bierman, "Fixed interval smoothing with discrete measurements", Int J Control 18, 1973).

use super::filter::{self, Half, Record, State, Stop, Update, transposed};
use super::hyperparameters::{Hyperparameters, TaskMatrix};
use super::matern::Transition;
use crate::material::task::{TASKS, Task};
use crate::material::training::TrainingData;
use serde::Serialize;

/// What the Gaussian process says of one tissue: mean and spread of y = ln(W / Pa + offset) at each stretch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TissuePrior {
    /// Task.
    pub task: Task,
    /// Stretches, in the order asked for.
    pub stretches: Vec<f64>,
    /// Posterior mean of y, ln Pa.
    pub mean: Vec<f64>,
    /// Standard deviation of the latent curve, ln Pa.
    pub latent_sd: Vec<f64>,
    /// Standard deviation of a new observation, noise included, ln Pa.
    pub observation_sd: Vec<f64>,
}

impl TissuePrior {
    /// mean + k sd of a new observation: the published program's "sample", a quantile envelope rather than a draw.
    pub fn quantile(&self, standard_deviations: f64) -> Vec<f64> {
        self.mean.iter().zip(&self.observation_sd).map(|(m, sd)| m + standard_deviations * sd).collect()
    }
}

/// States at the queries after their updates, and all updates: the small variances left by precise inputs must not be
/// differences of large ones.
struct Trace {
    wanted: Vec<bool>,
    states: Vec<Option<State>>,
    updates: Vec<Update>,
}

impl Record for Trace {
    fn filtered(&mut self, knot: usize, state: &State) {
        if self.wanted[knot] {
            self.states[knot] = Some(state.clone());
        }
    }
    fn updated(&mut self, update: &Update) {
        self.updates.push(*update);
    }
}

/// Lambda and lambda of the backward recursion, blocks as in [`State`].
pub(super) struct Adjoint {
    pub f: Half,
    pub g: Half,
    pub ff: TaskMatrix,
    pub fg: TaskMatrix,
    pub gg: TaskMatrix,
}

impl Adjoint {
    pub fn zero() -> Self {
        let zero = [[0.0; TASKS]; TASKS];
        Self { f: [0.0; TASKS], g: [0.0; TASKS], ff: zero, fg: zero, gg: zero }
    }

    /// Through a transition: A^T lambda and A^T Lambda A.
    pub fn back_through(&mut self, transition: &Transition) {
        let [a, b, c, d] = transition.a;
        for i in 0..TASKS {
            let (f, g) = (self.f[i], self.g[i]);
            self.f[i] = a * f + c * g;
            self.g[i] = b * f + d * g;
        }
        let gf = transposed(&self.fg);
        for i in 0..TASKS {
            let (ff, fg, gf, gg) = (&mut self.ff[i], &mut self.fg[i], &gf[i], &mut self.gg[i]);
            for j in 0..TASKS {
                let (p, r, rt, s) = (ff[j], fg[j], gf[j], gg[j]);
                let cross = r + rt;
                ff[j] = a * a * p + a * c * cross + c * c * s;
                fg[j] = a * b * p + a * d * r + b * c * rt + c * d * s;
                gg[j] = b * b * p + b * d * cross + d * d * s;
            }
        }
    }

    /// Lambda times a state vector.
    pub fn times(&self, f: &Half, g: &Half) -> (Half, Half) {
        let gf = transposed(&self.fg);
        let dot = |row: &Half, v: &Half| row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
        let on_f = std::array::from_fn(|i| dot(&self.ff[i], f) + dot(&self.fg[i], g));
        let on_g = std::array::from_fn(|i| dot(&gf[i], f) + dot(&self.gg[i], g));
        (on_f, on_g)
    }

    /// Through an update of f_task: Lambda <- e e^T / S + C^T Lambda C with C = I - K e^T, and likewise lambda. Returns
    /// the smoothed score of the observation and its precision, (K^-1 y)_i and (K^-1)_ii of the dense covariance K.
    pub fn back_through_update(&mut self, task: usize, update: &Update) -> (f64, f64) {
        let gain = |v: Half| v.map(|x| x / update.variance);
        let (kf, kg) = (gain(update.cov_f), gain(update.cov_g));
        let (lf, lg) = self.times(&kf, &kg);
        let dot = |a: &Half, b: &Half| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let quadratic = dot(&kf, &lf) + dot(&kg, &lg);
        let along = dot(&kf, &self.f) + dot(&kg, &self.g);
        let score = along + update.innovation / update.variance;
        let precision = quadratic + 1.0 / update.variance;
        self.f[task] -= score;
        for i in 0..TASKS {
            self.ff[task][i] -= lf[i];
            self.ff[i][task] -= lf[i];
            self.fg[task][i] -= lg[i];
        }
        self.ff[task][task] += precision;
        (score, precision)
    }
}

/// What the passes leave at a query.
pub(super) struct Passed {
    pub mean: f64,
    pub variance: f64,
    /// Covariance of the filtered state with the task's curve.
    pub row: (Half, Half),
    /// Lambda times it: what later data take away.
    pub taken: (Half, Half),
}

/// Both passes over the data and the queries.
pub(super) struct Smoothed {
    pub stops: Vec<Stop>,
    /// Stop of each query.
    pub place: Vec<usize>,
    /// At each stop that is a query.
    pub passed: Vec<Option<Passed>>,
    /// By number of the input.
    pub updates: Vec<Update>,
}

/// Runs both passes for one task.
pub(super) fn smooth(parameters: &Hyperparameters, data: &TrainingData, task: Task, stretches: &[f64]) -> Smoothed {
    let (stops, place) = filter::stops(data, stretches);
    let mut wanted = vec![false; stops.len()];
    for stop in &place {
        wanted[*stop] = true;
    }
    let mut trace = Trace { wanted, states: vec![None; stops.len()], updates: Vec::new() };
    filter::run(parameters, data, &stops, &mut trace);
    let mut adjoint = Adjoint::zero();
    let mut passed: Vec<Option<Passed>> = stops.iter().map(|_| None).collect();
    let t = task.index();
    for (index, stop) in stops.iter().enumerate().rev() {
        if let Some(state) = &trace.states[index] {
            let (row_f, row_g) = (state.ff[t], state.fg[t]);
            let dot = |a: &Half, b: &Half| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let (lf, lg) = adjoint.times(&row_f, &row_g);
            let mean = state.f[t] - dot(&row_f, &adjoint.f) - dot(&row_g, &adjoint.g);
            let variance = (state.ff[t][t] - dot(&row_f, &lf) - dot(&row_g, &lg)).max(0.0);
            passed[index] = Some(Passed { mean, variance, row: (row_f, row_g), taken: (lf, lg) });
        }
        for input in (stop.first_input..stop.end_input).rev() {
            adjoint.back_through_update(data.inputs()[input].task, &trace.updates[input]);
        }
        if index > 0 {
            let gap = stop.stretch - stops[index - 1].stretch;
            adjoint.back_through(&Transition::over(gap, parameters.lengthscale));
        }
    }
    Smoothed { stops, place, passed, updates: trace.updates }
}

impl Smoothed {
    /// The prior of a tissue from the passes.
    pub fn prior(&self, task: Task, stretches: &[f64], noise_variance: f64) -> TissuePrior {
        let at = |stop: &usize| self.passed[*stop].as_ref().map_or((f64::NAN, f64::NAN), |p| (p.mean, p.variance));
        let found: Vec<(f64, f64)> = self.place.iter().map(at).collect();
        TissuePrior {
            task,
            stretches: stretches.to_vec(),
            mean: found.iter().map(|(mean, _)| *mean).collect(),
            latent_sd: found.iter().map(|(_, variance)| variance.sqrt()).collect(),
            observation_sd: found.iter().map(|(_, variance)| (variance + noise_variance).sqrt()).collect(),
        }
    }
}

/// Posterior of one task at these stretches, in any order.
pub fn posterior(parameters: &Hyperparameters, data: &TrainingData, task: Task, stretches: &[f64]) -> TissuePrior {
    let noise = parameters.observation_variance(task.index());
    smooth(parameters, data, task, stretches).prior(task, stretches, noise)
}

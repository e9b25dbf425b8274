//! Exact likelihood by a Kalman filter over the sorted stretches: linear in the number of inputs.
//!
//! The state at a stretch is [f; g] in R^24, f the twelve latent curves and g their scaled slopes. Between stretches it
//! moves by A(D) (x) I with noise Q(D) (x) B; every collapsed input is one scalar update.

use super::hyperparameters::{Hyperparameters, TaskMatrix};
use super::matern::Transition;
use crate::material::task::TASKS;
use crate::material::training::TrainingData;
use std::ops::Range;

/// Half of the state.
pub(super) type Half = [f64; TASKS];

/// Mean and covariance of [f; g]; `fg` holds cov(f_i, g_j).
#[derive(Clone)]
pub(super) struct State {
    pub f: Half,
    pub g: Half,
    pub ff: TaskMatrix,
    pub fg: TaskMatrix,
    pub gg: TaskMatrix,
}

/// One scalar update, as the backward passes need it.
#[derive(Clone, Copy)]
pub(super) struct Update {
    /// Covariance of the state with the observed latent value.
    pub cov_f: Half,
    /// Same, slopes.
    pub cov_g: Half,
    /// Observation minus prediction.
    pub innovation: f64,
    /// Its variance.
    pub variance: f64,
}

/// What a pass leaves behind for a backward pass.
pub(super) trait Record {
    /// Update by an input.
    fn updated(&mut self, _update: &Update) {}
    /// State at a knot after its updates.
    fn filtered(&mut self, _knot: usize, _state: &State) {}
}

/// Keeps nothing.
pub(super) struct Nothing;

impl Record for Nothing {}

/// Stretches that the filter stops at; a knot without inputs is a query.
pub(super) struct Stop {
    pub stretch: f64,
    pub first_input: usize,
    pub end_input: usize,
}

/// The knots of the data with the queries sorted in, and for each query the index of its stop.
pub(super) fn stops(data: &TrainingData, queries: &[f64]) -> (Vec<Stop>, Vec<usize>) {
    let mut order: Vec<usize> = (0..queries.len()).collect();
    order.sort_by(|a, b| queries[*a].total_cmp(&queries[*b]));
    let mut stops: Vec<Stop> = Vec::with_capacity(data.knots().len() + queries.len());
    let mut place = vec![0; queries.len()];
    let mut knots = data.knots().iter().peekable();
    let mut stop_at_knots_up_to = |limit: f64, stops: &mut Vec<Stop>| {
        while let Some(knot) = knots.next_if(|knot| knot.stretch <= limit) {
            stops.push(Stop { stretch: knot.stretch, first_input: knot.first_input, end_input: knot.end_input });
        }
    };
    for query in order {
        let stretch = queries[query];
        stop_at_knots_up_to(stretch, &mut stops);
        if stops.last().is_none_or(|last| last.stretch != stretch) {
            let next = stops.last().map_or(0, |last| last.end_input);
            stops.push(Stop { stretch, first_input: next, end_input: next });
        }
        place[query] = stops.len() - 1;
    }
    stop_at_knots_up_to(f64::INFINITY, &mut stops);
    (stops, place)
}

impl State {
    /// The stationary state.
    pub fn stationary(b: &TaskMatrix) -> Self {
        Self { f: [0.0; TASKS], g: [0.0; TASKS], ff: *b, fg: [[0.0; TASKS]; TASKS], gg: *b }
    }

    /// Moves to the next stretch.
    fn predict(&mut self, transition: &Transition, b: &TaskMatrix) {
        let [a, bb, c, d] = transition.a;
        let [q11, q12, q22] = transition.q;
        for i in 0..TASKS {
            let (f, g) = (self.f[i], self.g[i]);
            self.f[i] = a * f + bb * g;
            self.g[i] = c * f + d * g;
        }
        let gf = transposed(&self.fg);
        for i in 0..TASKS {
            let (ff, fg, gf, gg, b) = (&mut self.ff[i], &mut self.fg[i], &gf[i], &mut self.gg[i], &b[i]);
            for j in 0..TASKS {
                let (p, r, rt, s) = (ff[j], fg[j], gf[j], gg[j]);
                let cross = r + rt;
                ff[j] = a * a * p + a * bb * cross + bb * bb * s + q11 * b[j];
                fg[j] = a * c * p + a * d * r + bb * c * rt + bb * d * s + q12 * b[j];
                gg[j] = c * c * p + c * d * cross + d * d * s + q22 * b[j];
            }
        }
    }

    /// Takes in an observation of f_task with this noise variance.
    fn update(&mut self, task: usize, observed: f64, noise: f64) -> Update {
        let (cov_f, cov_g) = (self.ff[task], self.fg[task]);
        let innovation = observed - self.f[task];
        let variance = cov_f[task] + noise;
        let inverse = 1.0 / variance;
        let step = innovation * inverse;
        for i in 0..TASKS {
            self.f[i] += cov_f[i] * step;
            self.g[i] += cov_g[i] * step;
            let (along_f, along_g) = (cov_f[i] * inverse, cov_g[i] * inverse);
            for j in 0..TASKS {
                self.ff[i][j] -= along_f * cov_f[j];
                self.fg[i][j] -= along_f * cov_g[j];
                self.gg[i][j] -= along_g * cov_g[j];
            }
        }
        // p - p p_t / S cancels where noise is small; the observed row is p noise / S exactly.
        let left = noise * inverse;
        for i in 0..TASKS {
            self.ff[task][i] = cov_f[i] * left;
            self.ff[i][task] = cov_f[i] * left;
            self.fg[task][i] = cov_g[i] * left;
        }
        Update { cov_f, cov_g, innovation, variance }
    }
}

pub(super) fn transposed(m: &TaskMatrix) -> TaskMatrix {
    let mut t = [[0.0; TASKS]; TASKS];
    for i in 0..TASKS {
        for j in 0..TASKS {
            t[j][i] = m[i][j];
        }
    }
    t
}

/// Runs the filter over the stops; returns the negative log likelihood of the collapsed means.
pub(super) fn run(parameters: &Hyperparameters, data: &TrainingData, stops: &[Stop], record: &mut impl Record) -> f64 {
    let b = parameters.coregionalisation();
    run_part(parameters, data, stops, 0..stops.len(), (&b, State::stationary(&b)), record)
}

/// Runs it over some of the stops, from the state after the stop before them (the stationary one before the first).
pub(super) fn run_part(
    parameters: &Hyperparameters,
    data: &TrainingData,
    stops: &[Stop],
    part: Range<usize>,
    (b, mut state): (&TaskMatrix, State),
    record: &mut impl Record,
) -> f64 {
    let mut nlml = 0.0;
    for index in part {
        let stop = &stops[index];
        if index > 0 {
            state.predict(&Transition::over(stop.stretch - stops[index - 1].stretch, parameters.lengthscale), b);
        }
        for input in &data.inputs()[stop.first_input..stop.end_input] {
            let noise = parameters.observation_variance(input.task) / input.replicates as f64;
            let update = state.update(input.task, input.mean, noise);
            nlml += 0.5
                * ((2.0 * std::f64::consts::PI * update.variance).ln()
                    + update.innovation * update.innovation / update.variance);
            record.updated(&update);
        }
        record.filtered(index, &state);
    }
    nlml
}

/// The part of the negative log likelihood that replicates add to that of their means.
fn within_groups(parameters: &Hyperparameters, data: &TrainingData) -> f64 {
    data.inputs().iter().fold(0.0, |sum, input| {
        let (count, variance) = (input.replicates as f64, parameters.observation_variance(input.task));
        sum + 0.5 * (count - 1.0) * (2.0 * std::f64::consts::PI * variance).ln()
            + 0.5 * count.ln()
            + 0.5 * input.sum_of_squares / variance
    })
}

pub(super) fn data_stops(data: &TrainingData) -> Vec<Stop> {
    stops(data, &[]).0
}

/// Negative log marginal likelihood of all observations.
pub fn negative_log_likelihood(parameters: &Hyperparameters, data: &TrainingData) -> f64 {
    run(parameters, data, &data_stops(data), &mut Nothing) + within_groups(parameters, data)
}

/// Same over the data's own stops, and what a backward pass needs.
pub(super) fn recorded(
    parameters: &Hyperparameters,
    data: &TrainingData,
    stops: &[Stop],
    record: &mut impl Record,
) -> f64 {
    run(parameters, data, stops, record) + within_groups(parameters, data)
}

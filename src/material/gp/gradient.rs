//! Exact gradient of the likelihood by the adjoint of the filter: one backward pass, a few times the cost of a value.
//!
//! Backward, Lambda and lambda are the second moment and the mean of the score of the remaining data at the predicted
//! state, so that dL/dm = lambda and dL/dP = (Lambda - lambda lambda^T) / 2 for the negative log likelihood L; the chain
//! rule through the prediction and the noise of each update gives the rest (Bierman, Belzer, Vandergraft and Porter,
//! "Maximum likelihood estimation using square root information filters", IEEE Trans Autom Control 35, 1990).

use super::filter::{self, Half, Record, State, Update};
use super::hyperparameters::{Hyperparameters, TaskMatrix};
use super::matern::Transition;
use super::smoother::Adjoint;
use crate::material::task::TASKS;
use crate::material::training::TrainingData;

/// Derivatives of the negative log likelihood in the hyperparameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LikelihoodGradient {
    /// d / d lengthscale.
    pub lengthscale: f64,
    /// d / d w_r.
    pub weights: Vec<[f64; TASKS]>,
    /// d / d kappa.
    pub kappa: [f64; TASKS],
    /// d / d noise variance.
    pub noise_variance: [f64; TASKS],
}

/// Stops between two kept states. The backward pass runs the stops of one part forward again from the state kept
/// before it: a third more arithmetic, but all it touches stays in the processor's cache, whatever the number of
/// studies (Griewank and Walther, "Evaluating Derivatives", 2nd ed., ch. 12).
const PART: usize = 64;

/// The states before each part, from the first forward pass.
struct Checkpoints(Vec<State>);

impl Record for Checkpoints {
    fn filtered(&mut self, stop: usize, state: &State) {
        if (stop + 1).is_multiple_of(PART) {
            self.0.push(state.clone());
        }
    }
}

/// Everything one part went through.
struct Tape {
    states: Vec<State>,
    updates: Vec<Update>,
}

impl Record for Tape {
    fn filtered(&mut self, _stop: usize, state: &State) {
        self.states.push(state.clone());
    }
    fn updated(&mut self, update: &Update) {
        self.updates.push(*update);
    }
}

/// Negative log marginal likelihood of all observations, and its gradient.
pub fn negative_log_likelihood_and_gradient(
    parameters: &Hyperparameters,
    data: &TrainingData,
) -> (f64, LikelihoodGradient) {
    let stops = filter::data_stops(data);
    let b = parameters.coregionalisation();
    let mut before = Checkpoints(vec![State::stationary(&b)]);
    let value = filter::recorded(parameters, data, &stops, &mut before);
    let mut noise_variance = [0.0; TASKS];
    let mut of_b = [[0.0; TASKS]; TASKS];
    let mut lengthscale = 0.0;
    let mut adjoint = Adjoint::zero();
    let mut tape = Tape { states: Vec::with_capacity(PART + 1), updates: Vec::new() };
    for first in (0..stops.len()).step_by(PART).rev() {
        let part = first..(first + PART).min(stops.len());
        let start = &before.0[first / PART];
        tape.states.clear();
        tape.states.push(start.clone());
        tape.updates.clear();
        filter::run_part(parameters, data, &stops, part.clone(), (&b, start.clone()), &mut tape);
        let first_input = stops[first].first_input;
        for index in part.rev() {
            let stop = &stops[index];
            for number in (stop.first_input..stop.end_input).rev() {
                let input = &data.inputs()[number];
                let (score, precision) = adjoint.back_through_update(input.task, &tape.updates[number - first_input]);
                let (count, variance) = (input.replicates as f64, parameters.observation_variance(input.task));
                noise_variance[input.task] += 0.5
                    * ((precision - score * score) / count + (count - 1.0) / variance
                        - input.sum_of_squares / (variance * variance));
            }
            if index == 0 {
                of_stationary(&adjoint, &mut of_b);
            } else {
                let transition = Transition::over(stop.stretch - stops[index - 1].stretch, parameters.lengthscale);
                let of_u = of_prediction(&adjoint, &tape.states[index - first], &transition, &b, &mut of_b);
                lengthscale -= of_u * transition.u / parameters.lengthscale;
                adjoint.back_through(&transition);
            }
        }
    }
    let weights = parameters.weights.iter().map(|w| {
        // dB = dw w^T + w dw^T.
        let row = |i: usize| (0..TASKS).map(|j| (of_b[i][j] + of_b[j][i]) * w[j]).sum();
        std::array::from_fn(row)
    });
    let kappa = std::array::from_fn(|i| of_b[i][i]);
    (value, LikelihoodGradient { lengthscale, weights: weights.collect(), kappa, noise_variance })
}

/// Adds dL/dB of the stationary state, in which f and g have covariance B each.
fn of_stationary(adjoint: &Adjoint, of_b: &mut TaskMatrix) {
    for i in 0..TASKS {
        for j in 0..TASKS {
            of_b[i][j] += 0.5 * (adjoint.ff[i][j] - adjoint.f[i] * adjoint.f[j]);
            of_b[i][j] += 0.5 * (adjoint.gg[i][j] - adjoint.g[i] * adjoint.g[j]);
        }
    }
}

/// dL/du of one prediction from the filtered state before it; adds its dL/dB.
fn of_prediction(
    adjoint: &Adjoint,
    before: &State,
    transition: &Transition,
    b: &TaskMatrix,
    of_b: &mut TaskMatrix,
) -> f64 {
    let [a, bb, c, d] = transition.a;
    let [q11, q12, q22] = transition.q;
    let ([da, db, dc, dd], [dq11, dq12, dq22]) = transition.slopes();
    let dot = |x: &Half, y: &Half| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let mut of_u = dot(&adjoint.f, &before.f) * da
        + dot(&adjoint.f, &before.g) * db
        + dot(&adjoint.g, &before.f) * dc
        + dot(&adjoint.g, &before.g) * dd;
    let gf = filter::transposed(&before.fg);
    let adjoint_gf = filter::transposed(&adjoint.fg);
    for i in 0..TASKS {
        let mut row = [0.0; TASKS];
        for j in 0..TASKS {
            let (p, r, rt, s) = (before.ff[i][j], before.fg[i][j], gf[i][j], before.gg[i][j]);
            let on_ff = 0.5 * (adjoint.ff[i][j] - adjoint.f[i] * adjoint.f[j]);
            let on_fg = 0.5 * (adjoint.fg[i][j] - adjoint.f[i] * adjoint.g[j]);
            let on_gf = 0.5 * (adjoint_gf[i][j] - adjoint.g[i] * adjoint.f[j]);
            let on_gg = 0.5 * (adjoint.gg[i][j] - adjoint.g[i] * adjoint.g[j]);
            // The derivatives of `State::predict`.
            let cross = r + rt;
            let slope_ff = 2.0 * a * da * p + (da * bb + a * db) * cross + 2.0 * bb * db * s + dq11 * b[i][j];
            let slope_fg = (da * c + a * dc) * p
                + (da * d + a * dd) * r
                + (db * c + bb * dc) * rt
                + (db * d + bb * dd) * s
                + dq12 * b[i][j];
            let slope_gg = 2.0 * c * dc * p + (dc * d + c * dd) * cross + 2.0 * d * dd * s + dq22 * b[i][j];
            row[j] = on_ff * slope_ff + 2.0 * on_fg * slope_fg + on_gg * slope_gg;
            of_b[i][j] += q11 * on_ff + q12 * (on_fg + on_gf) + q22 * on_gg;
        }
        of_u += row.iter().sum::<f64>();
    }
    of_u
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::gp::negative_log_likelihood;
    use crate::material::literature::{Curves, table};

    /// Fourth-order central difference of the likelihood in one hyperparameter.
    fn difference(
        at: &Hyperparameters,
        data: &TrainingData,
        step: f64,
        set: impl Fn(&mut Hyperparameters, f64),
    ) -> f64 {
        let value = |k: f64| {
            let mut moved = at.clone();
            set(&mut moved, k * step);
            negative_log_likelihood(&moved, data)
        };
        (8.0 * (value(1.0) - value(-1.0)) - (value(2.0) - value(-2.0))) / (12.0 * step)
    }

    fn check(at: &Hyperparameters) {
        let data = TrainingData::from_literature(&table(), Curves::Published);
        let (value, gradient) = negative_log_likelihood_and_gradient(at, &data);
        assert_eq!(value, negative_log_likelihood(at, &data));
        // Compared as dL / d ln(parameter), the slope a search sees.
        let agree = |name: String, exact: f64, difference: f64| {
            let error = (exact - difference).abs() / exact.abs().max(1.0);
            assert!(error < 1e-6, "{name}: {exact} against {difference}");
        };
        let step = 1e-3 * at.lengthscale;
        let slope = difference(at, &data, step, |h, d| h.lengthscale += d);
        agree("lengthscale".to_owned(), gradient.lengthscale * at.lengthscale, slope * at.lengthscale);
        for t in 0..TASKS {
            for r in 0..at.rank() {
                let scale = at.weights[r][t].abs().max(0.1);
                let slope = difference(at, &data, 1e-3 * scale, |h, d| h.weights[r][t] += d);
                agree(format!("weight {r} {t}"), gradient.weights[r][t] * scale, slope * scale);
            }
            let scale = at.kappa[t];
            let slope = difference(at, &data, 1e-3 * scale, |h, d| h.kappa[t] += d);
            agree(format!("kappa {t}"), gradient.kappa[t] * scale, slope * scale);
            let scale = at.noise_variance[t];
            let slope = difference(at, &data, 1e-3 * scale, |h, d| h.noise_variance[t] += d);
            agree(format!("noise {t}"), gradient.noise_variance[t] * scale, slope * scale);
        }
    }

    fn ordinary() -> Hyperparameters {
        let mut at = Hyperparameters::published();
        at.noise_floor = 1e-2;
        for t in 0..TASKS {
            at.kappa[t] = at.kappa[t].max(0.05);
            at.noise_variance[t] = at.noise_variance[t].max(0.02);
        }
        at
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        check(&ordinary());
    }

    #[test]
    fn the_gradient_of_a_second_rank_is_that_of_differences() {
        let mut at = ordinary();
        at.weights.push(std::array::from_fn(|t| 3.0 - 0.7 * t as f64));
        check(&at);
    }
}

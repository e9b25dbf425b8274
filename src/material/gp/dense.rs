//! The textbook way, a Cholesky factor of the whole covariance: cubic in the inputs. It stands beside the filter as
//! the oracle of tests and benchmarks (Rasmussen and Williams, "Gaussian Processes for Machine Learning", alg. 2.1).

use super::hyperparameters::Hyperparameters;
use super::matern::correlation;
use super::smoother::TissuePrior;
use crate::material::task::Task;
use crate::material::training::TrainingData;
use faer::linalg::solvers::{Llt, Solve};
use faer::{Mat, Side};

struct Factor {
    llt: Llt<f64>,
    targets: Mat<f64>,
}

fn factor(parameters: &Hyperparameters, data: &TrainingData) -> Option<Factor> {
    let b = parameters.coregionalisation();
    let inputs = data.inputs();
    let covariance = Mat::from_fn(inputs.len(), inputs.len(), |i, j| {
        let (p, q) = (&inputs[i], &inputs[j]);
        let noise = if i == j { parameters.observation_variance(p.task) / p.replicates as f64 } else { 0.0 };
        b[p.task][q.task] * correlation(p.stretch - q.stretch, parameters.lengthscale) + noise
    });
    let llt = covariance.llt(Side::Lower).ok()?;
    Some(Factor { llt, targets: Mat::from_fn(inputs.len(), 1, |i, _| inputs[i].mean) })
}

/// Negative log marginal likelihood; `None` when the covariance is not numerically positive.
pub fn dense_negative_log_likelihood(parameters: &Hyperparameters, data: &TrainingData) -> Option<f64> {
    let Factor { llt, targets } = factor(parameters, data)?;
    let weights = llt.solve(&targets);
    let two_pi = 2.0 * std::f64::consts::PI;
    let mut nlml = 0.0;
    for (i, input) in data.inputs().iter().enumerate() {
        let (count, variance) = (input.replicates as f64, parameters.observation_variance(input.task));
        nlml += 0.5 * targets[(i, 0)] * weights[(i, 0)] + llt.L()[(i, i)].ln() + 0.5 * two_pi.ln();
        nlml += 0.5 * (count - 1.0) * (two_pi * variance).ln() + 0.5 * count.ln();
        nlml += 0.5 * input.sum_of_squares / variance;
    }
    Some(nlml)
}

/// Posterior of one task with the covariance of its latent curve over the stretches; `None` as above.
pub fn dense_posterior(
    parameters: &Hyperparameters,
    data: &TrainingData,
    task: Task,
    stretches: &[f64],
) -> Option<(TissuePrior, Mat<f64>)> {
    let Factor { llt, targets } = factor(parameters, data)?;
    let b = parameters.coregionalisation();
    let (t, inputs) = (task.index(), data.inputs());
    let cross = Mat::from_fn(inputs.len(), stretches.len(), |i, j| {
        b[inputs[i].task][t] * correlation(inputs[i].stretch - stretches[j], parameters.lengthscale)
    });
    let mean = cross.transpose() * llt.solve(&targets);
    let explained = cross.transpose() * llt.solve(&cross);
    let covariance = Mat::from_fn(stretches.len(), stretches.len(), |i, j| {
        b[t][t] * correlation(stretches[i] - stretches[j], parameters.lengthscale) - explained[(i, j)]
    });
    let variance = |i: usize| covariance[(i, i)].max(0.0);
    let prior = TissuePrior {
        task,
        stretches: stretches.to_vec(),
        mean: (0..stretches.len()).map(|i| mean[(i, 0)]).collect(),
        latent_sd: (0..stretches.len()).map(|i| variance(i).sqrt()).collect(),
        observation_sd: (0..stretches.len())
            .map(|i| (variance(i) + parameters.observation_variance(t)).sqrt())
            .collect(),
    };
    Some((prior, covariance))
}

//! Joint draws of whole curves from the posterior of one task.
//!
//! The smoother gives, besides each variance, the covariance between any two stretches: the filtered covariance is
//! carried forward through the later predictions and updates. A pivoted Cholesky factor of it, as thin as its
//! numerical rank, turns standard normal numbers into curves (Higham, "Analysis of the Cholesky decomposition of a
//! semi-definite matrix", 1990).

use super::filter::Half;
use super::hyperparameters::Hyperparameters;
use super::matern::Transition;
use super::smoother::{Smoothed, TissuePrior, smooth};
use crate::material::random::CounterRng;
use crate::material::task::Task;
use crate::material::training::TrainingData;
use serde::{Deserialize, Serialize};

/// What a draw is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Spread {
    /// The tissue's underlying curve: the posterior's latent sd at every stretch.
    #[default]
    Tissue,
    /// What one more study would report of it. The Gaussian process calls the differences between studies noise and
    /// takes them as independent from point to point; but each study is one smooth curve. Here they are one number for
    /// the whole curve, a factor on W, of the same sd: the sd of an observation at every stretch.
    Study,
}

impl std::str::FromStr for Spread {
    type Err = String;
    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "tissue" => Ok(Self::Tissue),
            "study" => Ok(Self::Study),
            _ => Err("say tissue or study".to_owned()),
        }
    }
}

/// Posterior of one task's curve with the covariance between stretches.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPosterior {
    /// Mean and sds.
    pub prior: TissuePrior,
    /// Covariance of ln W between stretches in the order of the prior, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// Columns of L, covariance = L L^T.
    factor: Vec<Vec<f64>>,
    noise_sd: f64,
}

/// Joint posterior of one task at these stretches, in any order.
pub fn joint_posterior(
    parameters: &Hyperparameters,
    data: &TrainingData,
    task: Task,
    stretches: &[f64],
) -> JointPosterior {
    let smoothed = smooth(parameters, data, task, stretches);
    let noise = parameters.observation_variance(task.index());
    let prior = smoothed.prior(task, stretches, noise);
    let between_stops = covariances(&smoothed, parameters, data, task.index());
    let column = |stop: &usize| smoothed.passed[..*stop].iter().filter(|passed| passed.is_some()).count();
    let columns: Vec<usize> = smoothed.place.iter().map(column).collect();
    let covariance: Vec<Vec<f64>> =
        columns.iter().map(|i| columns.iter().map(|j| between_stops[*i][*j]).collect()).collect();
    let factor = pivoted_cholesky(&covariance);
    JointPosterior { prior, covariance, factor, noise_sd: noise.sqrt() }
}

/// Covariances of the task's curve between all stops that are queries.
fn covariances(smoothed: &Smoothed, parameters: &Hyperparameters, data: &TrainingData, task: usize) -> Vec<Vec<f64>> {
    let queries: Vec<usize> = (0..smoothed.stops.len()).filter(|stop| smoothed.passed[*stop].is_some()).collect();
    let mut covariance = vec![vec![0.0; queries.len()]; queries.len()];
    for (i, from) in queries.iter().enumerate() {
        let Some(start) = &smoothed.passed[*from] else { continue };
        covariance[i][i] = start.variance;
        let (mut f, mut g) = start.row;
        for j in i + 1..queries.len() {
            for stop in queries[j - 1] + 1..=queries[j] {
                carry(&mut f, &mut g, smoothed, stop, parameters, data);
            }
            if let Some(end) = &smoothed.passed[queries[j]] {
                let dot = |a: &Half, b: &Half| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
                covariance[i][j] = f[task] - dot(&f, &end.taken.0) - dot(&g, &end.taken.1);
                covariance[j][i] = covariance[i][j];
            }
        }
    }
    covariance
}

/// Carries a covariance with the state from the stop before through the prediction and the updates of this one.
fn carry(
    f: &mut Half,
    g: &mut Half,
    smoothed: &Smoothed,
    stop: usize,
    parameters: &Hyperparameters,
    data: &TrainingData,
) {
    let here = &smoothed.stops[stop];
    let [a, b, c, d] = Transition::over(here.stretch - smoothed.stops[stop - 1].stretch, parameters.lengthscale).a;
    for (f, g) in f.iter_mut().zip(g.iter_mut()) {
        (*f, *g) = (a * *f + b * *g, c * *f + d * *g);
    }
    for number in here.first_input..here.end_input {
        let (input, update) = (&data.inputs()[number], &smoothed.updates[number]);
        let along = f[input.task] / update.variance;
        let seen = f[input.task];
        for i in 0..f.len() {
            f[i] -= along * update.cov_f[i];
            g[i] -= along * update.cov_g[i];
        }
        // 1 - p / S cancels where noise is small; it is noise / S exactly.
        let noise = parameters.observation_variance(input.task) / input.replicates as f64;
        f[input.task] = seen * (noise / update.variance);
    }
}

/// Columns of L with L L^T = the matrix, largest remaining variance first, until what remains is rounding.
fn pivoted_cholesky(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = matrix.len();
    let mut left: Vec<f64> = (0..n).map(|i| matrix[i][i]).collect();
    let threshold = 1e-13 * left.iter().fold(0.0, |m: f64, v| m.max(*v));
    let mut columns: Vec<Vec<f64>> = Vec::new();
    while columns.len() < n {
        let pivot = (0..n).fold(0, |best, i| if left[i] > left[best] { i } else { best });
        if left[pivot] <= threshold {
            break;
        }
        let root = left[pivot].sqrt();
        let explained = |i: usize| columns.iter().map(|c| c[i] * c[pivot]).sum::<f64>();
        let mut column: Vec<f64> = (0..n).map(|i| (matrix[i][pivot] - explained(i)) / root).collect();
        column[pivot] = root;
        for (left, entry) in left.iter_mut().zip(&column) {
            *left -= entry * entry;
        }
        left[pivot] = 0.0;
        columns.push(column);
    }
    columns
}

impl JointPosterior {
    /// Draw `number` of a seed: ln(W + offset) at the prior's stretches.
    pub fn draw(&self, seed: u64, number: u64, spread: Spread) -> Vec<f64> {
        let rng = CounterRng::new(seed, number);
        let shift = match spread {
            Spread::Tissue => 0.0,
            Spread::Study => self.noise_sd * rng.normal(u64::from(u32::MAX)),
        };
        let mut curve: Vec<f64> = self.prior.mean.iter().map(|mean| mean + shift).collect();
        for (number, column) in self.factor.iter().enumerate() {
            let normal = rng.normal(number as u64);
            for (value, entry) in curve.iter_mut().zip(column) {
                *value += entry * normal;
            }
        }
        curve
    }

    /// The sd that draws have at each stretch.
    pub fn sd(&self, spread: Spread) -> &[f64] {
        match spread {
            Spread::Tissue => &self.prior.latent_sd,
            Spread::Study => &self.prior.observation_sd,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::gp::dense_posterior;
    use crate::material::literature::{Curves, table};
    use crate::material::task::stretches;

    fn data() -> TrainingData {
        TrainingData::from_literature(&table(), Curves::Published)
    }

    #[test]
    fn covariance_between_stretches_is_that_of_the_dense_oracle() {
        let parameters = Hyperparameters { noise_floor: 1e-2, ..Hyperparameters::published() };
        let mut queries = stretches(0.87, 1.13, 14);
        queries.reverse();
        queries.push(1.0);
        for task in [Task::HYPERELASTIC_GREY, Task::HYPERELASTIC_HEALTHY] {
            let joint = joint_posterior(&parameters, &data(), task, &queries);
            let (_, dense) = dense_posterior(&parameters, &data(), task, &queries).unwrap();
            for i in 0..queries.len() {
                for j in 0..queries.len() {
                    let error = (joint.covariance[i][j] - dense[(i, j)]).abs();
                    assert!(error < 1e-7 * dense[(i, i)].max(dense[(j, j)]).max(1e-3), "{task} {i} {j}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn the_factor_gives_the_covariance_back() {
        let grid = stretches(0.9, 1.1, 101);
        let joint = joint_posterior(&Hyperparameters::published(), &data(), Task::HYPERELASTIC_WHITE, &grid);
        for i in 0..grid.len() {
            for j in 0..grid.len() {
                let product: f64 = joint.factor.iter().map(|c| c[i] * c[j]).sum();
                assert!((product - joint.covariance[i][j]).abs() < 1e-11, "{i} {j}");
            }
        }
    }

    #[test]
    fn ten_thousand_draws_have_the_posteriors_mean_sd_and_covariance_within_monte_carlo_error() {
        let grid = stretches(0.9, 1.1, 101);
        let joint = joint_posterior(&Hyperparameters::published(), &data(), Task::HYPERELASTIC_GREY, &grid);
        for spread in [Spread::Tissue, Spread::Study] {
            let n = 10_000;
            let draws: Vec<Vec<f64>> = (0..n).map(|number| joint.draw(3, number, spread)).collect();
            let n = n as f64;
            let mean = |i: usize| draws.iter().map(|d| d[i]).sum::<f64>() / n;
            let product = |i: usize, j: usize, (mi, mj): (f64, f64)| {
                draws.iter().map(|d| (d[i] - mi) * (d[j] - mj)).sum::<f64>() / (n - 1.0)
            };
            for i in 0..grid.len() {
                let (m, sd) = (mean(i), joint.sd(spread)[i]);
                // Four standard errors: of a mean sd / sqrt(n), of a standard deviation sd / sqrt(2 n).
                assert!((m - joint.prior.mean[i]).abs() < 4.0 * sd / n.sqrt(), "{spread:?} mean at {}", grid[i]);
                let found = product(i, i, (m, m)).sqrt();
                assert!((found - sd).abs() < 4.0 * sd / (2.0 * n).sqrt(), "{spread:?} sd at {}", grid[i]);
            }
            let noise = if spread == Spread::Study { joint.noise_sd * joint.noise_sd } else { 0.0 };
            for (i, j) in [(0, 100), (20, 40), (49, 51)] {
                let scale = joint.sd(spread)[i] * joint.sd(spread)[j];
                let error = product(i, j, (mean(i), mean(j))) - joint.covariance[i][j] - noise;
                assert!(error.abs() < 4.0 * scale * (2.0 / n).sqrt(), "{spread:?} {i} {j}");
            }
        }
    }

    #[test]
    fn a_draw_depends_on_seed_and_number_only() {
        let joint =
            joint_posterior(&Hyperparameters::published(), &data(), Task::HYPERELASTIC_GREY, &[0.95, 1.0, 1.05]);
        assert_eq!(joint.draw(1, 5, Spread::Tissue), joint.draw(1, 5, Spread::Tissue));
        assert_ne!(joint.draw(1, 5, Spread::Tissue), joint.draw(1, 6, Spread::Tissue));
        assert_ne!(joint.draw(1, 5, Spread::Tissue), joint.draw(2, 5, Spread::Tissue));
    }
}

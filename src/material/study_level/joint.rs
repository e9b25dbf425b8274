//! Several tissues of one person, or one laboratory's curves of several tissues: they go together.

use super::basis::{Basis, SIZE};
use super::evidence::MeanPosterior;
use super::predict::Of;
use super::spreads::{NUGGET, Part, Spreads};
use super::study::Coefficients;
use crate::material::random::CounterRng;
use crate::material::task::{Task, stretches};
use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector};

/// Joint prediction of whole functions ln g(l) of several tasks, each over its window.
#[derive(Clone, Debug)]
pub struct JointPrediction {
    /// The tasks.
    pub tasks: Vec<Task>,
    /// Stretches of each.
    pub stretches: Vec<Vec<f64>>,
    coefficients: DVector<f64>,
    /// L of the coefficients' covariance L L^T.
    factor: DMatrix<f64>,
    nugget: f64,
}

/// Predicts these tasks together: a publication's part is the same in all of them, scaled as each task has it (abnormal tissue
/// and linear tests have spreads of their own); a curve's part is a tissue's own. Each task alone is as [`super::predict`] has it.
pub fn predict_jointly(
    means: &MeanPosterior,
    spreads: &Spreads,
    tasks: &[Task],
    of: Of,
    points: usize,
) -> JointPrediction {
    let n = tasks.len() * SIZE;
    let mut coefficients = DVector::zeros(n);
    let mut covariance = DMatrix::zeros(n, n);
    let shared: Vec<[f64; SIZE]> = tasks.iter().map(|task| spreads.deviations(Part::Publication, *task).0).collect();
    for (i, one) in tasks.iter().enumerate() {
        coefficients.rows_mut(i * SIZE, SIZE).copy_from(&means.of(*one).0);
        for (j, other) in tasks.iter().enumerate() {
            covariance.view_mut((i * SIZE, j * SIZE), (SIZE, SIZE)).copy_from(&means.between(*one, *other));
            if of.parts().contains(&Part::Publication) {
                (0..SIZE).for_each(|f| covariance[(i * SIZE + f, j * SIZE + f)] += shared[i][f] * shared[j][f]);
            }
        }
        if of.parts().contains(&Part::Curve) {
            let (own, _) = spreads.deviations(Part::Curve, *one);
            (0..SIZE).for_each(|f| covariance[(i * SIZE + f, i * SIZE + f)] += own[f] * own[f]);
        }
    }
    let window = |task: &Task| {
        let [low, high] = task.stretch_window();
        stretches(low, high, points)
    };
    JointPrediction {
        tasks: tasks.to_vec(),
        stretches: tasks.iter().map(window).collect(),
        coefficients,
        factor: lower_triangle(&covariance),
        nugget: if of == Of::Study { NUGGET } else { 0.0 },
    }
}

/// Cholesky factor of a covariance that may be singular: rounding's worth is added to the diagonal.
fn lower_triangle(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let n = covariance.nrows();
    let mut added = 1e-14 * covariance.diagonal().max();
    loop {
        if let Some(factor) = Cholesky::new(covariance + DMatrix::identity(n, n) * added) {
            return factor.l();
        }
        added *= 10.0;
    }
}

impl JointPrediction {
    /// Draw `number` of a seed: ln g of each task at its stretches, whole functions.
    pub fn draw(&self, seed: u64, number: u64) -> Vec<Vec<f64>> {
        let rng = CounterRng::new(seed, number);
        let size = self.coefficients.len();
        let normal = DVector::from_fn(size, |n, _| rng.normal(n as u64));
        let coefficients = &self.coefficients + &self.factor * normal;
        let mut counter = size as u64;
        let mut value = |task: usize, stretch: &f64| {
            counter += 1;
            let rough = if self.nugget > 0.0 { self.nugget * rng.normal(counter) } else { 0.0 };
            let own: Coefficients = coefficients.fixed_rows::<SIZE>(task * SIZE).into_owned();
            Coefficients::from(Basis.at(stretch.ln())).dot(&own) + rough
        };
        let curves = self.stretches.iter().enumerate();
        curves.map(|(task, stretches)| stretches.iter().map(|l| value(task, l)).collect()).collect()
    }
}

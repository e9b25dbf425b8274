//! A literature drawn from the model itself: the same publications, tasks and points, other curves.

use super::basis::{Basis, LEVEL, SIZE};
use super::evidence::leading_task;
use super::spreads::{LEVEL_MEAN, NUGGET, Part, Spreads};
use super::study::{Coefficients, Studies, StudyCurve};
use crate::material::random::CounterRng;
use crate::material::task::TASKS;
use nalgebra::SMatrix;
use nalgebra::linalg::Cholesky;

/// Draws the curves of a literature of this design under these spreads. A seed gives one literature.
pub fn simulate(design: &Studies, spreads: &Spreads, seed: u64) -> Studies {
    let means = task_means(spreads, CounterRng::new(seed, 0));
    let mut drawn = design.clone();
    for (number, (_, curves)) in drawn.publications.iter_mut().enumerate() {
        let rng = CounterRng::new(seed, 1 + 2 * number as u64);
        let (deviations, _) = spreads.deviations(Part::Publication, leading_task(curves));
        let shared = Coefficients::from_fn(|f, _| deviations[f] * rng.normal(f as u64));
        let rng = CounterRng::new(seed, 2 + 2 * number as u64);
        let mut counter = 0;
        let mut normal = || {
            counter += 1;
            rng.normal(counter)
        };
        for curve in curves.iter_mut() {
            let (deviations, _) = spreads.deviations(Part::Curve, curve.task);
            let own = Coefficients::from_fn(|f, _| deviations[f] * normal());
            let coefficients = means[curve.task.index()] + shared + own;
            let values = curve.strains.iter().map(|x| Coefficients::from(Basis.at(*x)).dot(&coefficients));
            let log_moduli = values.map(|value| value + NUGGET * normal()).collect();
            *curve = StudyCurve::new(curve.id, curve.task, curve.strains.clone(), log_moduli);
        }
    }
    drawn
}

/// Coefficients of the tasks' means, drawn from their prior.
fn task_means(spreads: &Spreads, rng: CounterRng) -> Vec<Coefficients> {
    let mut means = vec![Coefficients::zeros(); TASKS];
    for f in 0..SIZE {
        let covariance = spreads.mean_covariance(f);
        let covariance = SMatrix::<f64, TASKS, TASKS>::from_fn(|i, j| covariance[i][j]);
        let lower = Cholesky::new(covariance).map_or_else(SMatrix::zeros, |factor| factor.l());
        let normal = SMatrix::<f64, TASKS, 1>::from_fn(|t, _| rng.normal((f * TASKS + t) as u64));
        let centre = if f == LEVEL { LEVEL_MEAN } else { 0.0 };
        let values = lower * normal;
        for (t, scale) in spreads.task_scales(f).iter().enumerate() {
            means[t][f] = centre + scale * values[t];
        }
    }
    means
}

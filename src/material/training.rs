//! Training data of the Gaussian process: y = ln(W + offset) of every study's curve, collapsed onto unique inputs.

use super::literature::{Curves, LiteratureModel};
use super::task::TASKS;

/// Added to W before the logarithm in the published Gaussian process, Pa: W is zero at rest.
pub const GP_LOG_OFFSET_PA: f64 = 1e-4;

/// All observations of one task at one stretch. Replicates share the latent value, so that a likelihood needs only
/// their number, mean and sum of squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Stretch.
    pub stretch: f64,
    /// Index of the task.
    pub task: usize,
    /// Number of observations.
    pub replicates: usize,
    /// Their mean, ln Pa.
    pub mean: f64,
    /// Sum of squares about the mean.
    pub sum_of_squares: f64,
}

/// Collapsed training data, sorted by stretch, then task.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingData {
    inputs: Vec<Input>,
    knots: Vec<Knot>,
}

/// One stretch and the inputs observed there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knot {
    pub(super) stretch: f64,
    pub(super) first_input: usize,
    pub(super) end_input: usize,
}

impl TrainingData {
    /// From observations (stretch, task index below 12, y = ln(W + offset)), in any order.
    ///
    /// # Panics
    /// When a stretch or a value is not a number, or a task index is not below 12: the curves this is made from are
    /// checked when their table is read.
    pub fn from_observations(mut observations: Vec<(f64, usize, f64)>) -> Self {
        assert!(observations.iter().all(|(l, t, y)| l.is_finite() && y.is_finite() && *t < TASKS));
        // A stable sort: replicates keep the order of the studies, so that sums are the same everywhere.
        observations.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut inputs: Vec<Input> = Vec::new();
        let same = |a: &(f64, usize, f64), b: &(f64, usize, f64)| a.0 == b.0 && a.1 == b.1;
        for group in observations.chunk_by(same) {
            let count = group.len() as f64;
            let mean = group.iter().map(|(_, _, y)| y).sum::<f64>() / count;
            let sum_of_squares = group.iter().map(|(_, _, y)| (y - mean).powi(2)).sum();
            let (stretch, task, _) = group[0];
            inputs.push(Input { stretch, task, replicates: group.len(), mean, sum_of_squares });
        }
        let mut knots = Vec::new();
        let mut first_input = 0;
        for group in inputs.chunk_by(|a, b| a.stretch == b.stretch) {
            let end_input = first_input + group.len();
            knots.push(Knot { stretch: group[0].stretch, first_input, end_input });
            first_input = end_input;
        }
        Self { inputs, knots }
    }

    /// From the curves of literature models, with the published offset.
    pub fn from_literature(models: &[LiteratureModel], curves: Curves) -> Self {
        let mut observations = Vec::new();
        for curve in models.iter().map(|model| model.curve(curves)) {
            let points = curve.stretches.iter().zip(&curve.energies_pa);
            observations.extend(points.map(|(l, w)| (*l, curve.task.index(), (w.max(0.0) + GP_LOG_OFFSET_PA).ln())));
        }
        Self::from_observations(observations)
    }

    /// The unique inputs, sorted by stretch, then task.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    pub(super) fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// Number of observations before collapsing.
    pub fn observations(&self) -> usize {
        self.inputs.iter().map(|input| input.replicates).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::literature::table;

    #[test]
    fn literature_collapses_to_the_published_counts() {
        let data = TrainingData::from_literature(&table(), Curves::Published);
        assert_eq!((data.observations(), data.inputs().len(), data.knots().len()), (7300, 1498, 665));
        let grey = data.inputs().iter().filter(|i| i.task == 8);
        assert_eq!(grey.clone().count(), 99);
        // Ten studies, each twice at rest, all with W = 0.
        let rest = grey.clone().find(|i| i.stretch == 1.0).unwrap();
        assert_eq!(rest.replicates, 20);
        assert!((rest.mean - 1e-4_f64.ln()).abs() < 1e-9);
    }

    #[test]
    fn collapsing_keeps_count_mean_and_spread() {
        let data = TrainingData::from_observations(vec![(1.1, 3, 2.0), (0.9, 3, 5.0), (1.1, 3, 4.0), (1.1, 2, 7.0)]);
        let inputs = data.inputs();
        assert_eq!(inputs.iter().map(|i| (i.stretch, i.task)).collect::<Vec<_>>(), [(0.9, 3), (1.1, 2), (1.1, 3)]);
        assert_eq!((inputs[2].replicates, inputs[2].mean, inputs[2].sum_of_squares), (2, 3.0, 2.0));
    }
}

//! What the model expects: a task's mean, the next study of it, the next person.

use super::basis::{Basis, SIZE};
use super::evidence::MeanPosterior;
use super::spreads::{NUGGET, Part, Spreads};
use super::study::{Coefficients, Square};
use crate::material::form::first_uniaxial;
use crate::material::random::CounterRng;
use crate::material::task::Task;
use nalgebra::linalg::Cholesky;
use serde::{Deserialize, Serialize};

/// What is predicted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Of {
    /// The mean function of the task.
    Mean,
    /// What one laboratory finds on average: the spread between studies without that within one.
    Laboratory,
    /// A curve that another laboratory publishes.
    Study,
    /// The tissue of a person nobody has measured. Which laboratory is right is not known, and within one laboratory curves
    /// differ by person and place: both spreads belong to it, the nugget does not.
    #[default]
    Person,
}

/// Prediction of whole functions ln g(l) of one task.
#[derive(Clone, Debug)]
pub struct StudyLevelPrior {
    /// What is predicted.
    pub task: Task,
    /// Stretches, in any order.
    pub stretches: Vec<f64>,
    /// Mean of ln g, ln Pa.
    pub mean: Vec<f64>,
    /// Sd at each stretch.
    pub sd: Vec<f64>,
    coefficients: Coefficients,
    /// Lower triangle L of the coefficients' covariance.
    factor: Square,
    nugget: f64,
}

/// Predicts a task at these stretches.
pub fn predict(means: &MeanPosterior, spreads: &Spreads, task: Task, of: Of, stretches: &[f64]) -> StudyLevelPrior {
    let (coefficients, mut covariance) = means.of(task);
    for part in of.parts() {
        let (deviations, _) = spreads.deviations(*part, task);
        for (f, sd) in deviations.iter().enumerate() {
            covariance[(f, f)] += sd * sd;
        }
    }
    let nugget = if of == Of::Study { NUGGET } else { 0.0 };
    let row = |l: &f64| Coefficients::from(Basis.at(l.ln()));
    let sd = |l: &f64| (row(l).dot(&(covariance * row(l))).max(0.0) + nugget * nugget).sqrt();
    StudyLevelPrior {
        task,
        stretches: stretches.to_vec(),
        mean: stretches.iter().map(|l| row(l).dot(&coefficients)).collect(),
        sd: stretches.iter().map(sd).collect(),
        coefficients,
        factor: lower_triangle(&covariance),
        nugget,
    }
}

/// Cholesky factor of a covariance that may be singular: rounding's worth is added to the diagonal.
fn lower_triangle(covariance: &Square) -> Square {
    let most = covariance.diagonal().max();
    let mut added = 1e-14 * most;
    loop {
        if let Some(factor) = Cholesky::new(covariance + Square::identity() * added) {
            return factor.l();
        }
        added *= 10.0;
    }
}

impl Of {
    /// All, in the order of what they hold.
    pub const ALL: [Self; 4] = [Self::Mean, Self::Laboratory, Self::Person, Self::Study];

    /// The random parts that belong to it.
    pub(super) fn parts(self) -> &'static [Part] {
        match self {
            Self::Mean => &[],
            Self::Laboratory => &[Part::Publication],
            Self::Study | Self::Person => &[Part::Publication, Part::Curve],
        }
    }

    /// The word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Laboratory => "laboratory",
            Self::Study => "study",
            Self::Person => "person",
        }
    }
}

impl std::str::FromStr for Of {
    type Err = String;
    fn from_str(word: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|of| of.name() == word)
            .ok_or_else(|| "say mean, laboratory, person or study".to_owned())
    }
}

impl StudyLevelPrior {
    /// Draw `number` of a seed: ln g at the stretches, one whole function.
    pub fn draw(&self, seed: u64, number: u64) -> Vec<f64> {
        let rng = CounterRng::new(seed, number);
        let normal = Coefficients::from_fn(|f, _| rng.normal(f as u64));
        let coefficients = self.coefficients + self.factor * normal;
        let point = |(n, l): (usize, &f64)| {
            let rough = if self.nugget > 0.0 { self.nugget * rng.normal((SIZE + n) as u64) } else { 0.0 };
            Coefficients::from(Basis.at(l.ln())).dot(&coefficients) + rough
        };
        self.stretches.iter().enumerate().map(point).collect()
    }

    /// Mean and this many standard deviations of ln g.
    pub fn quantile(&self, sd_level: f64) -> Vec<f64> {
        self.mean.iter().zip(&self.sd).map(|(mean, sd)| mean + sd_level * sd).collect()
    }
}

/// ln g as meta-models take it: ln(W + offset), W = g (I1 - 3) / 2, Pa.
pub fn log_energies(stretches: &[f64], log_moduli: &[f64], offset_pa: f64) -> Vec<f64> {
    let energy = |(l, y): (&f64, &f64)| (0.5 * y.exp() * first_uniaxial(*l) + offset_pa).ln();
    stretches.iter().zip(log_moduli).map(energy).collect()
}

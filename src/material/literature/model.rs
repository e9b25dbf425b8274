//! One published model: its form in its window, and the curve of training data it gives.

use crate::material::form::Form;
use crate::material::task::{Task, stretches};
use serde::{Deserialize, Serialize};

/// Which curve stands for the two studies that the published program coded differently from their papers (Laksari et
/// al. 2012, Miller and Chinzei 2002).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curves {
    /// As the papers have it.
    #[default]
    Corrected,
    /// As the published program coded it.
    Published,
}

/// Parameters for all stretches, or apart for compression (l <= 1) and tension (l >= 1).
#[derive(Clone, Debug, PartialEq)]
pub enum Branches {
    /// One set.
    One(Form),
    /// Two sets that meet at rest; stretch 1 stands in both halves of the grid.
    Split {
        /// l <= 1.
        compression: Form,
        /// l >= 1.
        tension: Form,
    },
}

/// One published model.
#[derive(Clone, Debug, PartialEq)]
pub struct LiteratureModel {
    /// Number in the table.
    pub id: u32,
    /// What it is, in words.
    pub study: String,
    /// Key into the citations, or the citation itself for a user's study.
    pub citation: String,
    /// Kind and region.
    pub task: Task,
    /// Form and parameters.
    pub branches: Branches,
    /// What the published program used, where it differs.
    pub published: Option<Branches>,
    /// Trusted stretches. Curves do not leave them; a simulation in which a body does is told of it.
    pub stretch_window: [f64; 2],
    /// Points of the grid: one number, or one for each half.
    pub points: Points,
    /// How sure the citation is: confident, likely or unsure.
    pub confidence: String,
    /// Anything a user should know.
    pub note: String,
}

/// How a curve is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Points {
    /// Equally spaced over the window.
    Whole(usize),
    /// Equally spaced over each half; stretch 1 twice.
    Halves(usize, usize),
}

/// A curve of training data: stretches and strain energy density in Pa.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Task.
    pub task: Task,
    /// Stretches.
    pub stretches: Vec<f64>,
    /// W, Pa.
    pub energies_pa: Vec<f64>,
}

impl LiteratureModel {
    fn chosen(&self, curves: Curves) -> &Branches {
        match (curves, &self.published) {
            (Curves::Published, Some(published)) => published,
            _ => &self.branches,
        }
    }

    /// The curve on the table's grid.
    pub fn curve(&self, curves: Curves) -> Curve {
        let [low, high] = self.stretch_window;
        let branches = self.chosen(curves);
        let (stretches, halves) = match self.points {
            Points::Whole(count) => (stretches(low, high, count), None),
            Points::Halves(below, above) => {
                let mut all = stretches(low, 1.0, below);
                all.extend(stretches(1.0, high, above));
                (all, Some(below))
            }
        };
        let energy = |(index, stretch): (usize, &f64)| match branches {
            Branches::One(form) => form.uniaxial_energy_pa(*stretch),
            Branches::Split { compression, tension } => {
                let compressed = halves.map_or(*stretch <= 1.0, |below| index < below);
                (if compressed { compression } else { tension }).uniaxial_energy_pa(*stretch)
            }
        };
        let energies_pa = stretches.iter().enumerate().map(energy).collect();
        Curve { task: self.task, stretches, energies_pa }
    }

    /// W at one stretch, Pa; not a number outside the window.
    pub fn energy_pa(&self, curves: Curves, stretch: f64) -> f64 {
        if stretch < self.stretch_window[0] || stretch > self.stretch_window[1] {
            return f64::NAN;
        }
        match self.chosen(curves) {
            Branches::One(form) => form.uniaxial_energy_pa(stretch),
            Branches::Split { compression, tension } => {
                (if stretch <= 1.0 { compression } else { tension }).uniaxial_energy_pa(stretch)
            }
        }
    }
}

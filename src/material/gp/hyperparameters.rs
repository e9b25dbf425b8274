//! Hyperparameters of the multi-task Gaussian process, saved and loaded as TOML.

use crate::material::task::{TASKS, Task};
use crate::material::toml_text::line_of;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A matrix over the tasks.
pub type TaskMatrix = [[f64; TASKS]; TASKS];

/// Covariance of tasks t, t' at stretches l, l': B_tt' (1 + u) e^-u with u = sqrt(3) |l - l'| / lengthscale (Matern 3/2)
/// and B = sum_r w_r w_r^T + diag(kappa) (intrinsic coregionalisation: Bonilla, Chai and Williams, NIPS 2007). An
/// observation adds noise of its task's variance plus the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Hyperparameters {
    /// Lengthscale in stretch.
    pub lengthscale: f64,
    /// w_r, ln Pa; as many as the rank, at least one.
    pub weights: Vec<[f64; TASKS]>,
    /// kappa, (ln Pa)^2, zero or more.
    pub kappa: [f64; TASKS],
    /// Noise variance of each task, (ln Pa)^2, zero or more.
    pub noise_variance: [f64; TASKS],
    /// Added to every noise variance; positive.
    pub noise_floor: f64,
}

/// A TOML text that holds no hyperparameters.
#[derive(Debug, Error)]
pub enum HyperparametersError {
    /// Not TOML, or not these fields.
    #[error("line {line}: {message}; `hgm gp fit` writes such a file")]
    Toml {
        /// Line in the text.
        line: usize,
        /// What is wrong there.
        message: String,
    },
    /// Tasks missing, repeated or unknown.
    #[error("task `{0}` is missing, unknown or stands twice: give each of the twelve tasks one table")]
    Tasks(String),
    /// Ranks that differ.
    #[error(
        "task `{task}` has {found} weights and the first task {expected}: every task needs the same number (the rank), \
         1 or more"
    )]
    Rank {
        /// The task.
        task: String,
        /// Its weights.
        found: usize,
        /// Those of the first task.
        expected: usize,
    },
    /// A number that cannot be.
    #[error("`{field}` is {value}; it must be {rule}")]
    Range {
        /// Field.
        field: String,
        /// Value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    lengthscale: f64,
    noise_floor: f64,
    tasks: Vec<TaskTable>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TaskTable {
    name: String,
    weights: Vec<f64>,
    kappa: f64,
    noise_variance: f64,
}

impl Hyperparameters {
    /// The published fit: rank 1, with 1e-8 on the diagonal.
    ///
    /// # Panics
    /// Never: the embedded file is read by a test.
    pub fn published() -> Self {
        Self::from_toml(include_str!("published.toml")).expect("the embedded file is well formed")
    }

    /// Number of weight vectors.
    pub fn rank(&self) -> usize {
        self.weights.len()
    }

    /// B, the covariance of the tasks at one stretch.
    pub fn coregionalisation(&self) -> TaskMatrix {
        let mut b: TaskMatrix =
            std::array::from_fn(|i| std::array::from_fn(|j| self.weights.iter().map(|w| w[i] * w[j]).sum()));
        for (task, kappa) in self.kappa.iter().enumerate() {
            b[task][task] += kappa;
        }
        b
    }

    /// Noise variance of one observation of a task, floor included.
    pub fn observation_variance(&self, task: usize) -> f64 {
        self.noise_variance[task] + self.noise_floor
    }

    /// Reads what [`Hyperparameters::to_toml`] wrote.
    ///
    /// # Errors
    /// [`HyperparametersError`] names the field.
    pub fn from_toml(text: &str) -> Result<Self, HyperparametersError> {
        let file: File = toml::from_str(text).map_err(|error| {
            let line = line_of(&error, text);
            HyperparametersError::Toml { line, message: error.message().to_owned() }
        })?;
        let rank = file.tasks.first().map_or(0, |task| task.weights.len());
        let mut this = Self {
            lengthscale: file.lengthscale,
            weights: vec![[0.0; TASKS]; rank],
            kappa: [0.0; TASKS],
            noise_variance: [0.0; TASKS],
            noise_floor: file.noise_floor,
        };
        let mut seen = [false; TASKS];
        for table in file.tasks {
            let task = table.name.parse::<Task>().map_err(|_| HyperparametersError::Tasks(table.name.clone()))?.index();
            if std::mem::replace(&mut seen[task], true) {
                return Err(HyperparametersError::Tasks(table.name));
            }
            if table.weights.len() != rank || rank == 0 {
                let found = table.weights.len();
                return Err(HyperparametersError::Rank { task: table.name, found, expected: rank.max(1) });
            }
            for (row, weight) in this.weights.iter_mut().zip(table.weights) {
                row[task] = check("weights", weight, "a finite number", weight.is_finite())?;
            }
            let not_negative = |v: f64| v.is_finite() && v >= 0.0;
            this.kappa[task] = check("kappa", table.kappa, "zero or more", not_negative(table.kappa))?;
            let noise = table.noise_variance;
            this.noise_variance[task] = check("noise_variance", noise, "zero or more", not_negative(noise))?;
        }
        if let Some(missing) = Task::all().find(|task| !seen[task.index()]) {
            return Err(HyperparametersError::Tasks(missing.to_string()));
        }
        let positive = |v: f64| v.is_finite() && v > 0.0;
        check("lengthscale", this.lengthscale, "positive", positive(this.lengthscale))?;
        check("noise_floor", this.noise_floor, "positive", positive(this.noise_floor))?;
        Ok(this)
    }

    /// A text that reads back to the same bits.
    pub fn to_toml(&self) -> String {
        let tasks = Task::all().map(|task| TaskTable {
            name: task.to_string(),
            weights: self.weights.iter().map(|w| w[task.index()]).collect(),
            kappa: self.kappa[task.index()],
            noise_variance: self.noise_variance[task.index()],
        });
        let file = File { lengthscale: self.lengthscale, noise_floor: self.noise_floor, tasks: tasks.collect() };
        toml::to_string(&file).unwrap_or_default()
    }
}

fn check(field: &str, value: f64, rule: &'static str, holds: bool) -> Result<f64, HyperparametersError> {
    if holds { Ok(value) } else { Err(HyperparametersError::Range { field: field.to_owned(), value, rule }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn toml_reads_back_to_the_same_hyperparameters() {
        let mut parameters = Hyperparameters::published();
        assert_eq!(Hyperparameters::from_toml(&parameters.to_toml()).unwrap(), parameters);
        parameters.weights.push([0.1; TASKS]);
        parameters.kappa[3] = 1.0 / 3.0;
        assert_eq!(Hyperparameters::from_toml(&parameters.to_toml()).unwrap(), parameters);
    }

    #[test]
    fn hyperparameters_that_cannot_be_are_refused() {
        let good = Hyperparameters::published().to_toml();
        let refused = |from: &str, to: &str| {
            assert!(good.contains(from), "{from}");
            Hyperparameters::from_toml(&good.replacen(from, to, 1)).unwrap_err().to_string()
        };
        assert!(refused("lengthscale = 0.1", "lengthscale = -0.1").contains("lengthscale"));
        assert!(refused("mre-grey", "mre-blue").contains("mre-blue"));
        assert!(refused("mre-white", "mre-grey").contains("mre-grey"));
        assert!(refused("weights = [135.62322426953898]", "weights = []").contains("rank"));
        let message = refused("noise_floor", "noise_flor");
        assert!(message.starts_with("line 2: ") && message.contains("noise_flor"), "{message}");
    }
}

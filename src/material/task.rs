//! The twelve tasks of the generative model: three kinds of study times four regions of the brain.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How many tasks there are.
pub const TASKS: usize = 12;

/// How a study found its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StudyKind {
    /// Magnetic resonance elastography.
    Mre,
    /// Linear elasticity, mostly tuned in simulations.
    Linear,
    /// Hyperelastic law fitted to mechanical tests.
    Hyperelastic,
}

/// Which tissue a study speaks of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Region {
    /// Grey matter.
    Grey,
    /// White matter.
    White,
    /// Healthy brain as a whole.
    Healthy,
    /// Tumour, ventricle and other tissue that is not healthy brain.
    Abnormal,
}

/// One output of the multi-task Gaussian process; its index is 4 kind + region.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Task {
    /// Kind of study.
    pub kind: StudyKind,
    /// Region of the brain.
    pub region: Region,
}

/// A word that names no task, kind or region.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TaskError {
    /// Not a kind.
    #[error("study kind `{0}` is unknown: say mre, linear or hyperelastic")]
    Kind(String),
    /// Not a region.
    #[error("region `{0}` is unknown: say grey, white, healthy or abnormal")]
    Region(String),
    /// Not KIND-REGION.
    #[error("task `{0}` is not written KIND-REGION: say for example hyperelastic-healthy")]
    Form(String),
}

impl StudyKind {
    /// All kinds in index order.
    pub const ALL: [Self; 3] = [Self::Mre, Self::Linear, Self::Hyperelastic];

    /// The word in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mre => "mre",
            Self::Linear => "linear",
            Self::Hyperelastic => "hyperelastic",
        }
    }
}

impl Region {
    /// All regions in index order.
    pub const ALL: [Self; 4] = [Self::Grey, Self::White, Self::Healthy, Self::Abnormal];

    /// The word in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grey => "grey",
            Self::White => "white",
            Self::Healthy => "healthy",
            Self::Abnormal => "abnormal",
        }
    }
}

impl std::str::FromStr for StudyKind {
    type Err = TaskError;
    fn from_str(word: &str) -> Result<Self, TaskError> {
        Self::ALL.into_iter().find(|k| k.name() == word).ok_or_else(|| TaskError::Kind(word.to_owned()))
    }
}

impl std::str::FromStr for Region {
    type Err = TaskError;
    fn from_str(word: &str) -> Result<Self, TaskError> {
        Self::ALL.into_iter().find(|r| r.name() == word).ok_or_else(|| TaskError::Region(word.to_owned()))
    }
}

impl Task {
    /// Grey matter, hyperelastic studies.
    pub const HYPERELASTIC_GREY: Self = Self { kind: StudyKind::Hyperelastic, region: Region::Grey };
    /// White matter, hyperelastic studies.
    pub const HYPERELASTIC_WHITE: Self = Self { kind: StudyKind::Hyperelastic, region: Region::White };
    /// Healthy brain, hyperelastic studies.
    pub const HYPERELASTIC_HEALTHY: Self = Self { kind: StudyKind::Hyperelastic, region: Region::Healthy };

    /// All tasks in index order.
    pub fn all() -> impl Iterator<Item = Self> {
        StudyKind::ALL.into_iter().flat_map(|kind| Region::ALL.into_iter().map(move |region| Self { kind, region }))
    }

    /// 4 kind + region, in 0..12.
    pub fn index(self) -> usize {
        4 * self.kind as usize + self.region as usize
    }

    /// The stretches over which the published program samples this task.
    pub fn stretch_window(self) -> [f64; 2] {
        match (self.kind, self.region) {
            (StudyKind::Mre, _) => [0.95, 1.05],
            (StudyKind::Hyperelastic, Region::Healthy) => [0.6, 1.4],
            (StudyKind::Hyperelastic, Region::Abnormal) => [0.8, 1.2],
            (StudyKind::Linear | StudyKind::Hyperelastic, _) => [0.9, 1.1],
        }
    }
}

impl std::fmt::Display for Task {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}-{}", self.kind.name(), self.region.name())
    }
}

impl std::str::FromStr for Task {
    type Err = TaskError;
    fn from_str(words: &str) -> Result<Self, TaskError> {
        let (kind, region) = words.split_once('-').ok_or_else(|| TaskError::Form(words.to_owned()))?;
        Ok(Self { kind: kind.parse()?, region: region.parse()? })
    }
}

/// `count` stretches from `low` to `high`, both included, equally spaced.
pub fn stretches(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = (high - low) / (count.max(2) - 1) as f64;
    (0..count).map(|i| if i + 1 == count && count > 1 { high } else { low + i as f64 * step }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_follows_the_order_of_all_tasks_and_names_read_back() {
        for (index, task) in Task::all().enumerate() {
            assert_eq!(task.index(), index);
            assert_eq!(task.to_string().parse::<Task>(), Ok(task));
        }
        assert_eq!(Task::HYPERELASTIC_HEALTHY.index(), 10);
        assert!("hyperelastic".parse::<Task>().is_err());
    }

    #[test]
    fn a_grid_of_stretches_holds_both_ends() {
        let grid = stretches(0.9, 1.1, 100);
        assert_eq!((grid.len(), grid[0], grid[99]), (100, 0.9, 1.1));
    }
}

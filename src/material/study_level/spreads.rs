//! The spreads of the study-level model and their priors.

use super::basis::{BEND, Basis, LEVEL, REMAINDER, SIZE, SLOPE, STEP};
use crate::material::random::CounterRng;
use crate::material::task::{Region, StudyKind, TASKS, Task};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How many spreads there are.
pub const SPREADS: usize = 17;

/// Standard deviation of a point about its smooth curve, ln Pa. The curves are functions without noise; this stands for
/// what the basis does not resolve (1 %), and keeps a curve of a hundred points from counting as a hundred facts.
pub(super) const NUGGET: f64 = 0.01;
/// Mean of all tasks' levels, ln Pa (about 1.1 kPa), and its sd: a factor of seven either way.
pub(super) const LEVEL_MEAN: f64 = 7.0;
pub(super) const LEVEL_SD: f64 = 2.0;
/// Sds of the tasks' mean shapes at `mean_shape` 1: step, slope, bend, remainder.
const MEAN_SHAPE: [f64; 4] = [0.6, 3.0, 3.0, 0.3];
/// Shares of a mean shape that all tasks, those of one region, and a task alone have.
const SHAPE_SHARES: [f64; 3] = [1.0, 0.3, 0.3];

/// Standard deviations of the model's parts; ln Pa, slopes per unit of Hencky strain. The scale in brackets is that of the
/// half-normal prior.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spreads {
    /// Level between publications of healthy tissue (1).
    pub level_publication: f64,
    /// Level between publications that speak of abnormal tissue only (3).
    pub level_publication_abnormal: f64,
    /// Level between curves of one publication (1).
    pub level_curve: f64,
    /// The same for abnormal tissue: a tumour, a ventricle's stand-in (3).
    pub level_curve_abnormal: f64,
    /// Difference of tension and compression between publications (1).
    pub step_publication: f64,
    /// Slope between publications (5).
    pub slope_publication: f64,
    /// Bend at rest between publications (5).
    pub bend_publication: f64,
    /// Difference of tension and compression between curves (1).
    pub step_curve: f64,
    /// Slope between curves (5).
    pub slope_curve: f64,
    /// Bend between curves (5).
    pub bend_curve: f64,
    /// Smooth remainder between publications (.5).
    pub remainder_publication: f64,
    /// Smooth remainder between curves (.5).
    pub remainder_curve: f64,
    /// What shapes of elastography and linear elasticity are to those of hyperelastic studies (.3).
    pub linear_scale: f64,
    /// Level that the tasks of one kind of study share (1).
    pub mean_kind: f64,
    /// Level that the tasks of one region share (1).
    pub mean_region: f64,
    /// Level of a task alone (1).
    pub mean_task: f64,
    /// Shapes of the tasks' means, as a multiple of their stated sds (1).
    pub mean_shape: f64,
}

/// Names of the spreads, in the order of the fields.
pub const SPREAD_NAMES: [&str; SPREADS] = [
    "level_publication",
    "level_publication_abnormal",
    "level_curve",
    "level_curve_abnormal",
    "step_publication",
    "slope_publication",
    "bend_publication",
    "step_curve",
    "slope_curve",
    "bend_curve",
    "remainder_publication",
    "remainder_curve",
    "linear_scale",
    "mean_kind",
    "mean_region",
    "mean_task",
    "mean_shape",
];
/// Scales of the half-normal priors, in the order of the fields.
const PRIOR_SCALES: [f64; SPREADS] =
    [1.0, 3.0, 1.0, 3.0, 1.0, 5.0, 5.0, 1.0, 5.0, 5.0, 0.5, 0.5, 0.3, 1.0, 1.0, 1.0, 1.0];
/// Where a search starts.
const START: [f64; SPREADS] = [0.7, 1.5, 0.4, 2.0, 0.5, 3.0, 3.0, 0.4, 3.0, 3.0, 0.2, 0.2, 0.1, 0.5, 0.5, 0.5, 1.0];

/// Places of the spreads in their list.
pub(super) const LINEAR_SCALE: usize = 12;
pub(super) const MEAN_KIND: usize = 13;
pub(super) const MEAN_REGION: usize = 14;
pub(super) const MEAN_TASK: usize = 15;
pub(super) const MEAN_SHAPE_SCALE: usize = 16;

/// What a random part belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Publication,
    Curve,
}

impl Default for Spreads {
    /// Where a search starts: of the size that tables of moduli suggest, not fitted.
    fn default() -> Self {
        Self::from_logs(&START.map(f64::ln))
    }
}

impl Spreads {
    /// Drawn from their priors: number `number` of a seed.
    pub fn from_prior(seed: u64, number: u64) -> Self {
        let rng = CounterRng::new(seed, number);
        let log = |n: usize| (PRIOR_SCALES[n] * rng.normal(n as u64).abs()).ln();
        Self::from_logs(&std::array::from_fn(log))
    }

    /// From their logarithms, in the order of the fields.
    pub fn from_logs(logs: &[f64; SPREADS]) -> Self {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q] = logs.map(f64::exp);
        Self {
            level_publication: a,
            level_publication_abnormal: b,
            level_curve: c,
            level_curve_abnormal: d,
            step_publication: e,
            slope_publication: f,
            bend_publication: g,
            step_curve: h,
            slope_curve: i,
            bend_curve: j,
            remainder_publication: k,
            remainder_curve: l,
            linear_scale: m,
            mean_kind: n,
            mean_region: o,
            mean_task: p,
            mean_shape: q,
        }
    }

    /// In the order of the fields.
    pub fn to_array(&self) -> [f64; SPREADS] {
        [
            self.level_publication,
            self.level_publication_abnormal,
            self.level_curve,
            self.level_curve_abnormal,
            self.step_publication,
            self.slope_publication,
            self.bend_publication,
            self.step_curve,
            self.slope_curve,
            self.bend_curve,
            self.remainder_publication,
            self.remainder_curve,
            self.linear_scale,
            self.mean_kind,
            self.mean_region,
            self.mean_task,
            self.mean_shape,
        ]
    }

    /// Log density of the half-normal priors in the spreads' logarithms, and its gradient there.
    pub(super) fn log_prior(&self) -> (f64, [f64; SPREADS]) {
        let values = self.to_array();
        let (mut density, mut slope) = (0.0, [0.0; SPREADS]);
        for n in 0..SPREADS {
            let ratio = values[n] / PRIOR_SCALES[n];
            density += ratio.ln() - 0.5 * ratio * ratio + 0.5 * (2.0 / PI).ln();
            slope[n] = 1.0 - ratio * ratio;
        }
        (density, slope)
    }

    /// Sd of each function's coefficient in a part of a task's curves, and the spread (by place) behind each.
    pub(super) fn deviations(&self, part: Part, task: Task) -> ([f64; SIZE], [usize; SIZE]) {
        let abnormal = usize::from(task.region == Region::Abnormal);
        let places = match part {
            Part::Publication => [abnormal, 4, 5, 6, 10],
            Part::Curve => [2 + abnormal, 7, 8, 9, 11],
        };
        let values = self.to_array();
        let scale = self.shape_scale(task);
        let weights = Basis.weights();
        let mut behind = [places[4]; SIZE];
        behind[..REMAINDER].copy_from_slice(&places[..4]);
        let deviation = |n: usize| values[behind[n]] * weights[n].sqrt() * if n == LEVEL { 1.0 } else { scale };
        (std::array::from_fn(deviation), behind)
    }

    /// 1 for hyperelastic studies, `linear_scale` for the others.
    fn shape_scale(&self, task: Task) -> f64 {
        if task.kind == StudyKind::Hyperelastic { 1.0 } else { self.linear_scale }
    }

    /// Prior covariance of the tasks' means in one function, without the scale of the task.
    pub(super) fn mean_covariance(&self, function: usize) -> [[f64; TASKS]; TASKS] {
        let tasks: Vec<Task> = Task::all().collect();
        let mut covariance = [[0.0; TASKS]; TASKS];
        for (i, a) in tasks.iter().enumerate() {
            for (j, b) in tasks.iter().enumerate() {
                let same = |yes: bool| f64::from(u8::from(yes));
                let (kind, region, task) = (same(a.kind == b.kind), same(a.region == b.region), same(i == j));
                covariance[i][j] = if function == LEVEL {
                    LEVEL_SD * LEVEL_SD
                        + self.mean_kind.powi(2) * kind
                        + self.mean_region.powi(2) * region
                        + self.mean_task.powi(2) * task
                } else {
                    let [all, of_region, alone] = SHAPE_SHARES;
                    (all + of_region * region + alone * task) * self.mean_shape_variance(function)
                };
            }
        }
        covariance
    }

    fn mean_shape_variance(&self, function: usize) -> f64 {
        let sd = match function {
            STEP => MEAN_SHAPE[0],
            SLOPE => MEAN_SHAPE[1],
            BEND => MEAN_SHAPE[2],
            _ => MEAN_SHAPE[3],
        };
        (sd * self.mean_shape).powi(2) * Basis.weights()[function]
    }

    /// What a function's coefficient is scaled by in each task's mean.
    pub(super) fn task_scales(&self, function: usize) -> [f64; TASKS] {
        let mut scales = [1.0; TASKS];
        if function != LEVEL {
            Task::all().for_each(|task| scales[task.index()] = self.shape_scale(task));
        }
        scales
    }
}

//! Fitting a meta-model: bounds, starts, and what is reported.

use super::curve::MetaModel;
use super::least_squares::{Bounds, Residuals, Solution, Tolerances, minimise};
use crate::material::law::{Data, MOST_PARAMETERS, Material, Search, Slope, Stability, Start};
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Added to W before the logarithm in the meta-model's residual, Pa, as in the paper.
pub const META_MODEL_LOG_OFFSET_PA: f64 = 1e-3;

/// Settings of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MetaModelSettings {
    /// How to search.
    pub search: Search,
    /// Added to W before the logarithm, Pa.
    pub log_offset_pa: f64,
}

impl MetaModelSettings {
    /// Refuses an offset that leaves energies without a logarithm.
    ///
    /// # Errors
    /// The setting and its rule, in words.
    pub fn check(&self) -> Result<(), String> {
        if self.log_offset_pa > 0.0 && self.log_offset_pa.is_finite() {
            return Ok(());
        }
        Err(format!("`log_offset_pa` is {:?}: it must be above 0", self.log_offset_pa))
    }
}

impl Default for MetaModelSettings {
    fn default() -> Self {
        Self { search: Search::Exact, log_offset_pa: META_MODEL_LOG_OFFSET_PA }
    }
}

/// A fitted law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// The law.
    pub model: MetaModel,
    /// Parameters in the order of [`MetaModel::parameter_names`].
    pub parameters: Vec<f64>,
    /// Shear modulus at rest, Pa.
    pub shear_modulus_pa: f64,
    /// Half the sum of squared residuals: of ln(W + offset), or of stress over its root mean square.
    pub cost: f64,
    /// Share of the variance of the targets that the law explains.
    pub r_squared: f64,
    /// Covariance of the parameters, residual variance times the inverse normal matrix; zero for a parameter that
    /// stands at a bound, since it did not move.
    pub covariance: Vec<Vec<f64>>,
    /// Names of the parameters that stand at a bound.
    pub at_bound: Vec<String>,
    /// Verdict from the analytic regions.
    pub stability: Stability,
    /// Whether the search met a tolerance.
    pub converged: bool,
}

impl Fit {
    /// The law as a compressible material of a scenario.
    pub fn material(&self, poisson_ratio: f64) -> Material {
        self.model.material(&self.parameters, poisson_ratio)
    }
}

/// Points that no law can be fitted to.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum FitError {
    /// Too few points.
    #[error("too few points to fit {model}: {found}; give at least {needed}")]
    TooFew {
        /// Points found.
        found: usize,
        /// The law.
        model: MetaModel,
        /// Points needed.
        needed: usize,
    },
    /// Stretches and targets of different lengths, or one that is no number.
    #[error(
        "point {} (stretch {stretch}) has no finite stress or logarithm of the energy ({target}), or a stretch that is \
         not above 0; correct the data",
        index + 1
    )]
    Point {
        /// Index of the point.
        index: usize,
        /// Stretch.
        stretch: f64,
        /// Target.
        target: f64,
    },
    /// More parameters than the search is made for.
    #[error("{model} has {count} parameters: laws of 1 to {MOST_PARAMETERS} can be fitted")]
    TooManyParameters {
        /// The law.
        model: MetaModel,
        /// Its parameters.
        count: usize,
    },
    /// All at rest.
    #[error("all stretches are 1: nothing is deformed, so no modulus can be found; give rows of a deformed sample")]
    AllAtRest,
    /// Rows at too few stretches.
    #[error(
        "{found} stretches besides 1 differ, and {model} has {needed} parameters: they would not be determined; give rows at {needed} \
         stretches or more, or name a law of fewer parameters (`--law neo-hookean`)"
    )]
    TooFewStretches {
        /// Different stretches away from rest.
        found: usize,
        /// The law.
        model: MetaModel,
        /// Its parameters.
        needed: usize,
    },
    /// All energies zero.
    #[error("all energies are 0: no modulus can be found; give rows with energy")]
    NoEnergy,
    /// Parameters that go together.
    #[error(
        "the rows do not determine the parameters of {model}: give rows at more stretches, or fit a law of fewer parameters"
    )]
    Undetermined {
        /// The law.
        model: MetaModel,
    },
    /// All stresses zero.
    #[error("all stresses are 0: no modulus can be found; give rows with load")]
    NoStress,
}

/// Fits W to targets y = ln(W + offset) at stretches.
///
/// # Errors
/// [`FitError`] when the points cannot determine the law.
pub fn fit(
    model: MetaModel,
    stretches: &[f64],
    targets: &[f64],
    settings: &MetaModelSettings,
) -> Result<Fit, FitError> {
    let quantity = Quantity::LogEnergy { offset_pa: settings.log_offset_pa };
    fit_quantity(&Problem { model, stretches, targets, quantity, search: settings.search })
}

/// Fits the nominal stress dW/dl to measured ones, Pa. Residuals are relative to the root mean square of the stresses,
/// so that costs of two tests compare.
///
/// # Errors
/// As [`fit`].
pub fn fit_stress(
    model: MetaModel,
    stretches: &[f64],
    stresses_pa: &[f64],
    settings: &MetaModelSettings,
) -> Result<Fit, FitError> {
    let mean_square = stresses_pa.iter().map(|s| s * s).sum::<f64>() / stresses_pa.len().max(1) as f64;
    if mean_square == 0.0 {
        return Err(FitError::NoStress);
    }
    let rms_pa = mean_square.sqrt();
    let targets: Vec<f64> = stresses_pa.iter().map(|s| s / rms_pa).collect();
    let quantity = Quantity::Stress { rms_pa };
    fit_quantity(&Problem { model, stretches, targets: &targets, quantity, search: settings.search })
}

fn fit_quantity(problem: &Problem) -> Result<Fit, FitError> {
    let Problem { model, stretches, targets, .. } = *problem;
    let needed = model.parameter_names().len() + 1;
    if stretches.len() < needed || targets.len() != stretches.len() {
        return Err(FitError::TooFew { found: stretches.len().min(targets.len()), model, needed });
    }
    for (index, (stretch, target)) in stretches.iter().zip(targets).enumerate() {
        if !(*stretch > 0.0 && stretch.is_finite() && target.is_finite()) {
            return Err(FitError::Point { index, stretch: *stretch, target: *target });
        }
    }
    let mut deformed: Vec<f64> = stretches.iter().copied().filter(|l| (l - 1.0).abs() > 1e-9).collect();
    if deformed.is_empty() {
        return Err(FitError::AllAtRest);
    }
    if let Quantity::LogEnergy { offset_pa } = problem.quantity
        && targets.iter().all(|target| target.exp() - offset_pa <= 1e-9 * offset_pa)
    {
        return Err(FitError::NoEnergy);
    }
    deformed.sort_by(f64::total_cmp);
    deformed.dedup_by(|a, b| (*a - *b).abs() <= 1e-9);
    let needed = needed - 1;
    if deformed.len() < needed {
        return Err(FitError::TooFewStretches { found: deformed.len(), model, needed });
    }
    let found = match model.parameter_names().len() {
        1 => report(problem, best_of::<1>(problem)),
        2 => report(problem, best_of::<2>(problem)),
        MOST_PARAMETERS => report(problem, best_of::<MOST_PARAMETERS>(problem)),
        count => return Err(FitError::TooManyParameters { model, count }),
    };
    // A valley without an end has no inverse.
    if found.covariance.iter().flatten().all(|c| c.is_finite()) {
        Ok(found)
    } else {
        Err(FitError::Undetermined { model })
    }
}

/// What is compared with the targets.
#[derive(Clone, Copy)]
enum Quantity {
    /// ln(W + offset).
    LogEnergy { offset_pa: f64 },
    /// dW/dl over the root mean square of the measured ones.
    Stress { rms_pa: f64 },
}

#[derive(Clone, Copy)]
struct Problem<'a> {
    model: MetaModel,
    stretches: &'a [f64],
    targets: &'a [f64],
    quantity: Quantity,
    search: Search,
}

impl Problem<'_> {
    fn predicted(&self, parameters: &[f64], stretch: f64) -> f64 {
        match self.quantity {
            Quantity::LogEnergy { offset_pa } => (self.model.energy_pa(parameters, stretch) + offset_pa).ln(),
            Quantity::Stress { rms_pa } => self.model.stress_pa(parameters, stretch) / rms_pa,
        }
    }

    /// d predicted / d parameters.
    fn slope(&self, parameters: &[f64], stretch: f64) -> Slope {
        match self.quantity {
            Quantity::LogEnergy { offset_pa } => {
                let denominator = self.model.energy_pa(parameters, stretch) + offset_pa;
                self.model.energy_slope_pa(parameters, stretch).map(|s| s / denominator)
            }
            Quantity::Stress { rms_pa } => self.model.stress_slope_pa(parameters, stretch).map(|s| s / rms_pa),
        }
    }

    /// The neo-Hookean modulus that meets one target.
    fn modulus_of(&self, stretch: f64, target: f64) -> f64 {
        match self.quantity {
            Quantity::LogEnergy { offset_pa } => {
                (target.exp() - offset_pa) / MetaModel::NEO_HOOKEAN.energy_pa(&[1.0], stretch)
            }
            Quantity::Stress { rms_pa } => target * rms_pa / MetaModel::NEO_HOOKEAN.stress_pa(&[1.0], stretch),
        }
    }
}

impl<const N: usize> Residuals<N> for Problem<'_> {
    fn residuals(&self, parameters: &[f64; N], out: &mut Vec<f64>) {
        out.extend(self.stretches.iter().zip(self.targets).map(|(l, y)| self.predicted(parameters, *l) - y));
    }

    fn jacobian(&self, parameters: &[f64; N], out: &mut Vec<[f64; N]>) {
        out.extend(self.stretches.iter().map(|l| {
            if let (Search::Published, Quantity::LogEnergy { offset_pa }) = (self.search, self.quantity)
                && let Some(slope) = self.model.curve().published_slope(parameters, *l, offset_pa)
            {
                return [slope; N];
            }
            let slope = self.slope(parameters, *l);
            std::array::from_fn(|i| slope[i])
        }));
    }
}

/// A first modulus: the neo-Hookean one that fits the median point exactly, so that starts carry the data's scale.
fn typical_modulus_pa(problem: &Problem) -> f64 {
    let strained = problem.stretches.iter().zip(problem.targets).filter(|(l, _)| (*l - 1.0).abs() > 1e-9);
    let mut moduli: Vec<f64> = strained.map(|(l, y)| problem.modulus_of(*l, *y).max(1e-3)).collect();
    moduli.sort_by(f64::total_cmp);
    moduli.get(moduli.len() / 2).copied().unwrap_or(1000.0)
}

fn best_of<const N: usize>(problem: &Problem) -> (Solution<N>, Bounds<N>) {
    let (tolerances, evaluations) = match problem.search {
        Search::Published => (Tolerances { cost: 1e-8, step: 1e-8, gradient: 1e-8 }, 100 * N),
        Search::Exact => (Tolerances { cost: 1e-14, step: 1e-10, gradient: 1e-12 }, 1000),
    };
    let solve = |start: &Start| {
        let [parameters, low, high] =
            [&start.parameters, &start.low, &start.high].map(|of| std::array::from_fn(|i| of[i]));
        let bounds = Bounds { low, high };
        (minimise(problem, &parameters, &bounds, &tolerances, evaluations), bounds)
    };
    let data = Data { stretches: problem.stretches, modulus_pa: typical_modulus_pa(problem) };
    let starts = problem.model.curve().starts(problem.search, &data);
    let mut best = solve(&starts[0]);
    for start in &starts[1..] {
        let found = solve(start);
        if found.0.cost < best.0.cost {
            best = found;
        }
    }
    best
}

fn report<const N: usize>(problem: &Problem, (solution, bounds): (Solution<N>, Bounds<N>)) -> Fit {
    let parameters = solution.parameters;
    let stands_at = |i: usize| {
        let near = |bound: f64| bound.is_finite() && (parameters[i] - bound).abs() <= 1e-6 * bound.abs().max(1e-3);
        near(bounds.low[i]) || near(bounds.high[i])
    };
    let free: Vec<usize> = (0..N).filter(|i| !stands_at(*i)).collect();
    let mut normal = [[0.0; N]; N];
    for stretch in problem.stretches {
        // The covariance is that of the law itself, whatever Jacobian the search used.
        let slope = problem.slope(&parameters, *stretch);
        for i in 0..N {
            for j in 0..N {
                normal[i][j] += slope[i] * slope[j];
            }
        }
    }
    let freedom = (problem.stretches.len() - free.len()).max(1) as f64;
    let variance = 2.0 * solution.cost / freedom;
    let mut covariance = vec![vec![0.0; N]; N];
    match free.as_slice() {
        [i] => covariance[*i][*i] = variance / normal[*i][*i],
        [i, j] => {
            let det = normal[*i][*i] * normal[*j][*j] - normal[*i][*j] * normal[*j][*i];
            covariance[*i][*i] = variance * normal[*j][*j] / det;
            covariance[*j][*j] = variance * normal[*i][*i] / det;
            covariance[*i][*j] = -variance * normal[*i][*j] / det;
            covariance[*j][*i] = covariance[*i][*j];
        }
        free => {
            let part = DMatrix::from_fn(free.len(), free.len(), |row, col| normal[free[row]][free[col]]);
            let inverse = part.try_inverse();
            for (row, i) in free.iter().enumerate() {
                for (col, j) in free.iter().enumerate() {
                    covariance[*i][*j] = inverse.as_ref().map_or(f64::NAN, |inverse| variance * inverse[(row, col)]);
                }
            }
        }
    }
    let mean = problem.targets.iter().sum::<f64>() / problem.targets.len() as f64;
    let spread: f64 = problem.targets.iter().map(|y| (y - mean).powi(2)).sum();
    let window = problem.stretches.iter().fold([f64::INFINITY, 0.0_f64], |[a, b], l| [a.min(*l), b.max(*l)]);
    let names = problem.model.parameter_names();
    Fit {
        model: problem.model,
        parameters: parameters.to_vec(),
        shear_modulus_pa: problem.model.small_strain_shear_modulus_pa(&parameters),
        cost: solution.cost,
        r_squared: if spread > 0.0 { 1.0 - 2.0 * solution.cost / spread } else { f64::NAN },
        covariance,
        at_bound: (0..N).filter(|i| stands_at(*i)).map(|i| names[i].to_owned()).collect(),
        stability: problem.model.stability(&parameters, window),
        converged: solution.converged,
    }
}

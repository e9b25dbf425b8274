//! The check that counts: each publication predicted from all the others.

use super::basis::Basis;
use super::evidence::{Evidence, MeanPosterior, leading_task};
use super::fit::{FitError, StudyLevelFit, refit};
use super::predict::{Of, StudyLevelPrior, predict};
use super::spreads::{NUGGET, Part, Spreads};
use super::study::{Coefficients, Studies, StudyCurve};
use crate::material::form::first_uniaxial;
use crate::material::gp::{Hyperparameters, negative_log_likelihood};
use crate::material::task::Task;
use crate::material::training::{GP_LOG_OFFSET_PA, TrainingData};
use rayon::prelude::*;
use serde::Serialize;

/// Half widths of the central 95 and 50 % of a normal distribution.
const REACH_95: f64 = 1.959_963_984_540_054;
const REACH_50: f64 = 0.674_489_750_196_081_7;

/// How one publication lies within what the others say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// Its name.
    pub publication: String,
    /// Its points away from rest.
    pub points: usize,
    /// Joint log predictive density of all its points, of ln g or of ln W alike (they differ by a number per stretch), with
    /// the spreads integrated out: the ratio of the probabilities of all studies and of the others.
    pub log_density: f64,
    /// The same with the spreads of the others taken as known.
    pub log_density_at_mode: f64,
    /// Share of its points inside the 95 % band of a new study.
    pub inside_95: f64,
    /// The same of the 50 % band.
    pub inside_50: f64,
    /// Its mean log modulus (over points and curves), and how much of the prediction lies below: uniform in 0 to 1 over
    /// publications when the model is right.
    pub mean_log_modulus: f64,
    /// See there.
    pub rank: f64,
    /// Its curves and what the others expect of them.
    #[serde(skip)]
    pub curves: Vec<LeftOutCurve>,
}

/// A curve of a publication that was left out, and the prediction of a new study of its task at its stretches.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOutCurve {
    /// Kind and region.
    pub task: Task,
    /// Stretches.
    pub stretches: Vec<f64>,
    /// ln g there.
    pub log_moduli: Vec<f64>,
    /// Its expectation.
    pub mean: Vec<f64>,
    /// Sd about it.
    pub sd: Vec<f64>,
}

/// Leaves out one publication after the other, fits the spreads to the rest from the same stated start, and predicts it.
/// `all` is the fit of all studies, for the ratio of probabilities alone.
///
/// # Errors
/// [`FitError`].
pub fn leave_one_publication_out(studies: &Studies, all: &StudyLevelFit) -> Result<Vec<LeftOut>, FitError> {
    (0..studies.publications.len()).into_par_iter().map(|n| leave_out(studies, n, all)).collect()
}

fn leave_out(studies: &Studies, number: usize, all: &StudyLevelFit) -> Result<LeftOut, FitError> {
    let rest = studies.without(number);
    let fit = refit(&rest, &Spreads::default())?;
    let spreads = fit.spreads;
    let known = Evidence::new(&rest, &spreads).ok_or(FitError::NotFinite)?;
    let with = Evidence::new(studies, &spreads).ok_or(FitError::NotFinite)?;
    let (name, curves) = &studies.publications[number];
    let (mut points, mut inside) = (0, [0usize; 2]);
    let mut predicted = Vec::new();
    for curve in curves {
        let stretches: Vec<f64> = curve.strains.iter().map(|x| x.exp()).collect();
        let prior = predict(&known.means, &spreads, curve.task, Of::Study, &stretches);
        for ((y, mean), sd) in curve.log_moduli.iter().zip(&prior.mean).zip(&prior.sd) {
            let away = ((y - mean) / sd).abs();
            points += 1;
            inside[0] += usize::from(away <= REACH_95);
            inside[1] += usize::from(away <= REACH_50);
        }
        let StudyLevelPrior { mean, sd, .. } = prior;
        let log_moduli = curve.log_moduli.clone();
        predicted.push(LeftOutCurve { task: curve.task, stretches, log_moduli, mean, sd });
    }
    let (mean_log_modulus, away) = level(curves, &known.means, &spreads);
    Ok(LeftOut {
        publication: name.clone(),
        points,
        log_density: all.log_evidence - fit.log_evidence,
        log_density_at_mode: with.log_likelihood - known.log_likelihood,
        inside_95: inside[0] as f64 / points as f64,
        inside_50: inside[1] as f64 / points as f64,
        mean_log_modulus,
        rank: normal_share(away),
        curves: predicted,
    })
}

/// The mean log modulus of a publication's curves, and how many standard deviations it lies above its expectation.
fn level(curves: &[StudyCurve], means: &MeanPosterior, spreads: &Spreads) -> (f64, f64) {
    let (publication, _) = spreads.deviations(Part::Publication, leading_task(curves));
    let share = 1.0 / curves.len() as f64;
    let row = |curve: &StudyCurve| {
        let rows = curve.strains.iter().map(|x| Coefficients::from(Basis.at(*x)));
        rows.fold(Coefficients::zeros(), |sum, row| sum + row) * (share / curve.strains.len() as f64)
    };
    let rows: Vec<Coefficients> = curves.iter().map(row).collect();
    let (mut mean, mut variance, mut found) = (0.0, 0.0, 0.0);
    let mut shared = Coefficients::zeros();
    for (curve, row) in curves.iter().zip(&rows) {
        let points = curve.strains.len() as f64;
        found += share * curve.log_moduli.iter().sum::<f64>() / points;
        mean += row.dot(&means.of(curve.task).0);
        let (own, _) = spreads.deviations(Part::Curve, curve.task);
        variance += row.component_mul(&Coefficients::from(own)).norm_squared() + (share * NUGGET).powi(2) / points;
        shared += row;
        for (other, theirs) in curves.iter().zip(&rows) {
            variance += row.dot(&(means.between(curve.task, other.task) * theirs));
        }
    }
    variance += shared.component_mul(&Coefficients::from(publication)).norm_squared();
    (found, (found - mean) / variance.sqrt())
}

/// Share of the standard normal law below x (Abramowitz and Stegun 26.2.17, within 8e-8).
fn normal_share(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let series =
        t * (0.319_381_530 + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let above = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt() * series;
    if x > 0.0 { 1.0 - above } else { above }
}

/// Kolmogorov's test of whether ranks are uniform: the probability of a deviation as large, with Stephens' correction for
/// few ranks (J. R. Stat. Soc. B 32, 1970).
pub fn uniform_probability(ranks: &[f64]) -> f64 {
    let mut sorted = ranks.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let deviation = sorted
        .iter()
        .enumerate()
        .fold(0.0_f64, |most, (i, rank)| most.max((i + 1) as f64 / n - rank).max(rank - i as f64 / n));
    let scaled = (n.sqrt() + 0.12 + 0.11 / n.sqrt()) * deviation;
    let term = |k: u32| {
        let k = f64::from(k);
        (-2.0 * (k * scaled).powi(2)).exp() * if k % 2.0 == 1.0 { 2.0 } else { -2.0 }
    };
    if scaled < 0.2 { 1.0 } else { (1..100).map(term).sum::<f64>().clamp(0.0, 1.0) }
}

/// The same density of one publication under the published Gaussian process, on the same points and of the same quantity:
/// ln(W + offset) is carried to ln W by its slope.
pub fn published_log_density(studies: &Studies, number: usize, parameters: &Hyperparameters) -> f64 {
    let data = |studies: &Studies| {
        let curves = studies.publications.iter().flat_map(|(_, curves)| curves);
        let points = curves.flat_map(|curve| {
            let seen = curve.strains.iter().zip(&curve.log_moduli);
            seen.map(|(x, y)| (x.exp(), curve.task.index(), curve_log_energy(x.exp(), *y)))
        });
        TrainingData::from_observations(points.collect())
    };
    let (_, curves) = &studies.publications[number];
    let slope = |curve: &StudyCurve| -> f64 {
        let points = curve.strains.iter().zip(&curve.log_moduli);
        points.map(|(x, y)| -(GP_LOG_OFFSET_PA / energy_pa(x.exp(), *y)).ln_1p()).sum()
    };
    negative_log_likelihood(parameters, &data(&studies.without(number)))
        - negative_log_likelihood(parameters, &data(studies))
        + curves.iter().map(slope).sum::<f64>()
}

fn energy_pa(stretch: f64, log_modulus: f64) -> f64 {
    0.5 * first_uniaxial(stretch) * log_modulus.exp()
}

/// ln(W + offset) as the published process takes it.
fn curve_log_energy(stretch: f64, log_modulus: f64) -> f64 {
    (energy_pa(stretch, log_modulus) + GP_LOG_OFFSET_PA).ln()
}

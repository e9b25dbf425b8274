//! The check that counts: each publication predicted from all the others.

use super::evidence::Evidence;
use super::fit::{FitError, refit};
use super::predict::{Of, predict};
use super::spreads::Spreads;
use super::study::Studies;
use crate::material::gp::{Hyperparameters, negative_log_likelihood};
use crate::material::training::TrainingData;
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
    /// Joint log predictive density of all its points, of ln g or of ln W alike (they differ by a number per stretch).
    pub log_density: f64,
    /// Share of its points inside the 95 % band of a new study.
    pub inside_95: f64,
    /// The same of the 50 % band.
    pub inside_50: f64,
}

/// Leaves out one publication after the other, fits the spreads to the rest from `start`, and predicts it.
///
/// # Errors
/// [`FitError`].
pub fn leave_one_publication_out(studies: &Studies, start: &Spreads) -> Result<Vec<LeftOut>, FitError> {
    (0..studies.publications.len()).into_par_iter().map(|n| leave_out(studies, n, start)).collect()
}

fn leave_out(studies: &Studies, number: usize, start: &Spreads) -> Result<LeftOut, FitError> {
    let rest = studies.without(number);
    let spreads = refit(&rest, start)?;
    let known = Evidence::new(&rest, &spreads).ok_or(FitError::NotFinite)?;
    let all = Evidence::new(studies, &spreads).ok_or(FitError::NotFinite)?;
    let (name, curves) = &studies.publications[number];
    let (mut points, mut inside) = (0, [0usize; 2]);
    for curve in curves {
        let stretches: Vec<f64> = curve.strains.iter().map(|x| x.exp()).collect();
        let prior = predict(&known.means, &spreads, curve.task, Of::Study, &stretches);
        for ((y, mean), sd) in curve.log_moduli.iter().zip(&prior.mean).zip(&prior.sd) {
            let away = ((y - mean) / sd).abs();
            points += 1;
            inside[0] += usize::from(away <= REACH_95);
            inside[1] += usize::from(away <= REACH_50);
        }
    }
    Ok(LeftOut {
        publication: name.clone(),
        points,
        log_density: all.log_likelihood - known.log_likelihood,
        inside_95: inside[0] as f64 / points as f64,
        inside_50: inside[1] as f64 / points as f64,
    })
}

/// The same density of one publication under the published Gaussian process, on the same points.
pub fn published_log_density(studies: &Studies, number: usize, parameters: &Hyperparameters) -> f64 {
    let data = |studies: &Studies| {
        let curves = studies.publications.iter().flat_map(|(_, curves)| curves);
        let points = curves.flat_map(|curve| {
            let seen = curve.strains.iter().zip(&curve.log_moduli);
            seen.map(|(x, y)| (x.exp(), curve.task.index(), curve_log_energy(x.exp(), *y)))
        });
        TrainingData::from_observations(points.collect())
    };
    negative_log_likelihood(parameters, &data(&studies.without(number)))
        - negative_log_likelihood(parameters, &data(studies))
}

/// ln(W + offset) as the published process takes it.
fn curve_log_energy(stretch: f64, log_modulus: f64) -> f64 {
    let half_invariant = 0.5 * crate::material::form::first_uniaxial(stretch);
    (half_invariant * log_modulus.exp() + crate::material::training::GP_LOG_OFFSET_PA).ln()
}

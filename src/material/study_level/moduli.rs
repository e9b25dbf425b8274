//! Materials from predicted functions, and what is known beforehand of a person's moduli.

use super::joint::JointPrediction;
use super::predict::{StudyLevelPrior, log_energies};
use crate::material::generative::{DrawnMaterial, SampleSettings, SampledMaterial};
use crate::material::meta_model::{Fit, FitError, fit};
use nalgebra::DMatrix;
use nalgebra::linalg::Cholesky;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The law of the settings fitted to ln g at stretches.
fn law_of(stretches: &[f64], log_moduli: &[f64], settings: &SampleSettings) -> Result<Fit, FitError> {
    let targets = log_energies(stretches, log_moduli, settings.meta_model.log_offset_pa);
    fit(settings.model, stretches, &targets, &settings.meta_model)
}

/// Materials at these standard deviations from the mean of ln g: envelopes with the law fitted to each.
///
/// # Errors
/// [`FitError`] when the prediction has fewer stretches than the law needs.
pub fn materials_at_levels(
    prior: &StudyLevelPrior,
    sd_levels: &[f64],
    settings: &SampleSettings,
) -> Result<Vec<SampledMaterial>, FitError> {
    let material = |sd_level: &f64| {
        let fit = law_of(&prior.stretches, &prior.quantile(*sd_level), settings)?;
        Ok(SampledMaterial { sd_level: *sd_level, shear_modulus_pa: fit.shear_modulus_pa, fit })
    };
    sd_levels.iter().map(material).collect()
}

/// Materials fitted to draws 0, 1, ... of whole functions; draw n is the same whatever their number.
///
/// # Errors
/// As [`materials_at_levels`].
pub fn drawn_materials(
    prior: &StudyLevelPrior,
    draws: u64,
    seed: u64,
    settings: &SampleSettings,
) -> Result<Vec<DrawnMaterial>, FitError> {
    let one = |draw: u64| {
        let fit = law_of(&prior.stretches, &prior.draw(seed, draw), settings)?;
        Ok(DrawnMaterial { draw, shear_modulus_pa: fit.shear_modulus_pa, fit })
    };
    (0..draws).into_par_iter().map(one).collect()
}

/// What is known of shear moduli before anything is measured: normal in ln Pa, jointly over tasks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModuliPrior {
    /// Kind of study and region of each modulus.
    pub tasks: Vec<String>,
    /// Mean of the logarithm of each, ln Pa.
    pub mean_ln_pa: Vec<f64>,
    /// Covariance of the logarithms, row by row.
    pub covariance_ln: Vec<Vec<f64>>,
}

impl ModuliPrior {
    /// Moments of the moduli of the settings' law, fitted to draws of whole functions.
    ///
    /// # Errors
    /// As [`materials_at_levels`].
    pub fn from_draws(
        joint: &JointPrediction,
        draws: u64,
        seed: u64,
        settings: &SampleSettings,
    ) -> Result<Self, FitError> {
        let person = |draw: u64| -> Result<Vec<f64>, FitError> {
            let curves = joint.draw(seed, draw);
            let tissues = joint.stretches.iter().zip(&curves);
            tissues.map(|(l, y)| Ok(law_of(l, y, settings)?.shear_modulus_pa.ln())).collect()
        };
        let logs: Vec<Vec<f64>> = (0..draws).into_par_iter().map(person).collect::<Result<_, _>>()?;
        let (n, count) = (joint.tasks.len(), draws as f64);
        let mean: Vec<f64> = (0..n).map(|i| logs.iter().map(|row| row[i]).sum::<f64>() / count).collect();
        let product = |i: usize, j: usize| logs.iter().map(|row| (row[i] - mean[i]) * (row[j] - mean[j])).sum::<f64>();
        let covariance_ln = (0..n).map(|i| (0..n).map(|j| product(i, j) / (count - 1.0)).collect()).collect();
        Ok(Self { tasks: joint.tasks.iter().map(ToString::to_string).collect(), mean_ln_pa: mean, covariance_ln })
    }

    /// Sd of each logarithm.
    pub fn sds_ln(&self) -> Vec<f64> {
        self.covariance_ln.iter().enumerate().map(|(i, row)| row[i].sqrt()).collect()
    }

    /// Refuses what is no normal law.
    ///
    /// # Errors
    /// What is wrong with it, in words: a length, a covariance that is none.
    pub fn check(&self) -> Result<(), String> {
        let (n, rows) = (self.tasks.len(), &self.covariance_ln);
        if self.mean_ln_pa.len() != n || rows.len() != n || rows.iter().any(|row| row.len() != n) {
            return Err(format!(
                "`mean_ln_pa` and `covariance_ln` must have a number, and a row, for each of {n} `tasks`"
            ));
        }
        let matrix = DMatrix::from_fn(n, n, |i, j| rows[i][j]);
        let symmetric = (&matrix - matrix.transpose()).amax() <= 1e-9 * matrix.amax();
        if !symmetric || Cholesky::new(matrix).is_none() || self.mean_ln_pa.iter().any(|m| !m.is_finite()) {
            return Err("`covariance_ln` must be symmetric and positive definite, `mean_ln_pa` finite".to_owned());
        }
        Ok(())
    }

    /// As text.
    pub fn to_toml(&self) -> String {
        let numbers = |row: &[f64]| row.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", ");
        let rows: Vec<String> = self.covariance_ln.iter().map(|row| format!("    [{}],\n", numbers(row))).collect();
        format!(
            "tasks = {:?}\nmean_ln_pa = [{}]\ncovariance_ln = [\n{}]\n",
            self.tasks,
            numbers(&self.mean_ln_pa),
            rows.concat()
        )
    }
}

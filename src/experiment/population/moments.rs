//! What one patient's scans alone say of the logarithms: the estimate with the prior that it was made under divided out.

use crate::experiment::estimate::{EstimateOutcome, LogPrior};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// A Gaussian likelihood exp(-x' P x / 2 + h' x) over the logarithms x of a file's parameters, in their order. A direction of
/// which the scans say nothing has no precision: this form can tell that, mean and covariance cannot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Moments {
    /// h = P times the mean.
    pub information: Vec<f64>,
    /// P, the inverse of the covariance, row by row.
    pub precision: Vec<Vec<f64>>,
}

/// Beyond this share of the prior's variance a direction is the prior's own: nothing is left when that is divided out.
const NOTHING_LEARNT: f64 = 1.0 - 1e-6;
/// Standard deviation that stands for no prior knowledge: a factor of 1e43.
const UNKNOWN_SD: f64 = 100.0;

impl Moments {
    /// What the scans behind an estimate say of these parameters; those that it has not estimated are left unknown. None where
    /// the estimate holds none of them, or figures that are no Gaussian.
    ///
    /// The mesh's own error was added to the estimate's covariance after the fit, so it is taken off before the prior is divided
    /// out, and belongs to what the scans say afterwards.
    pub fn of_estimate(found: &EstimateOutcome, names: &[String]) -> Option<Self> {
        let posterior = &found.posterior;
        let place = |name: &String| posterior.names.iter().position(|own| own == name);
        let (rows, places): (Vec<usize>, Vec<usize>) =
            names.iter().enumerate().filter_map(|(n, name)| Some((n, place(name)?))).unzip();
        let count = places.len();
        if count == 0 {
            return None;
        }
        let error = DMatrix::from_diagonal(&DVector::from_iterator(count, places.iter().map(|&p| added(found, p))));
        let both = |m: &DMatrix<f64>| m.clone().select_rows(&places).select_columns(&places);
        let covariance = DMatrix::from_fn(count, count, |r, c| {
            posterior.log_covariance.get(places[r]).and_then(|row| row.get(places[c])).copied().unwrap_or(f64::NAN)
        }) - &error;
        let prior = both(&prior_covariance(&found.prior));
        let away = DVector::from_iterator(count, places.iter().map(|&p| posterior.mode[p].ln() - found.prior[p].mean));
        let middle = DVector::from_iterator(count, places.iter().map(|&p| found.prior[p].mean));
        if covariance.iter().chain(&prior).chain(&away).chain(&middle).any(|x| !x.is_finite()) {
            return None;
        }
        // In coordinates in which the prior is standard normal its precision is 1 in every direction.
        let factor = prior.cholesky()?.l();
        let unit = factor.clone().try_inverse()?;
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(&unit * covariance * unit.transpose());
        let turned = eigenvectors.transpose() * &unit;
        let seen = &turned * away;
        let (mut precision, mut information) = (DVector::zeros(count), DVector::zeros(count));
        for n in 0..count {
            let variance = eigenvalues[n];
            if variance <= 0.0 {
                return None;
            }
            if variance < NOTHING_LEARNT {
                precision[n] = 1.0 / variance - 1.0;
                information[n] = seen[n] / variance;
            }
        }
        let precision = turned.transpose() * DMatrix::from_diagonal(&precision) * &turned;
        let information = turned.transpose() * information + &precision * middle;
        // A reading with more noise: (P^-1 + E)^-1 = (I + P E)^-1 P, where P may have no inverse.
        let damped = (DMatrix::identity(count, count) + &precision * error).try_inverse()?;
        let (precision, information) = (&damped * precision, damped * information);
        let mut whole = (DMatrix::zeros(names.len(), names.len()), DVector::zeros(names.len()));
        for (r, &row) in rows.iter().enumerate() {
            whole.1[row] = information[r];
            for (c, &column) in rows.iter().enumerate() {
                whole.0[(row, column)] = 0.5 * (precision[(r, c)] + precision[(c, r)]);
            }
        }
        Some(Self::new(&whole.0, &whole.1))
    }

    /// From matrix and vector.
    pub fn new(precision: &DMatrix<f64>, information: &DVector<f64>) -> Self {
        Self {
            information: information.iter().copied().collect(),
            precision: precision.row_iter().map(|row| row.iter().copied().collect()).collect(),
        }
    }

    /// P and h.
    pub(super) fn parts(&self) -> (DMatrix<f64>, DVector<f64>) {
        let count = self.information.len();
        let precision = DMatrix::from_fn(count, count, |r, c| self.precision[r][c]);
        (precision, DVector::from_column_slice(&self.information))
    }

    /// Whether anything is said of a parameter.
    pub fn tells_of(&self, parameter: usize) -> bool {
        self.precision[parameter][parameter] > 0.0
    }

    /// Whether anything is said of any parameter.
    pub fn tells(&self) -> bool {
        (0..self.precision.len()).any(|parameter| self.tells_of(parameter))
    }

    /// The same among other parameters: `places` says where each of them stands here.
    pub(super) fn among(&self, places: &[Option<usize>]) -> Self {
        let at = |r: Option<usize>, c: Option<usize>| r.zip(c).map_or(0.0, |(r, c)| self.precision[r][c]);
        Self {
            information: places.iter().map(|p| p.map_or(0.0, |p| self.information[p])).collect(),
            precision: places.iter().map(|&r| places.iter().map(|&c| at(r, c)).collect()).collect(),
        }
    }

    /// What is wrong with moments of so many parameters.
    pub(super) fn check(&self, parameters: usize) -> Result<(), String> {
        let square = self.precision.len() == parameters && self.precision.iter().all(|row| row.len() == parameters);
        if self.information.len() != parameters || !square {
            return Err(format!(
                "`information` must have {parameters} numbers and `precision` as many rows and columns"
            ));
        }
        let (precision, information) = self.parts();
        if precision.iter().chain(&information).any(|x| !x.is_finite()) {
            return Err("`information` and `precision` must be finite numbers".to_owned());
        }
        let largest = precision.amax();
        let symmetric = (&precision - precision.transpose()).amax() <= 1e-9 * largest;
        let negative = SymmetricEigen::new(precision).eigenvalues.iter().any(|l| *l < -1e-9 * largest);
        if !symmetric || negative {
            return Err("`precision` must be the inverse of a covariance: symmetric, and below 0 nowhere".to_owned());
        }
        Ok(())
    }

    /// By value: an order that says nothing of who came first.
    pub(super) fn by_value(&self, other: &Self) -> Ordering {
        let values = |m: &Self| m.information.iter().chain(m.precision.iter().flatten()).copied().collect::<Vec<_>>();
        let pairs = values(self).into_iter().zip(values(other));
        pairs.map(|(a, b)| a.total_cmp(&b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    }
}

/// Variance that mesh, labels and supports added to a parameter of an estimate.
fn added(found: &EstimateOutcome, parameter: usize) -> f64 {
    let modulus = found.posterior.names[parameter].starts_with("shear_modulus_pa");
    let expected = if modulus { found.model_log_sd } else { 0.0 };
    let of_body = if modulus { found.body_log_sd } else { 0.0 };
    found.mesh_log_sd.get(parameter).copied().unwrap_or(expected).powi(2) + of_body.powi(2)
}

/// The joint covariance of these priors.
fn prior_covariance(prior: &[LogPrior]) -> DMatrix<f64> {
    let sd = |p: usize| prior[p].sd.unwrap_or(UNKNOWN_SD);
    DMatrix::from_fn(prior.len(), prior.len(), |r, c| {
        let (late, early) = (r.max(c), r.min(c));
        let correlation =
            if r == c { 1.0 } else { prior[late].correlation.get(late - early - 1).copied().unwrap_or(0.0) };
        correlation * sd(r) * sd(c)
    })
}

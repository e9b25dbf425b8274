//! Estimation with error bars: the moduli that explain an observed deformation.
//!
//! Levenberg-Marquardt in the logarithms of the parameters, with the Gaussian-process prior of room `material` as a
//! Gaussian over them, then the Laplace approximation of the posterior (MacKay, "Information Theory, Inference, and
//! Learning Algorithms", chapter 27) and what the data can and cannot tell apart.

mod body;
mod correlated;
mod displacement;
mod evidence;
mod levenberg_marquardt;
mod mesh_error;
mod outcome;
mod posterior;
mod process;
mod re_registration;
mod rigid_remainder;

pub use body::{Body, BodyError, Observation, Solved, Turn, Unknown, material};
pub use correlated::{CorrelatedErrors, Odds, Shift};
pub use displacement::DisplacementSettings;
pub use evidence::{Evidence, NOISE_LOG_SD, STRONG, Unexplained, weights};
pub use levenberg_marquardt::{
    Convergence, Descent, EstimateError, EstimateSettings, Forward, Linearisation, estimate,
};
pub use outcome::{Errors, Estimate, EstimateOutcome, Problem, ProblemError, solve_problem};
pub use posterior::{Identifiability, Knowledge, Posterior, Z_95, information, laplace};
pub use process::Process;
pub use re_registration::{Instrument, ReRegistration, moved_by};

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A Gaussian over the logarithm of one parameter (or an angle): what is known before the patient is seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogPrior {
    /// Name of the parameter: `shear_modulus_pa of grey_matter`.
    pub name: String,
    /// Mean of ln(parameter).
    pub mean: f64,
    /// Standard deviation of ln(parameter); infinite for no prior knowledge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
    /// What `mean` and `sd` are the logarithm of, or an angle instead.
    #[serde(default)]
    pub scale: Scale,
    /// Correlation with the parameters right before it, the nearest first; independent of all others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub correlation: Vec<f64>,
}

/// What an estimated number stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// The logarithm of a positive quantity.
    #[default]
    Logarithm,
    /// An angle in radians, shown in degrees.
    Angle,
    /// The quantity itself.
    Plain,
    /// The logarithm of the odds of a share between 0 and 1.
    Share,
}

impl Scale {
    /// The quantity behind the number.
    pub fn value(self, number: f64) -> f64 {
        match self {
            Self::Logarithm => number.exp(),
            Self::Angle => number.to_degrees(),
            Self::Plain => number,
            Self::Share => 1.0 / (1.0 + (-number).exp()),
        }
    }
}

impl LogPrior {
    /// 1 / sd^2, zero without prior knowledge.
    pub fn precision(&self) -> f64 {
        self.sd.map_or(0.0, |sd| 1.0 / (sd * sd))
    }
}

/// The inverse of the joint covariance of these priors; rows of no prior knowledge are zero.
pub fn precision(prior: &[LogPrior]) -> DMatrix<f64> {
    let n = prior.len();
    if prior.iter().all(|p| p.correlation.is_empty()) {
        return DMatrix::from_diagonal(&DVector::from_iterator(n, prior.iter().map(LogPrior::precision)));
    }
    let known: Vec<usize> = (0..n).filter(|&p| prior[p].sd.is_some()).collect();
    let sd = |p: usize| prior[p].sd.unwrap_or(0.0);
    let correlation = |a: usize, b: usize| match a.cmp(&b) {
        std::cmp::Ordering::Equal => 1.0,
        std::cmp::Ordering::Greater => prior[a].correlation.get(a - b - 1).copied().unwrap_or(0.0),
        std::cmp::Ordering::Less => prior[b].correlation.get(b - a - 1).copied().unwrap_or(0.0),
    };
    let covariance = DMatrix::from_fn(known.len(), known.len(), |r, c| {
        correlation(known[r], known[c]) * sd(known[r]) * sd(known[c])
    });
    let inverse = posterior::invert(&covariance);
    let mut precision = DMatrix::zeros(n, n);
    for (r, &p) in known.iter().enumerate() {
        for (c, &q) in known.iter().enumerate() {
            precision[(p, q)] = inverse[(r, c)];
        }
    }
    precision
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlated_priors_have_the_inverse_of_their_covariance_as_precision() {
        let prior = |sd: Option<f64>, correlation: Vec<f64>| LogPrior {
            name: String::new(),
            mean: 0.0,
            sd,
            scale: Scale::Plain,
            correlation,
        };
        let found = precision(&[prior(Some(0.5), vec![]), prior(Some(2.0), vec![0.6]), prior(None, vec![])]);
        let covariance = nalgebra::Matrix2::new(0.25, 0.6, 0.6, 4.0);
        let expected = covariance.try_inverse().unwrap();
        for r in 0..2 {
            for c in 0..2 {
                assert!((found[(r, c)] - expected[(r, c)]).abs() < 1e-12);
            }
        }
        assert_eq!(found[(2, 2)], 0.0);
    }
}

//! Estimation with error bars: the moduli that explain an observed deformation.
//!
//! Levenberg-Marquardt in the logarithms of the parameters, with the Gaussian-process prior of room `material` as a
//! Gaussian over them, then the Laplace approximation of the posterior (MacKay, "Information Theory, Inference, and
//! Learning Algorithms", chapter 27) and what the data can and cannot tell apart.

mod body;
mod displacement;
mod levenberg_marquardt;
mod outcome;
mod posterior;
mod re_registration;

pub use body::{Body, BodyError, Observation, Solved, Turn, Unknown};
pub use displacement::DisplacementSettings;
pub use levenberg_marquardt::{
    Convergence, Descent, EstimateError, EstimateSettings, Forward, Linearisation, estimate,
};
pub use outcome::{Estimate, EstimateOutcome, Problem, ProblemError, solve_problem};
pub use posterior::{Identifiability, Posterior, Verdict, laplace};
pub use re_registration::{Instrument, ReRegistration, moved_by};

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
}

impl Scale {
    /// The quantity behind the number.
    pub fn value(self, number: f64) -> f64 {
        match self {
            Self::Logarithm => number.exp(),
            Self::Angle => number.to_degrees(),
        }
    }
}

impl LogPrior {
    /// 1 / sd^2, zero without prior knowledge.
    pub fn precision(&self) -> f64 {
        self.sd.map_or(0.0, |sd| 1.0 / (sd * sd))
    }
}

//! Estimation with error bars: the moduli that explain an observed deformation.
//!
//! Levenberg-Marquardt in the logarithms of the parameters, with the Gaussian-process prior of room `material` as a
//! Gaussian over them, then the Laplace approximation of the posterior (MacKay, "Information Theory, Inference, and
//! Learning Algorithms", chapter 27) and what the data can and cannot tell apart.

mod body;
mod correlated;
mod displacement;
mod evidence;
mod falx_place;
mod findings;
mod fluid;
mod fluid_levels;
mod independent;
mod levenberg_marquardt;
mod load_assumed;
mod mesh_error;
mod nuisance;
mod outcome;
mod outline;
mod posterior;
mod problem;
mod process;
mod projection;
mod re_registration;
mod rigid_remainder;
mod shape;
mod softest;
mod solve;
mod spread;
mod support_edge;
mod unknown;
mod unseen;
mod verdict_of_fit;

pub use body::{Body, BodyError, Observation, Solved, material};
pub use correlated::CorrelatedErrors;
pub use displacement::DisplacementSettings;
pub use evidence::{Evidence, LinearModel, NOISE_LOG_SD, Unexplained, weights};
pub use findings::{Odds, ProblemError, Shift};
pub use fluid::{FluidOutcome, prior_of_drained};
pub use fluid_levels::FluidLevels;
pub use levenberg_marquardt::{
    Convergence, Descent, EstimateError, EstimateSettings, Forward, Linearisation, estimate,
};
pub use outcome::{Estimate, EstimateOutcome, SEEN_AT, SEEN_DISPLACEMENT};
pub use posterior::{
    Identifiability, Knowledge, Posterior, Z_95, information, joint_precision, laplace, prior_correlation,
};
pub use problem::{Errors, Problem};
pub use process::{Factor, Process, spread_out};
pub use re_registration::{Instrument, InstrumentError, MovedNode, ReRegistration, Shown, moved_by};
pub use rigid_remainder::RigidModes;
pub use shape::ShapeError;
pub use solve::solve_problem;
pub use unknown::{Turn, Unknown};

use crate::material::law::ShapeScale;
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
    /// What one more study would report, where `mean` and `sd` are of a person: the average of the studies with the spread of one
    /// more of them. A figure far from it contradicts the literature, and data that do not narrow it say nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub average: Option<Average>,
}

/// A Gaussian over ln(parameter).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Average {
    /// Its mean: the average of the studies.
    pub mean: f64,
    /// Its standard deviation: how far one more study may be from it, not how well the average is known.
    pub sd: f64,
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
    /// ln(lambda / mu), shown as Poisson's ratio: whatever it is, that lies between 0 and 1/2.
    LameRatio,
}

impl Scale {
    /// The quantity behind the number.
    pub fn value(self, number: f64) -> f64 {
        match self {
            Self::Logarithm => number.exp(),
            Self::Angle => number.to_degrees(),
            Self::Plain => number,
            Self::Share => 1.0 / (1.0 + (-number).exp()),
            Self::LameRatio => 0.5 / (1.0 + (-number).exp()),
        }
    }

    /// The number behind the quantity: the inverse of [`Scale::value`].
    ///
    /// ```
    /// # use hgm::experiment::estimate::Scale;
    /// for scale in [Scale::Logarithm, Scale::Angle, Scale::Plain, Scale::Share, Scale::LameRatio] {
    ///     assert!((scale.number(scale.value(0.7)) - 0.7).abs() < 1e-12);
    /// }
    /// ```
    pub fn number(self, value: f64) -> f64 {
        match self {
            Self::Logarithm => value.ln(),
            Self::Angle => value.to_radians(),
            Self::Plain => value,
            Self::Share => (value / (1.0 - value)).ln(),
            Self::LameRatio => (value / (0.5 - value)).ln(),
        }
    }
}

impl From<ShapeScale> for Scale {
    fn from(scale: ShapeScale) -> Self {
        match scale {
            ShapeScale::Plain => Self::Plain,
            ShapeScale::Logarithm => Self::Logarithm,
            ShapeScale::Share => Self::Share,
        }
    }
}

impl LogPrior {
    /// 1 / sd^2, zero without prior knowledge.
    pub fn precision(&self) -> f64 {
        self.sd.map_or(0.0, |sd| 1.0 / (sd * sd))
    }

    /// What one more study would report as a prior, where that stands beside this; it knows each parameter by itself.
    #[must_use]
    pub fn of_average(&self) -> Self {
        match self.average {
            Some(Average { mean, sd }) => {
                Self { mean, sd: Some(sd), average: None, correlation: Vec::new(), ..self.clone() }
            }
            None => self.clone(),
        }
    }
}

//! The meta-models' curves and their derivatives in the parameters.

use crate::material::form::{first_uniaxial, ogden_uniaxial, second_uniaxial};
use serde::{Deserialize, Serialize};

/// A law to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MetaModel {
    /// mu.
    NeoHookean,
    /// c1, c2.
    MooneyRivlin,
    /// mu, alpha with |alpha| <= 5.
    Ogden,
    /// mu, alpha with |alpha| <= 50.
    OgdenHigh,
}

impl MetaModel {
    /// All meta-models, in the paper's order.
    pub const ALL: [Self; 4] = [Self::NeoHookean, Self::MooneyRivlin, Self::Ogden, Self::OgdenHigh];

    /// The word in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::NeoHookean => "neo-hookean",
            Self::MooneyRivlin => "mooney-rivlin",
            Self::Ogden => "ogden",
            Self::OgdenHigh => "ogden-high",
        }
    }

    /// Parameter names with units.
    pub fn parameter_names(self) -> &'static [&'static str] {
        match self {
            Self::NeoHookean => &["mu_pa"],
            Self::MooneyRivlin => &["c1_pa", "c2_pa"],
            Self::Ogden | Self::OgdenHigh => &["mu_pa", "alpha"],
        }
    }

    /// W, Pa, at a stretch; parameters in the order of their names.
    pub fn energy_pa(self, parameters: &[f64], stretch: f64) -> f64 {
        match self {
            Self::NeoHookean => 0.5 * parameters[0] * first_uniaxial(stretch),
            Self::MooneyRivlin => parameters[0] * first_uniaxial(stretch) + parameters[1] * second_uniaxial(stretch),
            Self::Ogden | Self::OgdenHigh => parameters[0] / parameters[1] * ogden_uniaxial(stretch, parameters[1]),
        }
    }

    /// dW / d parameters; the second entry is unused by a law of one parameter.
    pub(super) fn energy_slope_pa(self, parameters: &[f64], stretch: f64) -> [f64; 2] {
        match self {
            Self::NeoHookean => [0.5 * first_uniaxial(stretch), 0.0],
            Self::MooneyRivlin => [first_uniaxial(stretch), second_uniaxial(stretch)],
            Self::Ogden | Self::OgdenHigh => {
                let (mu, alpha) = (parameters[0], parameters[1]);
                let sum = ogden_uniaxial(stretch, alpha);
                let ln_l = stretch.ln();
                let bend = ln_l * ((alpha * ln_l).exp() - (-0.5 * alpha * ln_l).exp());
                [sum / alpha, mu / alpha * (bend - sum / alpha)]
            }
        }
    }

    /// Nominal stress dW/dl, Pa.
    pub fn stress_pa(self, parameters: &[f64], stretch: f64) -> f64 {
        let l = stretch;
        match self {
            Self::NeoHookean => parameters[0] * (l - l.powi(-2)),
            Self::MooneyRivlin => 2.0 * (l - l.powi(-2)) * (parameters[0] + parameters[1] / l),
            Self::Ogden | Self::OgdenHigh => {
                let (mu, alpha) = (parameters[0], parameters[1]);
                mu * (l.powf(alpha - 1.0) - l.powf(-0.5 * alpha - 1.0))
            }
        }
    }

    /// d stress / d parameters; the second entry is unused by a law of one parameter.
    pub(super) fn stress_slope_pa(self, parameters: &[f64], stretch: f64) -> [f64; 2] {
        let l = stretch;
        let neo_hookean = l - l.powi(-2);
        match self {
            Self::NeoHookean => [neo_hookean, 0.0],
            Self::MooneyRivlin => [2.0 * neo_hookean, 2.0 * neo_hookean / l],
            Self::Ogden | Self::OgdenHigh => {
                let (mu, alpha) = (parameters[0], parameters[1]);
                let (up, down) = (l.powf(alpha - 1.0), l.powf(-0.5 * alpha - 1.0));
                [up - down, mu * l.ln() * (up + 0.5 * down)]
            }
        }
    }

    /// Shear modulus at rest, Pa.
    pub fn small_strain_shear_modulus_pa(self, parameters: &[f64]) -> f64 {
        match self {
            Self::NeoHookean => parameters[0],
            Self::MooneyRivlin => 2.0 * (parameters[0] + parameters[1]),
            Self::Ogden | Self::OgdenHigh => 0.5 * parameters[0] * parameters[1],
        }
    }
}

impl std::fmt::Display for MetaModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for MetaModel {
    type Err = String;
    fn from_str(word: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|model| model.name() == word).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            format!("law `{word}` is unknown: say one of {known}")
        })
    }
}

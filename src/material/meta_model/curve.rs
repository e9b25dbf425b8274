//! The meta-models there are: the curves of the laws, in the order of the list of laws.

use crate::material::law::{
    Estimated, LAWS, Law, Material, Slope, Stability, UniaxialCurve, mooney_rivlin, neo_hookean, ogden,
};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::cmp::Ordering;

/// A law to fit.
#[derive(Clone, Copy)]
pub struct MetaModel {
    law: &'static dyn Law,
    curve: &'static dyn UniaxialCurve,
}

impl MetaModel {
    /// mu.
    pub const NEO_HOOKEAN: Self = Self { law: &neo_hookean::Definition, curve: &neo_hookean::Definition };
    /// c1, c2.
    pub const MOONEY_RIVLIN: Self = Self { law: &mooney_rivlin::Definition, curve: &mooney_rivlin::Definition };
    /// mu, alpha with |alpha| <= 5.
    pub const OGDEN: Self = Self { law: &ogden::Definition, curve: &ogden::UP_TO_5 };
    /// mu, alpha with |alpha| <= 50.
    pub const OGDEN_HIGH: Self = Self { law: &ogden::Definition, curve: &ogden::UP_TO_50 };

    /// The paper's four, in its order.
    pub const PAPER: [Self; 4] = [Self::NEO_HOOKEAN, Self::MOONEY_RIVLIN, Self::OGDEN, Self::OGDEN_HIGH];

    /// The meta-models of all laws.
    pub fn all() -> impl Iterator<Item = Self> {
        LAWS.into_iter().flat_map(|law| law.curves().iter().map(move |curve| Self { law, curve: *curve }))
    }

    /// The words of all meta-models in files and on the command line.
    pub fn names() -> Vec<&'static str> {
        Self::all().map(Self::name).collect()
    }

    /// The words of those an estimate can change the parameters of.
    pub fn estimable() -> Vec<&'static str> {
        Self::all().filter(|model| model.estimated() != Estimated::Not).map(Self::name).collect()
    }

    /// The word in files and on the command line.
    pub fn name(self) -> &'static str {
        self.curve.name()
    }

    /// Parameter names with units.
    pub fn parameter_names(self) -> &'static [&'static str] {
        self.curve.parameters()
    }

    /// W, Pa, at a stretch; parameters in the order of their names.
    pub fn energy_pa(self, parameters: &[f64], stretch: f64) -> f64 {
        self.curve.energy_pa(parameters, stretch)
    }

    /// dW / d parameters; entries beyond the parameters are unused.
    pub(super) fn energy_slope_pa(self, parameters: &[f64], stretch: f64) -> Slope {
        self.curve.energy_slope_pa(parameters, stretch)
    }

    /// Nominal stress dW/dl, Pa.
    pub fn stress_pa(self, parameters: &[f64], stretch: f64) -> f64 {
        self.curve.stress_pa(parameters, stretch)
    }

    /// d stress / d parameters; entries beyond the parameters are unused.
    pub(super) fn stress_slope_pa(self, parameters: &[f64], stretch: f64) -> Slope {
        self.curve.stress_slope_pa(parameters, stretch)
    }

    /// Shear modulus at rest, Pa.
    pub fn small_strain_shear_modulus_pa(self, parameters: &[f64]) -> f64 {
        self.law.shear_modulus_pa(&self.curve.values(parameters))
    }

    /// Where the law is stable, for parameters fitted over a window.
    pub fn stability(self, parameters: &[f64], window: [f64; 2]) -> Stability {
        self.curve.stability(parameters, window)
    }

    /// The law as a compressible material of a scenario.
    pub fn material(self, parameters: &[f64], poisson_ratio: f64) -> Material {
        Material::new(self.law, self.curve.values(parameters), poisson_ratio)
    }

    /// What an estimate may change of the law.
    pub fn estimated(self) -> Estimated {
        self.law.estimated()
    }

    /// The law's own numbers for these parameters.
    pub fn values(self, parameters: &[f64]) -> Vec<f64> {
        self.curve.values(parameters)
    }

    pub(super) fn curve(self) -> &'static dyn UniaxialCurve {
        self.curve
    }

    /// Place in the list.
    fn place(self) -> usize {
        Self::all().position(|model| model.name() == self.name()).unwrap_or(usize::MAX)
    }
}

impl PartialEq for MetaModel {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for MetaModel {}

impl PartialOrd for MetaModel {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for MetaModel {
    fn cmp(&self, other: &Self) -> Ordering {
        self.place().cmp(&other.place())
    }
}

impl std::fmt::Debug for MetaModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
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
        Self::all()
            .find(|model| model.name() == word)
            .ok_or_else(|| format!("law `{word}` is unknown: say one of {}", Self::names().join(", ")))
    }
}

impl Serialize for MetaModel {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for MetaModel {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        Self::all().find(|model| model.name() == word).ok_or_else(|| {
            let known = Self::names().iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
            D::Error::custom(format!("unknown variant `{word}`, expected one of {known}"))
        })
    }
}

//! The fitted study-level model as a file: spreads, their intervals, and what follows for a person's moduli.

use super::moduli::ModuliPrior;
use super::spreads::{SPREAD_NAMES, SPREADS, Spreads};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What `hgm gp fit --model study-level` writes and the other commands read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyLevelFile {
    /// The spreads.
    pub spreads: Spreads,
    /// Central 90 % interval of each.
    pub intervals_90: BTreeMap<String, [f64; 2]>,
    /// The moduli of a person nobody has measured.
    pub moduli: ModuliPrior,
}

impl StudyLevelFile {
    /// From what was fitted.
    pub fn new(spreads: Spreads, intervals: [[f64; 2]; SPREADS], moduli: ModuliPrior) -> Self {
        let named = SPREAD_NAMES.iter().zip(intervals);
        Self { spreads, intervals_90: named.map(|(name, interval)| ((*name).to_owned(), interval)).collect(), moduli }
    }

    /// As text.
    pub fn to_toml(&self) -> String {
        let mut text = String::from(
            "# The study-level model: standard deviations of its parts (ln Pa, slopes per unit of Hencky strain), their 90 %\n\
             # intervals, and the shear moduli of a person nobody has measured: normal in ln Pa, jointly over the tasks.\n\
             # `hgm` reads the spreads; the moduli follow from them and the studies that it is given beside them.\n\
             [spreads]\n",
        );
        for (name, value) in SPREAD_NAMES.iter().zip(self.spreads.to_array()) {
            text += &format!("{name} = {value:?}\n");
        }
        text += "\n[intervals_90]\n";
        for name in SPREAD_NAMES {
            if let Some(interval) = self.intervals_90.get(name) {
                text += &format!("{name} = {interval:?}\n");
            }
        }
        text + "\n[moduli]\n" + &self.moduli.to_toml()
    }

    /// From text.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn from_toml(text: &str) -> Result<Self, String> {
        let file: Self = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        for (name, value) in SPREAD_NAMES.iter().zip(file.spreads.to_array()) {
            // Beyond, nothing but rounding is left; the fit keeps within the same limits.
            if !(value > 1e-5 && value < 1e5) {
                return Err(format!("`{name}` is {value:?}: a spread must be between 0.00001 and 100000"));
            }
        }
        file.moduli.check()?;
        Ok(file)
    }
}

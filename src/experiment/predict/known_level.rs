//! A level of the fluid that is known: how far below the brain's highest point it will stand.

use super::uncertain::{Cause, Reading, Uncertain};
use crate::experiment::estimate::{LogPrior, Unknown};
use crate::experiment::setting::{SettingError, first_broken};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where fluid is known to stand; the table `[predict.fluid_level]` of the settings. It holds for every way of lying, each along its own
/// gravity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownLevel {
    /// How far the fluid's surface is below the highest point of the brain, along gravity of the way the head lies, mm; 0: the brain is
    /// just covered.
    pub below_top_mm: f64,
    /// How well that is known: its standard deviation, mm; 0 for exactly. 5 is about half a gyrus' width: as far as a level read off the
    /// cortex by eye may be off.
    #[serde(default = "by_eye")]
    pub sd_mm: f64,
}

fn by_eye() -> f64 {
    5.0
}

/// Deeper than any head is long, mm.
const DEEPEST_MM: f64 = 300.0;

impl KnownLevel {
    /// Refuses what no level can be.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let (below, sd) = (self.below_top_mm, self.sd_mm);
        first_broken(&[
            (
                "fluid_level.below_top_mm",
                &below,
                (0.0..=DEEPEST_MM).contains(&below),
                "0 (the brain is just covered: fluid above it carries no more) to 300 mm below the brain's highest point",
            ),
            ("fluid_level.sd_mm", &sd, (0.0..=50.0).contains(&sd), "0 (known exactly) to 50 mm"),
        ])
    }

    /// What is not known of it, for a brain that ends at this height.
    pub(super) fn uncertain(&self, top_mm: f64) -> Uncertain {
        let name = "fluid below the brain's highest point, mm".to_owned();
        let prior = LogPrior { name, ..Unknown::CsfLevel.prior(self.below_top_mm, self.sd_mm) };
        Uncertain { unknown: Unknown::CsfLevel, prior, cause: Cause::Load, reading: Reading::Below(top_mm) }
    }
}

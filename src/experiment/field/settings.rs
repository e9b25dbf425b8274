//! How displacement fields are made; the table `[fields]` of the settings.

use crate::experiment::estimate::Process;
use crate::experiment::setting::{SettingError, first_broken};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whose displacement a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The model's: of the estimate, or of the best sample where none was made.
    Model,
    /// Model and images together.
    Fused,
    /// The images' alone.
    Observed,
}

/// How displacement fields are made; the table `[fields]` of the settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FieldSettings {
    /// Which fields are written with every result; any other is made when it is asked for.
    pub states: Vec<Source>,
    /// Voxel size of the fields, mm; 0 for the scan's own grid.
    pub spacing_mm: f64,
    /// How far beyond the brain (with its fluid) the displacement has come to zero, mm: the inside of the skull.
    pub fall_mm: f64,
    /// The smallest determinant of a field's gradient; where a state folds tissue over, the field is smoothed until it
    /// has that.
    pub jacobian_least: f64,
    /// Standard deviation of one component of the seen displacement in the depth of the brain, mm.
    pub seen_noise_mm: f64,
    /// What is added to it at the skull and at the margin, where tissue slides and a registration smooths, mm.
    pub seen_border_noise_mm: f64,
    /// The depth over which that falls to a third, mm.
    pub seen_border_mm: f64,
    /// Standard deviation of one component of the seen displacement where an estimate has had the registration's own error taken out of
    /// it, mm: what a model leaves beyond that is the model's (docs/evidence/patients.md).
    pub seen_corrected_noise_mm: f64,
    /// Length over which that noise is alike, mm: that of Matern's covariance of order 3/2.
    pub seen_corrected_correlation_mm: f64,
}

impl Default for FieldSettings {
    fn default() -> Self {
        Self {
            states: vec![Source::Model, Source::Fused],
            spacing_mm: 0.0,
            fall_mm: 3.0,
            jacobian_least: 0.05,
            seen_noise_mm: 0.3,
            seen_border_noise_mm: 0.6,
            seen_border_mm: 5.0,
            seen_corrected_noise_mm: 0.055,
            seen_corrected_correlation_mm: 10.0,
        }
    }
}

impl FieldSettings {
    /// Refuses what no field can be made with.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let spacing = self.spacing_mm == 0.0 || (0.5..=10.0).contains(&self.spacing_mm);
        let positive = |x: f64| x > 0.0 && x.is_finite();
        first_broken(&[
            ("spacing_mm", &self.spacing_mm, spacing, "0 (the scan's own grid) or from 0.5 to 10"),
            ("fall_mm", &self.fall_mm, (0.0..=30.0).contains(&self.fall_mm), "from 0 to 30"),
            ("jacobian_least", &self.jacobian_least, (0.001..0.5).contains(&self.jacobian_least), "from 0.001 to 0.5"),
            ("seen_noise_mm", &self.seen_noise_mm, positive(self.seen_noise_mm), "above 0"),
            ("seen_border_noise_mm", &self.seen_border_noise_mm, self.seen_border_noise_mm >= 0.0, "0 or more"),
            ("seen_border_mm", &self.seen_border_mm, positive(self.seen_border_mm), "above 0"),
            (
                "seen_corrected_noise_mm",
                &self.seen_corrected_noise_mm,
                positive(self.seen_corrected_noise_mm),
                "above 0",
            ),
            (
                "seen_corrected_correlation_mm",
                &self.seen_corrected_correlation_mm,
                positive(self.seen_corrected_correlation_mm),
                "above 0",
            ),
        ])
    }

    /// The noise of the seen displacement where the registration's own error is taken out.
    pub fn seen_corrected_noise(&self) -> Process {
        Process { sd_mm: self.seen_corrected_noise_mm, length_mm: self.seen_corrected_correlation_mm }
    }

    /// Standard deviation of one component of the seen displacement at a depth below skull or margin, mm.
    pub fn seen_noise_at(&self, depth_mm: f64) -> f64 {
        self.seen_noise_mm.hypot(self.seen_border_noise_mm * (-depth_mm.max(0.0) / self.seen_border_mm).exp())
    }
}

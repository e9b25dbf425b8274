//! The measures of a scan's quality, in words: names, units, which side is good, and the step that matters.

use crate::segment::{Air, ScanQualities, ScanQuality};
use schemars::JsonSchema;
use serde::Serialize;

/// On which side of the others a measure is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Good {
    /// The higher the better.
    High,
    /// The lower the better.
    Low,
}

/// Which scan of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WhichScan {
    /// Before the operation.
    Pre,
    /// After it.
    Post,
}

/// A measure of [`ScanQuality`].
#[derive(Clone, Copy, Debug)]
pub struct ScanMeasure {
    /// In files: with the unit at its end.
    pub column: &'static str,
    /// For readers.
    pub name: &'static str,
    /// For readers; empty for a pure number.
    pub unit: &'static str,
    /// The good side.
    pub good: Good,
    /// What it tells, and which side is good.
    pub hint: &'static str,
    /// Differences below this mean little: a cohort's scans are not held to be more alike than that.
    pub step: f64,
    /// Digits that are shown after the point.
    pub decimals: usize,
    /// Its value.
    pub of: fn(&ScanQuality) -> Option<f64>,
}

/// Every measure, in the order of tables.
pub const SCAN_MEASURES: [ScanMeasure; 11] = [
    ScanMeasure {
        column: "contrast_to_noise",
        name: "contrast to noise",
        unit: "",
        good: Good::High,
        hint: "higher is better: grey and white matter lie farther apart than noise spreads them",
        step: 0.1,
        decimals: 2,
        of: |scan| scan.contrast_to_noise,
    },
    ScanMeasure {
        column: "white_signal_to_noise",
        name: "signal to noise of white matter",
        unit: "",
        good: Good::High,
        hint: "higher is better: white matter is of one brightness",
        step: 1.0,
        decimals: 1,
        of: |scan| scan.white_signal_to_noise,
    },
    ScanMeasure {
        column: "entropy_focus",
        name: "entropy focus criterion",
        unit: "",
        good: Good::Low,
        hint: "lower is better: motion's ghosts and blur raise it; compare scans of one protocol only",
        step: 0.02,
        decimals: 3,
        of: |scan| scan.entropy_focus,
    },
    ScanMeasure {
        column: "air_artefact_percent",
        name: "artefacts in the air",
        unit: "%",
        good: Good::Low,
        hint: "lower is better: what is brighter than noise around the head is a ghost of motion, wrapping or a spike",
        step: 0.1,
        decimals: 2,
        of: |scan| scan.air_artefact_percent,
    },
    ScanMeasure {
        column: "coverage_percent",
        name: "brain in the field of view",
        unit: "%",
        good: Good::High,
        hint: "100 is good: nothing is said of what lies outside",
        step: 0.5,
        decimals: 1,
        of: |scan| Some(scan.coverage_percent),
    },
    ScanMeasure {
        column: "gain_times",
        name: "white matter's brightest over darkest part",
        unit: "times",
        good: Good::Low,
        hint: "near 1 is good: more is the coil's shading",
        step: 0.05,
        decimals: 2,
        of: |scan| scan.gain_times,
    },
    ScanMeasure {
        column: "largest_voxel_mm",
        name: "longest edge of a voxel",
        unit: "mm",
        good: Good::Low,
        hint: "about 1 mm is good: nothing thinner is seen",
        step: 0.1,
        decimals: 2,
        of: |scan| scan.voxel_mm.into_iter().reduce(f64::max),
    },
    ScanMeasure {
        column: "anisotropy",
        name: "longest over shortest edge",
        unit: "",
        good: Good::Low,
        hint: "1 is good: a cube sees every direction alike",
        step: 0.1,
        decimals: 2,
        of: |scan| Some(scan.anisotropy),
    },
    ScanMeasure {
        column: "template_correlation",
        name: "fit of the template",
        unit: "",
        good: Good::High,
        hint: "higher is better: how alike template and scan are once one lies on the other",
        step: 0.02,
        decimals: 2,
        of: |scan| scan.template_correlation,
    },
    ScanMeasure {
        column: "least_sure_part_percent",
        name: "labels of the least sure part of the brain",
        unit: "%",
        good: Good::High,
        hint: "higher is better: how many of them are expected to be right",
        step: 1.0,
        decimals: 0,
        of: ScanQuality::least_confidence_percent,
    },
    ScanMeasure {
        column: "most_outside_part_percent",
        name: "most of any part of the brain outside",
        unit: "%",
        good: Good::Low,
        hint: "0 is good: nothing is said of what lies outside the field of view",
        step: 2.0,
        decimals: 0,
        of: ScanQuality::most_outside_percent,
    },
];

impl WhichScan {
    /// Both, in order.
    pub const ALL: [Self; 2] = [Self::Pre, Self::Post];

    /// In front of a column's name.
    pub fn prefix(self) -> &'static str {
        match self {
            Self::Pre => "pre",
            Self::Post => "post",
        }
    }

    /// For readers.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Pre => "before surgery",
            Self::Post => "after surgery",
        }
    }

    /// This scan of a case, where it was measured.
    pub fn of(self, scans: Option<&ScanQualities>) -> Option<&ScanQuality> {
        match self {
            Self::Pre => scans?.pre.as_ref(),
            Self::Post => scans?.post.as_ref(),
        }
    }
}

impl ScanMeasure {
    /// The name of its column for a scan.
    pub fn column_of(&self, scan: WhichScan) -> String {
        format!("{}_{}", scan.prefix(), self.column)
    }

    /// A value with its unit.
    pub fn with_unit(&self, value: f64) -> String {
        let text = super::html::fixed(value, self.decimals);
        if self.unit.is_empty() { text } else { format!("{text} {}", self.unit) }
    }

    /// Its value of a scan in words; why there is none, otherwise.
    pub fn in_words(&self, scan: Option<&ScanQuality>) -> String {
        let Some(scan) = scan else { return "not measured".to_owned() };
        let of_air = ["entropy_focus", "air_artefact_percent"].contains(&self.column);
        match ((self.of)(scan), scan.air) {
            (Some(value), _) => self.with_unit(value),
            (None, Air::Blank) if of_air => "cannot be told: the air is blank (stripped, masked or defaced)".to_owned(),
            (None, Air::Outside) if of_air => "cannot be told: no air in the field of view".to_owned(),
            (None, _) => "–".to_owned(),
        }
    }
}

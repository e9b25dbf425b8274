//! What somebody gave for a brain, and how much of the expected one it may leave out.

use super::region::Region;
use serde::{Deserialize, Serialize};

/// What somebody gave for a brain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GivenBrain {
    /// A mask; the template is fitted to the scan.
    Mask,
    /// A label map; the template is fitted to the map itself, and follows a part of what it leaves out.
    Labels,
}

impl GivenBrain {
    /// Percent of one part of the brain that is noted, and of the whole that is too much. Of maps of six heads 1 % at most of any part was
    /// left out (FreeSurfer's, hgm's own), of hgm's masks of five without their fluid, or drawn in by 2 mm, 24 % of any and 14 % of the whole
    /// (docs/evidence/choices.md).
    pub(super) fn limits(self) -> [f64; 2] {
        match self {
            Self::Mask => [28.0, 25.0],
            Self::Labels => [10.0, 12.0],
        }
    }

    /// Whether this is more than a lesion, an earlier resection or another rule for the outline: one part mostly gone, or much of all.
    pub fn is_of_another_brain(self, parts: &[(Region, f64)], percent: f64) -> bool {
        /// After an earlier operation on a lobe about half of it is gone.
        const MOST_OF_PART: f64 = 55.0;
        percent >= self.limits()[1] || parts.iter().any(|(_, part)| *part >= MOST_OF_PART)
    }
}

impl std::fmt::Display for GivenBrain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Mask => "brain mask",
            Self::Labels => "label map",
        })
    }
}

//! What is taken for a brain, and how much of the expected one it may leave out.

use super::region::Region;
use serde::{Deserialize, Serialize};

/// Where what is taken for a brain comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BrainSource {
    /// A mask; the template is fitted to the scan.
    Mask,
    /// A label map; the template is fitted to the map itself, and follows a part of what it leaves out.
    Labels,
    /// Nobody gave one: it was found with the template, and leaves out what does not look like brain.
    Found,
}

impl BrainSource {
    /// From how many percent of one part of the brain on it is told. Of maps of six heads 1 % at most of any part was left out
    /// (FreeSurfer's, hgm's own), of hgm's masks of four heads without their fluid, or drawn in by 2 mm, 24 % (docs/evidence/choices.md);
    /// of brains found in nine heads 10, and 12 beside a stroke's cavity.
    pub(super) fn noted_percent(self) -> f64 {
        match self {
            Self::Mask => 28.0,
            Self::Labels => 10.0,
            Self::Found => 20.0,
        }
    }

    /// How many percent of the whole are too much: of those masks 14 were left out, of the maps 1.
    pub(super) fn most_percent(self) -> f64 {
        match self {
            Self::Mask => 25.0,
            Self::Labels => 12.0,
            Self::Found => 15.0,
        }
    }

    /// What to ask oneself then.
    pub(super) fn question(self) -> &'static str {
        match self {
            Self::Mask | Self::Labels => "is it of this scan, and whole?",
            Self::Found => {
                "a lesion, or the outline cuts the brain there; look at it, and give a brain mask where it is wrong"
            }
        }
    }

    /// Whether more is left out than by a lesion, an earlier resection or another rule for the outline: one part mostly, or much of all.
    pub(super) fn leaves_too_much(self, parts: &[(Region, f64)], percent: f64) -> bool {
        /// An earlier operation on a lobe takes a part of it.
        const MOST_OF_PART: f64 = 55.0;
        // A lesion may take as much of a brain that was found: it is told, and a person looks.
        self != Self::Found && (percent >= self.most_percent() || parts.iter().any(|(_, part)| *part >= MOST_OF_PART))
    }
}

impl std::fmt::Display for BrainSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Mask => "brain mask",
            Self::Labels => "label map",
            Self::Found => "brain that was found",
        })
    }
}

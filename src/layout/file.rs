//! One row of the table.

use super::bids::BidsName;
use serde::Serialize;

/// A file (or a family of files) of a case.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Entry {
    /// Below the case folder; a part in braces stands for the member of a family: `sim/{sample}.vtu`.
    pub path: &'static str,
    /// What it is, for a reader.
    pub what: &'static str,
    /// Where its coordinates are.
    pub space: Space,
    /// Who makes it.
    pub maker: Maker,
    /// Its name in BIDS derivatives; `None` where BIDS has no name for such a file.
    #[serde(skip)]
    pub bids: Option<BidsName>,
}

/// The frame of a file's coordinates: mm, RAS+.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Space {
    /// The template's, reached rigidly: sizes stay the patient's.
    Mni,
    /// The pre-operative scanner's.
    Pre,
    /// The post-operative scanner's.
    Post,
    /// From one frame to another, as its name says.
    Transform,
    /// Numbers and texts.
    None,
}

/// The stage, or the step after all stages, that writes a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Maker {
    /// Both scans registered.
    Registration,
    /// Masks and labels.
    Anat,
    /// The tagged mesh of the tissue.
    Mesh,
    /// What is matched: the surfaces of the post-operative scan, or a phantom's known state.
    Reference,
    /// One simulation.
    Sample,
    /// The most probable moduli.
    Estimate,
    /// Displacement fields, and what they carry.
    Fields,
    /// Models beside each other.
    Compare,
    /// How a planned patient's brain will move.
    Predict,
    /// The numbers gathered, with the settings and the provenance.
    Outcome,
    /// The page and the files for other viewers.
    Report,
}

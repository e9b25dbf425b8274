//! What is known of a file: where it came from, by which settings.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Beside every output: program version, settings, checksums of inputs and output, seed, frame, units, warnings.
/// No time, no path, no patient's name: the same input and settings give the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// `hgm x.y.z`.
    pub program: String,
    /// The stage that made the outputs.
    pub stage: String,
    /// SHA-256 over stage, version, settings and inputs: what decides whether the stage may be skipped.
    pub key: String,
    /// The resolved settings.
    pub settings: serde_json::Value,
    /// SHA-256 of every input by its role.
    pub inputs: BTreeMap<String, String>,
    /// The outputs by file name.
    pub outputs: BTreeMap<String, OutputRecord>,
    /// Where and in which units.
    pub provenance: Provenance,
    /// What a reader must know before trusting the outputs.
    pub warnings: Vec<String>,
    /// Figures a later stage or the report needs.
    pub facts: serde_json::Value,
}

/// One output file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputRecord {
    /// Checksum of the bytes.
    pub sha256: String,
}

/// Frame, units, seed of a stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Frame of the coordinates (`geometry::Frame::NAME`).
    pub frame: String,
    /// Units of coordinates and moduli.
    pub units: String,
    /// The seed, where something random was done.
    pub seed: Option<u64>,
}

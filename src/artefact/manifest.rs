//! What is known of a file: where it came from, by which settings.

use super::reason::Reason;
use super::write::sha256_hex;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

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

impl Manifest {
    /// Where the manifest of a stage lies below its folder.
    pub fn path_of_stage(folder: &Path, stage: &str) -> PathBuf {
        folder.join(format!(".stages/{stage}.manifest.json"))
    }

    /// The manifest of a stage, when it has finished in this folder.
    pub fn of_stage(folder: &Path, stage: &str) -> Option<Self> {
        serde_json::from_str(&std::fs::read_to_string(Self::path_of_stage(folder, stage)).ok()?).ok()
    }

    /// Those of every stage that has finished in this folder, by the stages' names.
    pub fn all_of(folder: &Path) -> Vec<Self> {
        let entries = std::fs::read_dir(folder.join(".stages")).into_iter().flatten().flatten();
        let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
        let stages = names.filter_map(|name| name.strip_suffix(".manifest.json").map(str::to_owned));
        let mut all: Vec<Self> = stages.filter_map(|stage| Self::of_stage(folder, &stage)).collect();
        all.sort_by(|a, b| a.stage.cmp(&b.stage));
        all
    }

    /// The figures that a later stage or the report needs. Through their text: of two ways to read a type the compiler makes both.
    ///
    /// # Errors
    /// Figures of another kind.
    pub fn figures<T: DeserializeOwned>(&self) -> serde_json::Result<T> {
        serde_json::from_str(&self.facts.to_string())
    }

    /// One checksum of everything the stage made: what a later stage takes as its input.
    ///
    /// # Panics
    /// Never: checksums are plain data.
    pub fn made_sha256(&self) -> String {
        let all = serde_json::to_string(&(&self.outputs, &self.facts)).expect("checksums are plain data");
        sha256_hex(all.as_bytes())
    }

    /// A reason per output that is not in `folder` as it was written.
    pub fn changed_outputs(&self, folder: &Path) -> Vec<Reason> {
        let change = |(name, record): (&String, &OutputRecord)| match std::fs::read(folder.join(name)) {
            Err(_) => Some(Reason::OutputMissing { file: name.clone() }),
            Ok(bytes) if sha256_hex(&bytes) != record.sha256 => Some(Reason::OutputChanged { file: name.clone() }),
            Ok(_) => None,
        };
        self.outputs.iter().filter_map(change).collect()
    }

    /// Takes the stage's files away, its own manifest first: nothing is left that vouches for a part of them.
    pub fn remove(&self, folder: &Path) {
        std::fs::remove_file(Self::path_of_stage(folder, &self.stage)).ok();
        self.outputs.keys().for_each(|name| remove_output(folder, name));
    }

    /// A reason per earlier stage whose files in `folder` are not those this stage was made from.
    pub fn changed_stages(&self, folder: &Path) -> Vec<Reason> {
        let change = |(role, sum): (&String, &String)| {
            let earlier = Self::of_stage(folder, role.strip_prefix("stage ")?)?;
            (earlier.made_sha256() != *sum).then(|| Reason::Input { role: role.clone() })
        };
        self.inputs.iter().filter_map(change).collect()
    }
}

/// Takes one output away with the manifest beside it.
pub(super) fn remove_output(folder: &Path, name: &str) {
    std::fs::remove_file(folder.join(format!("{name}.manifest.json"))).ok();
    std::fs::remove_file(folder.join(name)).ok();
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

//! A patient's folder and the stages that fill it.
//!
//! Every stage reads what it needs from files and writes files: a stage that was skipped and one that was run leave
//! the next one the same bytes to start from.

mod anat;
mod estimate;
mod mesh;
mod observed;
mod registration;
mod sag;
mod samples;
mod scans;

pub use anat::{AnatFacts, Anatomy, anat, anat_stage};
pub use estimate::{ESTIMATE, EstimateFacts, EstimateInput, EstimateOptions, estimate};
pub use mesh::{MeshFacts, MeshOptions, mesh, mesh_outcome, mesh_settings, mesh_stage, no_mesh, programs};
pub use observed::{observed_surfaces, reference, reference_stage};
pub use registration::{RegistrationFacts, mni_from_gravity_frame, registration, registration_stage};
pub use sag::Sag;
pub use samples::{PriorOptions, SampleMode, Sweep, rest_mesh, sample_stage, samples};
pub use scans::{Overrides, OwnMasks, ScanSums, Scans};

use super::Session;
use super::failure::{Failure, Reject};
use super::settings_file;
use crate::artefact::{Manifest, Produced, Stage, StageError, write_whole};
use crate::experiment::outcome::ExperimentOutcome;
use crate::image::nifti::ReadOptions;
use crate::report::case::{ReportError, write_report};
use anyhow::anyhow;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// `xfm/from-pre_to-MNI.txt`: 4x4, RAS, mm.
pub const MNI_FROM_PRE: &str = "xfm/from-pre_to-MNI";
/// `xfm/from-post_to-pre.txt`: 4x4, RAS, mm.
pub const PRE_FROM_POST: &str = "xfm/from-post_to-pre";
/// The rest mesh: tissue without the resected part, with its sets.
pub const REST_MESH: &str = "mesh/rest.vtu";
/// The experiment's numbers.
pub const OUTCOME: &str = "sim/outcome.json";

/// Every setting that was used, by room.
const SETTINGS: &str = "settings.toml";
/// A phantom's reference state.
pub const REFERENCE_STATE: &str = "sim/reference.vtu";

/// A stage's settings with how the user's files are read: another volume of the same file is another scan.
#[derive(Serialize)]
struct WithReading<'a, S> {
    #[serde(flatten)]
    settings: &'a S,
    image: ReadOptions,
}

/// What a case folder holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A pair of scans.
    Patient,
    /// The template with known moduli.
    Phantom,
    /// Nothing of hgm's.
    Other,
}

/// A case folder.
#[derive(Clone, Debug)]
pub struct Case {
    /// Where it lies.
    pub folder: PathBuf,
    /// Compute everything again.
    pub force: bool,
}

impl Case {
    /// The case folder named on the command line.
    pub fn open(folder: &Path, session: &Session) -> Self {
        Self { folder: folder.to_path_buf(), force: session.options.force }
    }

    /// Writes outcome, samples table, resolved settings and provenance, then the page; returns the page's path.
    ///
    /// # Errors
    /// The disk's, or a figure that is not a number.
    pub fn finish(
        &self,
        outcome: &ExperimentOutcome,
        settings: &BTreeMap<&str, serde_json::Value>,
        manifests: &[Manifest],
    ) -> Result<String, Failure> {
        self.write_outcome(outcome)?;
        self.write_settings(settings)?;
        self.write_provenance(manifests)?;
        self.write_page()
    }

    /// `sim/outcome.json` and `sim/samples.csv`.
    ///
    /// # Errors
    /// The disk's, or a figure that is not a number.
    pub fn write_outcome(&self, outcome: &ExperimentOutcome) -> Result<(), Failure> {
        write_whole(&self.path(OUTCOME), outcome.to_json(OUTCOME)?.as_bytes())?;
        Ok(write_whole(&self.path("sim/samples.csv"), samples_table(outcome).as_bytes())?)
    }

    /// The settings of a room: this call's where its settings file has the table, else those the case was made with.
    ///
    /// # Errors
    /// A table that is not of this room.
    pub fn settings_of<T: DeserializeOwned + Default>(&self, room: &str, session: &Session) -> Result<T, Failure> {
        if session.has_table(room) || !self.path(SETTINGS).exists() {
            return session.settings(room);
        }
        let (text, file) = (self.read_text(SETTINGS)?, self.path(SETTINGS).display().to_string());
        match settings_file::tables(&text, &file)?.get(room) {
            None => session.settings(room),
            Some(table) => settings_file::typed(table).map_err(|e| anyhow!("{file}: table [{room}]: {e}")).reject(),
        }
    }

    /// Takes `settings.toml` away, so that only this call's settings count.
    pub fn forget_settings(&self) {
        std::fs::remove_file(self.path(SETTINGS)).ok();
    }

    /// A stage's manifest and facts as an earlier call left them.
    ///
    /// # Errors
    /// Rejected when the stage has not been run here.
    pub fn stage_facts<T: DeserializeOwned>(&self, stage: &str) -> Result<(Manifest, T), Failure> {
        let name = format!(".stages/{stage}.manifest.json");
        self.read(&name)?;
        let other = || anyhow!("{}: {name} is damaged or another version's; {}", self.folder.display(), self.remedy());
        let manifest = Manifest::of_stage(&self.folder, stage).ok_or_else(other).reject()?;
        let facts = serde_json::from_value(manifest.facts.clone()).map_err(|_| other()).reject()?;
        Ok((manifest, facts))
    }

    /// `settings.toml`: every setting that was used, by room.
    ///
    /// # Errors
    /// The disk's.
    pub fn write_settings(&self, settings: &BTreeMap<&str, serde_json::Value>) -> Result<(), Failure> {
        // TOML has no null: what is null is left out.
        let mut settings = serde_json::to_value(settings)?;
        without_nulls(&mut settings);
        Ok(write_whole(&self.path(SETTINGS), toml::to_string(&settings)?.as_bytes())?)
    }

    /// `provenance.json`: program, stages, checksums of inputs and outputs.
    ///
    /// # Errors
    /// The disk's.
    pub fn write_provenance(&self, manifests: &[Manifest]) -> Result<(), Failure> {
        let stages: Vec<_> = manifests
            .iter()
            .map(|m| serde_json::json!({"stage": m.stage, "key": m.key, "inputs": m.inputs, "outputs": m.outputs}))
            .collect();
        let program = concat!("hgm ", env!("CARGO_PKG_VERSION"));
        let text = serde_json::to_string_pretty(&serde_json::json!({"program": program, "stages": stages}))?;
        Ok(write_whole(&self.path("provenance.json"), text.as_bytes())?)
    }

    /// `report.html`; returns its path.
    ///
    /// # Errors
    /// A file of the case that cannot be used.
    pub fn write_page(&self) -> Result<String, Failure> {
        let page = write_report(&self.folder).map_err(|error| match error {
            ReportError::Write(error) => Failure::Failed(error.into()),
            damaged => Failure::Rejected(damaged.into()),
        })?;
        Ok(page.display().to_string())
    }

    /// A file of the case.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The bytes of a file of the case.
    ///
    /// # Errors
    /// Rejected with the command that makes the file.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, Failure> {
        let said = |error: std::io::Error| {
            let folder = self.folder.display();
            if self.kind() == Kind::Other {
                anyhow!("{folder}: not a case folder; name one that `hgm prep`, `hgm run` or `hgm phantom` has made")
            } else if error.kind() == std::io::ErrorKind::NotFound {
                anyhow!("{folder}: {name} is not there; {}", self.remedy())
            } else {
                anyhow!("{folder}: {name} cannot be read ({error}); check its permissions")
            }
        };
        std::fs::read(self.path(name)).map_err(said).reject()
    }

    /// What the folder is by the manifests in it.
    pub fn kind(&self) -> Kind {
        let has = |stage: &str| self.path(&format!(".stages/{stage}.manifest.json")).exists();
        if has("registration") {
            Kind::Patient
        } else if has("labels") {
            Kind::Phantom
        } else {
            Kind::Other
        }
    }

    /// The command that makes this folder's files again.
    fn remedy(&self) -> String {
        let folder = self.folder.display();
        match self.kind() {
            Kind::Phantom => format!("run `hgm phantom -o {folder} --force` again"),
            _ => format!("run `hgm prep PRE POST -o {folder}` again"),
        }
    }

    /// A text file of the case.
    ///
    /// # Errors
    /// As [`Case::read`]; also when it is not UTF-8.
    pub fn read_text(&self, name: &str) -> Result<String, Failure> {
        let said = |_| anyhow!("{}: {name} is not text, so it is damaged; {}", self.folder.display(), self.remedy());
        String::from_utf8(self.read(name)?).map_err(said).reject()
    }

    /// Runs a stage, saying on stderr whether it was skipped; returns its manifest and typed facts.
    ///
    /// # Errors
    /// The stage's own failure, or the disk's.
    pub fn run<Facts: DeserializeOwned>(
        &self,
        stage: &Stage,
        name: &str,
        compute: impl FnOnce() -> Result<Produced, Failure>,
    ) -> Result<(Manifest, Facts), Failure> {
        let outcome = stage.run(self.force, compute).map_err(|error| match error {
            StageError::Compute(failure) => failure,
            StageError::Write(error) => Failure::Failed(error.into()),
        })?;
        tracing::info!("{name}: {}", if outcome.skipped { "already there, skipped" } else { "done" });
        for reason in &outcome.reasons {
            tracing::info!("{name}: it ran because {reason}");
        }
        for warning in &outcome.manifest.warnings {
            // Some say themselves whose they are, for the page.
            let told = warning.strip_prefix(&format!("{name}: ")).unwrap_or(warning);
            tracing::warn!("{name}: {told}");
        }
        let facts = serde_json::from_value(outcome.manifest.facts.clone())
            .map_err(|_| anyhow!("{name}: what another version of hgm noted cannot be read; run again with --force"))?;
        Ok((outcome.manifest, facts))
    }
}

/// `sim/samples.csv`: a line per sample.
fn samples_table(outcome: &ExperimentOutcome) -> String {
    let sets = outcome.rmse_sets();
    let mut head = vec!["sample".to_owned()];
    head.extend(outcome.tissues.iter().flat_map(|t| [format!("{t}_sd_level"), format!("{t}_shear_modulus_pa")]));
    head.extend(sets.iter().map(|set| format!("rmse_{set}_mm")));
    head.extend(sets.iter().map(|set| format!("surface_distance_{set}_mm")));
    head.extend(["converged", "newton_iterations", "displacement_max_mm"].map(str::to_owned));
    let mut lines = vec![head.join(",")];
    let cell = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
    for sample in &outcome.samples {
        let mut line = vec![sample.id.clone()];
        for tissue in &outcome.tissues {
            line.push(cell(sample.sd_levels.get(tissue).copied()));
            line.push(cell(sample.shear_modulus_pa.get(tissue).copied()));
        }
        line.extend(sets.iter().map(|set| cell(sample.rmse_mm.get(set).copied())));
        line.extend(sets.iter().map(|set| cell(sample.surface_distance_mm.get(set).copied())));
        line.extend([sample.converged.to_string(), sample.newton_iterations.to_string()]);
        line.push(cell(sample.displacement_max_mm));
        lines.push(line.join(","));
    }
    lines.join("\n") + "\n"
}

fn without_nulls(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Object(map) => {
            map.retain(|_, v| !v.is_null());
            map.values_mut().for_each(without_nulls);
        }
        serde_json::Value::Array(items) => items.iter_mut().for_each(without_nulls),
        _ => {}
    }
}

/// Facts as a manifest keeps them.
pub fn facts(value: &impl Serialize) -> Result<serde_json::Value, Failure> {
    Ok(serde_json::to_value(value)?)
}

/// The last part of a path: what messages and manifests may say of a patient's file.
pub(super) fn shown(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

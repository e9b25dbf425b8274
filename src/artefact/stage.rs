//! A stage on disk: skipped when nothing that matters has changed.

use super::manifest::{Manifest, OutputRecord, Provenance, remove_output};
use super::reason::Reason;
use super::write::{WriteError, sha256_hex, write_whole};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A function on values whose results live in files. Build it with every input and setting that can change the result.
#[derive(Clone, Debug)]
pub struct Stage {
    name: String,
    version: u32,
    folder: PathBuf,
    settings: Value,
    inputs: BTreeMap<String, String>,
    provenance: Provenance,
}

/// What a stage's function gives back.
#[derive(Clone, Debug, Default)]
pub struct Produced {
    /// Bytes by path relative to the stage's folder.
    pub files: Vec<(String, Vec<u8>)>,
    /// What a reader must know.
    pub warnings: Vec<String>,
    /// Figures for later stages and the report.
    pub facts: Value,
}

impl Produced {
    /// Adds what a reader must know: values of the rooms, kept as their sentences.
    pub fn warn<W: ToString>(&mut self, warnings: impl IntoIterator<Item = W>) {
        self.warnings.extend(warnings.into_iter().map(|warning| warning.to_string()));
    }
}

/// How the stage ended.
#[derive(Clone, Debug)]
pub struct StageOutcome {
    /// Whether the files were already there.
    pub skipped: bool,
    /// Why it ran (see [`Stage::why`]); empty when it was skipped or forced.
    pub reasons: Vec<Reason>,
    /// The manifest, old or new.
    pub manifest: Manifest,
}

/// Why a stage did not end.
#[derive(Debug, Error)]
pub enum StageError<E> {
    /// The function itself failed.
    #[error(transparent)]
    Compute(E),
    /// The disk refused.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl Stage {
    /// A stage named `name` (its manifest is `.stages/NAME.manifest.json`), whose code is at `version`, with outputs
    /// below `folder`.
    ///
    /// # Panics
    /// When the settings cannot be serialised, a programming error.
    pub fn new(name: &str, version: u32, folder: &Path, settings: &impl Serialize) -> Self {
        Self {
            name: name.to_owned(),
            version,
            folder: folder.to_path_buf(),
            settings: serde_json::to_value(settings).expect("settings are plain data"),
            inputs: BTreeMap::new(),
            provenance: Provenance { frame: String::new(), units: "mm, RAS+, Pa".to_owned(), seed: None },
        }
    }

    /// Adds an input by role; a change of its bytes makes the stage run again.
    #[must_use]
    pub fn input(mut self, role: &str, bytes: &[u8]) -> Self {
        self.inputs.insert(role.to_owned(), sha256_hex(bytes));
        self
    }

    /// The same for bytes of which only the checksum is known.
    #[must_use]
    pub fn input_sha256(mut self, role: &str, sha256: &str) -> Self {
        self.inputs.insert(role.to_owned(), sha256.to_owned());
        self
    }

    /// Adds everything an earlier stage made as one input.
    ///
    /// # Panics
    /// Never: checksums are plain data.
    #[must_use]
    pub fn after(self, earlier: &Manifest) -> Self {
        let sum = earlier.made_sha256();
        self.input_sha256(&format!("stage {}", earlier.stage), &sum)
    }

    /// The same inputs of these roles that this stage was made with before.
    #[must_use]
    pub fn inputs_of(self, earlier: &Manifest, is_one: impl Fn(&str) -> bool) -> Self {
        let same = earlier.inputs.iter().filter(|(role, _)| is_one(role));
        same.fold(self, |stage, (role, sum)| stage.input_sha256(role, sum))
    }

    /// The stage's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// States the frame of the coordinates.
    #[must_use]
    pub fn frame(mut self, frame: &str) -> Self {
        frame.clone_into(&mut self.provenance.frame);
        self
    }

    /// States the seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.provenance.seed = Some(seed);
        self
    }

    /// What decides whether the stage may be skipped.
    pub fn key(&self) -> String {
        let parts = serde_json::json!({
            "program": env!("CARGO_PKG_VERSION"), "stage": self.name, "version": self.version,
            "settings": self.settings, "inputs": self.inputs, "seed": self.provenance.seed,
        });
        sha256_hex(parts.to_string().as_bytes())
    }

    /// The manifest left by an earlier run, if it can be read.
    pub fn previous(&self) -> Option<Manifest> {
        Manifest::of_stage(&self.folder, &self.name)
    }

    /// Why the stage would run now: a reason per changed input or setting; empty when it would be skipped.
    pub fn why(&self) -> Vec<Reason> {
        let Some(old) = self.previous() else {
            return vec![Reason::NotFinished];
        };
        let mut reasons = Vec::new();
        for role in self.inputs.keys().chain(old.inputs.keys().filter(|role| !self.inputs.contains_key(*role))) {
            if self.inputs.get(role) != old.inputs.get(role) {
                reasons.push(Reason::Input { role: role.clone() });
            }
        }
        changed_settings("", &old.settings, &self.settings, &mut reasons);
        reasons.extend(old.changed_outputs(&self.folder));
        if reasons.is_empty() && old.key != self.key() {
            reasons.push(Reason::Program);
        }
        reasons
    }

    /// Skips when nothing changed (unless `force`), else computes, writes every file with `NAME.manifest.json` beside it,
    /// and last the stage's own manifest.
    ///
    /// # Panics
    /// Never: a manifest is plain data.
    ///
    /// # Errors
    /// [`StageError`]: the function's own error (nothing written) or the disk's.
    pub fn run<E>(
        &self,
        force: bool,
        compute: impl FnOnce() -> Result<Produced, E>,
    ) -> Result<StageOutcome, StageError<E>> {
        let reasons = self.why();
        if !force
            && reasons.is_empty()
            && let Some(manifest) = self.previous()
        {
            return Ok(StageOutcome { skipped: true, reasons, manifest });
        }
        let produced = compute().map_err(StageError::Compute)?;
        Ok(self.written(reasons, produced)?)
    }

    /// Writes what was computed in place of what an earlier run left.
    fn written(&self, reasons: Vec<Reason>, produced: Produced) -> Result<StageOutcome, WriteError> {
        // The old manifest must not vouch for a mixture of old and new files, nor may a file stay that is made no more.
        let old = self.previous();
        std::fs::remove_file(self.manifest_path()).ok();
        let made = |name: &String| produced.files.iter().any(|(file, _)| file == name);
        for name in old.iter().flat_map(|old| old.outputs.keys()).filter(|name| !made(name)) {
            remove_output(&self.folder, name);
        }
        // Side by side: while one waits for the disk, another is hashed.
        let written = |(name, bytes): &(String, Vec<u8>)| {
            write_whole(&self.folder.join(name), bytes)?;
            Ok::<_, WriteError>((name.clone(), OutputRecord { sha256: sha256_hex(bytes) }))
        };
        let outputs = produced.files.par_iter().with_max_len(1).map(written).collect::<Result<BTreeMap<_, _>, _>>()?;
        let mut manifest = Manifest {
            program: concat!("hgm ", env!("CARGO_PKG_VERSION")).to_owned(),
            stage: self.name.clone(),
            key: self.key(),
            settings: self.settings.clone(),
            inputs: self.inputs.clone(),
            outputs: BTreeMap::new(),
            provenance: self.provenance.clone(),
            warnings: produced.warnings,
            facts: produced.facts,
        };
        let text = |manifest: &Manifest| serde_json::to_string_pretty(manifest).expect("a manifest is plain data");
        outputs.par_iter().try_for_each(|(name, record)| {
            let one = Manifest { outputs: BTreeMap::from([(name.clone(), record.clone())]), ..manifest.clone() };
            write_whole(&self.folder.join(format!("{name}.manifest.json")), text(&one).as_bytes())
        })?;
        manifest.outputs = outputs;
        write_whole(&self.manifest_path(), text(&manifest).as_bytes())?;
        Ok(StageOutcome { skipped: false, reasons, manifest })
    }

    fn manifest_path(&self) -> PathBuf {
        Manifest::path_of_stage(&self.folder, &self.name)
    }
}

fn changed_settings(path: &str, old: &Value, new: &Value, reasons: &mut Vec<Reason>) {
    if let (Value::Object(a), Value::Object(b)) = (old, new) {
        for name in b.keys().chain(a.keys().filter(|name| !b.contains_key(*name))) {
            let dotted = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            changed_settings(
                &dotted,
                a.get(name).unwrap_or(&Value::Null),
                b.get(name).unwrap_or(&Value::Null),
                reasons,
            );
        }
    } else if old != new {
        reasons.push(Reason::Setting { name: path.to_owned(), old: old.clone(), new: new.clone() });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn produce(text: &str) -> Produced {
        let files = vec![("a/x.txt".to_owned(), text.as_bytes().to_vec())];
        Produced { files, facts: serde_json::json!({"length": text.len()}), ..Produced::default() }
    }

    fn never() -> Result<Produced, Infallible> {
        panic!("a finished stage ran again")
    }

    #[test]
    fn a_finished_stage_is_skipped_until_something_changes() {
        let folder = tempfile::tempdir().unwrap();
        let stage = |input: &[u8], setting: i32| {
            Stage::new("s", 1, folder.path(), &serde_json::json!({"depth": setting})).input("scan", input)
        };
        assert!(!stage(b"1", 1).run(false, || Ok::<_, Infallible>(produce("hello"))).unwrap().skipped);
        assert!(stage(b"1", 1).run(false, never).unwrap().skipped);
        assert_eq!(stage(b"2", 1).why(), [Reason::Input { role: "scan".to_owned() }]);
        assert_eq!(stage(b"1", 2).why()[0].to_string(), "setting `depth` changed from 1 to 2");
        assert!(
            !stage(b"1", 1).run(true, || Ok::<_, Infallible>(produce("hello"))).unwrap().skipped,
            "--force computes again"
        );
        std::fs::write(folder.path().join("a/x.txt"), "tampered").unwrap();
        assert_eq!(stage(b"1", 1).why(), [Reason::OutputChanged { file: "a/x.txt".to_owned() }]);
        assert!(!stage(b"1", 1).run(false, || Ok::<_, Infallible>(produce("hello"))).unwrap().skipped);
    }

    #[test]
    fn a_file_that_is_made_no_more_goes_with_its_manifest() {
        let folder = tempfile::tempdir().unwrap();
        let stage = |setting: i32| Stage::new("s", 1, folder.path(), &setting);
        stage(1).run(false, || Ok::<_, Infallible>(produce("hello"))).unwrap();
        let other = || Produced { files: vec![("b.txt".to_owned(), vec![1])], ..Produced::default() };
        stage(2).run(false, || Ok::<_, Infallible>(other())).unwrap();
        assert!(folder.path().join("b.txt").exists());
        assert_eq!(std::fs::read_dir(folder.path().join("a")).unwrap().count(), 0);
    }

    #[test]
    fn a_failed_stage_writes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let stage = Stage::new("s", 1, folder.path(), &());
        assert!(stage.run(false, || Err::<Produced, _>("no")).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert_eq!(stage.why(), [Reason::NotFinished]);
    }
}

//! A case folder: what is in it and how it is read back.

use super::error::{CaseError, WorkflowError};
use super::facts::{EstimateFacts, Implausible, MeshFacts};
use super::settings::Settings;
use super::stage_name::{StageName, Subject};
use super::warning::Warning;
use crate::artefact::{Manifest, named, place};
use crate::experiment::outcome::ExperimentOutcome;
use crate::layout;
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A folder that a job has filled, or is filling.
#[derive(Clone, Debug)]
pub struct Case {
    folder: PathBuf,
}

impl Case {
    /// A case that a job has made.
    ///
    /// ```no_run
    /// # fn main() -> Result<(), hgm::workflow::WorkflowError> {
    /// let case = hgm::workflow::Case::open("case")?;
    /// println!("{:?}", case.outcome()?.best_sample);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`CaseError::NotACase`] where no stage has finished.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self, WorkflowError> {
        let case = Self::at(folder.as_ref());
        match case.subject() {
            Some(_) => Ok(case),
            None => Err(CaseError::NotACase { folder: case.folder }.into()),
        }
    }

    /// A folder that a job is about to fill.
    pub(crate) fn at(folder: &Path) -> Self {
        Self { folder: folder.to_path_buf() }
    }

    /// Where it lies.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// A file of the case, by its name in the [`layout`].
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Those of its files that these paths lead to: no job is made of a file that it replaces, and no result of the user's own is written
    /// over one.
    pub(crate) fn own_of<'a>(&self, paths: impl IntoIterator<Item = &'a Path>) -> Vec<PathBuf> {
        let (folder, recorded) = (place(&self.folder), self.recorded());
        let is_own = |file: &String| {
            // A patient that was made in the folder is no part of the case that lies beside it.
            let of_case = recorded.iter().filter(|manifest| manifest.stage != "synth");
            let made = of_case.into_iter().any(|manifest| manifest.outputs.contains_key(file));
            made || layout::TABLE.iter().any(|entry| entry.path == file)
        };
        let below = |path: PathBuf| path.strip_prefix(&folder).ok().map(|file| file.to_string_lossy().into_owned());
        // A file that is a link to where it is kept is the case's by its name.
        let all = paths.into_iter().flat_map(|path| [place(path), named(path)]);
        let own: BTreeSet<String> = all.filter_map(below).filter(is_own).collect();
        own.into_iter().map(|file| self.path(&file)).collect()
    }

    /// The page.
    pub fn page(&self) -> PathBuf {
        self.path(layout::PAGE)
    }

    /// What it was made from, by the stages that have finished.
    pub fn subject(&self) -> Option<Subject> {
        let has = |stage: StageName| Manifest::path_of_stage(&self.folder, &stage.to_string()).exists();
        if has(StageName::Registration) {
            Some(Subject::Patient)
        } else if has(StageName::Pose) {
            Some(Subject::Plan)
        } else if has(StageName::Labels) {
            let every_task = StageName::Sample(String::new()).to_string() + "hyperelastic-";
            let of_task = |manifest: &Manifest| manifest.stage.starts_with(&every_task);
            Some(Subject::Phantom { every_task: self.recorded().iter().any(of_task) })
        } else {
            None
        }
    }

    /// The experiment's numbers.
    ///
    /// # Errors
    /// A file that is missing or damaged, or numbers of an earlier state of the folder.
    pub fn outcome(&self) -> Result<ExperimentOutcome, WorkflowError> {
        self.check_outcome()?;
        Ok(ExperimentOutcome::from_json(&self.read_text(layout::OUTCOME)?, layout::OUTCOME)?)
    }

    /// The undeformed mesh with its boundary sets.
    ///
    /// # Errors
    /// A file that is missing or damaged.
    pub fn mesh(&self) -> Result<TetMesh, WorkflowError> {
        Ok(vtu::decode(&self.read(layout::REST_MESH)?, layout::REST_MESH)?.mesh)
    }

    /// An array of the best sample's state, on nodes or cells: `displacement` (mm), `rmse_mm`, `jacobian` ...
    ///
    /// # Errors
    /// A file that is missing or damaged, or no such array.
    pub fn field(&self, name: &str) -> Result<Field, WorkflowError> {
        let outcome = self.outcome()?;
        let none = || CaseError::NoField { folder: self.folder.clone(), name: name.to_owned() };
        let file = outcome.best().and_then(|best| best.file.clone()).ok_or_else(none)?;
        self.field_of(&file, name)
    }

    /// The same of one sample, or of `estimate`.
    ///
    /// # Errors
    /// As [`Case::field`]; a state that the outcome was made without.
    pub fn field_in(&self, sample: &str, name: &str) -> Result<Field, WorkflowError> {
        self.check_state(sample)?;
        self.field_of(&layout::SAMPLE_STATE.of(sample), name)
    }

    fn field_of(&self, file: &str, name: &str) -> Result<Field, WorkflowError> {
        let state = vtu::decode(&self.read_made(file)?, file)?;
        let found = state.point_field(name).or_else(|| state.cell_fields.iter().find(|field| field.name == name));
        let none = || CaseError::NoField { folder: self.folder.clone(), name: name.to_owned() };
        Ok(found.cloned().ok_or_else(none)?)
    }

    /// The estimate, where one was made.
    ///
    /// # Errors
    /// A stage that is missing or another version's.
    pub fn estimate(&self) -> Result<EstimateFacts, WorkflowError> {
        Ok(self.stage(&StageName::Estimate)?.1)
    }

    /// Whether its masks are to be believed.
    ///
    /// # Errors
    /// [`WorkflowError::QualityGate`] with a sentence per mask; a phantom's are not asked.
    pub fn image_gate(&self) -> Result<(), WorkflowError> {
        let stages: &[StageName] = match self.subject() {
            Some(Subject::Patient) => &[StageName::Registration, StageName::Anat],
            Some(Subject::Plan) => &[StageName::Plan],
            _ => return Ok(()),
        };
        let mut implausible = Vec::new();
        for stage in stages {
            let (_, of_stage): (_, Implausible) = self.stage(stage)?;
            implausible.extend(of_stage.implausible);
        }
        if implausible.is_empty() { Ok(()) } else { Err(WorkflowError::QualityGate(implausible)) }
    }

    /// Whether its masks and boundary sets are to be believed.
    ///
    /// # Errors
    /// [`WorkflowError::QualityGate`] with a sentence per mask or set; a phantom's are not asked.
    pub fn quality_gate(&self) -> Result<(), WorkflowError> {
        self.image_gate()?;
        let (_, mesh): (_, MeshFacts) = self.stage(&StageName::Mesh)?;
        if mesh.implausible.is_empty() { Ok(()) } else { Err(WorkflowError::QualityGate(mesh.implausible)) }
    }

    /// What a reader of points that it has carried must know: a warning per sentence of [`Case::quality_gate`]. A job that ended there
    /// has kept what it computed, and that answers as any other.
    pub fn gate_warnings(&self) -> Vec<Warning> {
        let whose = self.folder.display().to_string();
        match self.quality_gate() {
            Err(WorkflowError::QualityGate(sentences)) => {
                sentences.into_iter().map(|why| Warning::GateNotPassed { why }.of(&whose)).collect()
            }
            // What is not there is told by those who need it.
            _ => Vec::new(),
        }
    }

    /// The settings it was made with, as a layer; nothing where none are kept.
    ///
    /// # Errors
    /// A file that is not settings.
    pub fn settings(&self) -> Result<toml::Table, WorkflowError> {
        if !self.path(layout::SETTINGS).exists() {
            return Ok(toml::Table::new());
        }
        let file = self.path(layout::SETTINGS).display().to_string();
        Ok(Settings::layer(&self.read_text(layout::SETTINGS)?, &file)?)
    }

    /// What a finished stage has left: its manifest and its figures.
    ///
    /// # Errors
    /// A stage that has not been run here, or another version's.
    pub fn stage<Facts: DeserializeOwned>(&self, stage: &StageName) -> Result<(Manifest, Facts), WorkflowError> {
        let file = format!(".stages/{stage}.manifest.json");
        self.read(&file)?;
        let damaged =
            || CaseError::Damaged { folder: self.folder.clone(), file: file.clone(), subject: self.subject() };
        let manifest = Manifest::of_stage(&self.folder, &stage.to_string()).ok_or_else(damaged)?;
        let facts = manifest.figures().map_err(|_| damaged())?;
        Ok((manifest, facts))
    }

    /// The bytes of a file of the case.
    ///
    /// # Errors
    /// A file that is not there or may not be read.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, WorkflowError> {
        let said = |source: std::io::Error| {
            let (folder, file) = (self.folder.clone(), name.to_owned());
            let subject = self.subject();
            if subject.is_none() {
                CaseError::NotACase { folder }
            } else if source.kind() == std::io::ErrorKind::NotFound {
                CaseError::Missing { folder, file, subject }
            } else {
                CaseError::Unreadable { folder, file, source }
            }
        };
        Ok(std::fs::read(self.path(name)).map_err(said)?)
    }

    /// A text file of the case.
    ///
    /// # Errors
    /// As [`Case::read`]; also when it is not UTF-8.
    pub fn read_text(&self, name: &str) -> Result<String, WorkflowError> {
        let damaged =
            |_| CaseError::Damaged { folder: self.folder.clone(), file: name.to_owned(), subject: self.subject() };
        Ok(String::from_utf8(self.read(name)?).map_err(damaged)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::{Produced, Stage};
    use serde_json::json;
    use std::convert::Infallible;

    #[test]
    fn a_patients_masks_are_believed_where_neither_registration_nor_segmentation_speaks_against_them() {
        let gate = |registration: &[&str], anat: &[&str]| {
            let folder = tempfile::tempdir().unwrap();
            for (stage, implausible) in [("registration", registration), ("anat", anat)] {
                let made = Produced { facts: json!({ "implausible": implausible }), ..Produced::default() };
                Stage::new(stage, 1, folder.path(), &()).run(false, || Ok::<_, Infallible>(made)).unwrap();
            }
            let case = Case::at(folder.path());
            // Whoever is given points of it hears of each.
            let warned: Vec<String> = case.gate_warnings().iter().map(ToString::to_string).collect();
            let sentences = [registration, anat].concat();
            assert!(
                warned.len() == sentences.len() && warned.iter().zip(sentences).all(|(all, why)| all.contains(why))
            );
            match case.image_gate() {
                Err(WorkflowError::QualityGate(why)) => why,
                ended => ended.map(|()| Vec::new()).unwrap(),
            }
        };
        assert_eq!(gate(&[], &[]), Vec::<String>::new());
        assert_eq!(gate(&["mirrored"], &[]), ["mirrored"]);
        assert_eq!(gate(&["mirrored"], &["outside"]), ["mirrored", "outside"]);
    }
}

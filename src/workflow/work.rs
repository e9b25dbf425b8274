//! What the stages of one job share: the folder, the settings, the machine's programs, whoever listens.

use super::case::Case;
use super::error::{CaseError, WorkflowError};
use super::lock::Lock;
use super::programs::Programs;
use super::progress::{Progress, StageEnded};
use super::put_back::Before;
use super::settings::Settings;
use super::stage_name::{StageName, Subject};
use crate::artefact::{Manifest, Produced, Stage, StageError};
use crate::fem::Method;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Where a job is done.
#[derive(Clone, Debug, Default)]
pub struct Place {
    /// The case folder.
    pub folder: PathBuf,
    /// The programs of this machine; none are needed.
    pub programs: Programs,
    /// Makes everything again, also what is there.
    pub force: bool,
}

impl<P: Into<PathBuf>> From<P> for Place {
    fn from(folder: P) -> Self {
        Self { folder: folder.into(), ..Self::default() }
    }
}

/// One job at work.
pub(crate) struct Work<'a> {
    pub case: Case,
    pub subject: Subject,
    pub settings: &'a Settings,
    pub place: &'a Place,
    progress: RefCell<&'a mut dyn Progress>,
    held: OnceCell<Lock>,
    before: OnceCell<Before>,
}

/// What a stage does where it is not skipped.
type Compute<'c> = dyn FnOnce() -> Result<Produced, WorkflowError> + 'c;

/// The manifests of the stages that are there, by name.
#[derive(Clone, Debug, Default)]
pub struct Made(BTreeMap<StageName, Manifest>);

impl Made {
    /// Adds one.
    pub fn add(&mut self, stage: StageName, manifest: Manifest) {
        self.0.insert(stage, manifest);
    }

    /// The manifest of a stage that is there.
    pub fn get(&self, stage: &StageName) -> Option<&Manifest> {
        self.0.get(stage)
    }

    /// A stage of this name after those it is made from.
    pub fn stage(
        &self,
        (case, subject): (&Case, Subject),
        name: &StageName,
        version: u32,
        settings: &impl Serialize,
    ) -> Stage {
        let stage = Stage::new(&name.to_string(), version, case.folder(), settings);
        let before = name.after(subject).iter().filter_map(|earlier| self.get(earlier));
        before.fold(stage, Stage::after)
    }
}

impl<'a> Work<'a> {
    pub fn new(place: &'a Place, subject: Subject, settings: &'a Settings, progress: &'a mut dyn Progress) -> Self {
        Self {
            case: Case::at(&place.folder),
            subject,
            settings,
            place,
            progress: RefCell::new(progress),
            held: OnceCell::new(),
            before: OnceCell::new(),
        }
    }

    /// Refuses a motion where `of` is of equilibria: the method would be noted as used, and be another one than that.
    pub fn is_of_equilibria(&self, of: &'static str) -> Result<(), WorkflowError> {
        let (table, solver) = match self.subject {
            Subject::Phantom { .. } => ("phantom", &self.settings.phantom.solver),
            Subject::Patient | Subject::Plan => ("resection", &self.settings.resection.solver),
        };
        if solver.method == Method::Static { Ok(()) } else { Err(WorkflowError::Moving { table, of }) }
    }

    /// A stage of this name after those it is made from.
    pub fn stage(&self, made: &Made, name: &StageName, version: u32, settings: &impl Serialize) -> Stage {
        made.stage((&self.case, self.subject), name, version, settings)
    }

    /// Takes the folder until the job has ended, for this job alone or together with the other parts of a sweep; refused
    /// where another job works in it, or where it was made from something else.
    pub fn hold(&self, alone: bool) -> Result<(), WorkflowError> {
        let lock = Lock::take(self.case.folder(), alone)?;
        // A job takes its folder once.
        self.held.set(lock).ok();
        self.case.check_subject(self.subject)
    }

    /// Remembers how the folder is, before the job writes its settings there.
    pub fn remember(&self) {
        self.before.get_or_init(|| Before::of(&self.case));
    }

    /// How the job ended: a folder that it has refused without having made anything keeps the settings that it had.
    pub fn ended<T>(&self, job: Result<T, WorkflowError>) -> Result<T, WorkflowError> {
        if let (Err(_), Some(before)) = (&job, self.before.get()) {
            before.put_back_where_nothing_is_new();
        }
        job
    }

    /// Tells whoever listens.
    pub fn tell<T>(&self, what: impl FnOnce(&mut dyn Progress) -> T) -> T {
        what(&mut **self.progress.borrow_mut())
    }

    /// Runs a stage, or skips it, and adds its manifest to those that are there; returns its figures.
    pub fn run<Facts: DeserializeOwned>(
        &self,
        made: &mut Made,
        name: &StageName,
        stage: &Stage,
        compute: impl FnOnce() -> Result<Produced, WorkflowError>,
    ) -> Result<Facts, WorkflowError> {
        let manifest = self.finished(name, stage, Box::new(compute))?;
        let facts = manifest.figures().map_err(|_| CaseError::Damaged {
            folder: self.case.folder().to_path_buf(),
            file: format!(".stages/{name}.manifest.json"),
            subject: Some(self.subject),
        })?;
        made.add(name.clone(), manifest);
        Ok(facts)
    }

    /// The same for every kind of figures.
    fn finished(&self, name: &StageName, stage: &Stage, compute: Box<Compute<'_>>) -> Result<Manifest, WorkflowError> {
        let outcome = stage.run(self.place.force, compute).map_err(|error| match error {
            StageError::Compute(error) => error,
            StageError::Write(error) => error.into(),
        })?;
        let (reasons, warnings) = (&outcome.reasons, &outcome.manifest.warnings);
        self.tell(|p| p.stage(&StageEnded { stage: name, skipped: outcome.skipped, reasons, warnings }));
        Ok(outcome.manifest)
    }
}

/// Figures as a manifest keeps them.
///
/// # Panics
/// Never: figures are plain data.
pub(crate) fn facts(value: &impl Serialize) -> serde_json::Value {
    serde_json::to_value(value).expect("figures are plain data")
}

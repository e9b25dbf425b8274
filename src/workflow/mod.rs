//! The whole job as a library call: two scans, or the template, to a case folder with meshes, simulations and a page.
//!
//! [`run`] takes a pair through every stage and [`Case`] reads what it has left. [`Settings`] holds every setting of the
//! program; [`plan`] tells which stages a job has and what each is made from; [`Progress`] listens. Nothing here knows of a
//! command line, prints, or ends the program.
//!
//! ```no_run
//! use hgm::workflow::{self, Case, Inputs, Place, Settings, Silent};
//!
//! # fn main() -> Result<(), workflow::WorkflowError> {
//! let inputs = Inputs::pair("pre.nii.gz", "post.nii.gz");
//! let case = workflow::run(&inputs, &Place::from("case"), &Settings::default(), &mut Silent)?;
//! let outcome = case.outcome()?;
//! for sample in &outcome.samples {
//!     println!("{} {:?} Pa: {:?} mm", sample.id, sample.shear_modulus_pa, sample.rmse_mm);
//! }
//! let displacement_mm = Case::open("case")?.field("displacement")?;
//! println!("{} nodes", displacement_mm.values.len() / 3);
//! # Ok(())
//! # }
//! ```

mod case;
mod error;
mod inputs;
mod labels;
mod outcome;
mod patient;
mod phantom;
mod plan;
mod programs;
mod progress;
mod settings;
mod stages;
mod why;
mod work;

pub mod cohort;

pub use case::{Case, CaseError};
pub use error::{ErrorKind, WorkflowError};
pub use inputs::{InputError, Inputs, MaskRole, ScanSums, read_input, read_text, shown};
pub use labels::{LabelMapError, any_labels, labels_of_tool};
pub use patient::Shard;
pub use plan::{Goal, StageName, Step, Subject, plan, samples, tissues};
pub use programs::{KNOWN, Known, Programs};
pub use progress::{Progress, Silent, StageEnded};
pub use settings::{Settings, SettingsError, in_words};
pub use stages::{AnatFacts, EstimateFacts, EstimateOptions, MeshFacts, Observed, RegistrationFacts, mesh_outcome};
pub use why::{Asked, Explained, why};
pub use work::Place;

use crate::material::meta_model::MetaModel;
use crate::report::case::write_report;
use patient::{Images, Patient, Prepared};
use stages::SampleMode;
use work::Work;

/// A pair through the whole job: registration, masks, mesh, target, the prior's samples, outcome and page. What is there
/// and unchanged is not made again.
///
/// # Errors
/// [`WorkflowError`] of the first stage that cannot be done.
pub fn run(
    inputs: &Inputs,
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Case, WorkflowError> {
    run_to(Goal::Sweep, inputs, place, settings, progress)
}

/// The same as far as `goal`.
///
/// # Errors
/// As [`run`].
pub fn run_to(
    goal: Goal,
    inputs: &Inputs,
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Case, WorkflowError> {
    let work = Work::new(place, Subject::Patient, settings, progress);
    can_be_done(&work, goal)?;
    if goal == Goal::Images {
        let images = Images::make(&work, inputs)?;
        outcome::finish(&work, &images.outcome(), &images.manifests())?;
        return Ok(work.case);
    }
    let prepared = Prepared::make(&work, inputs)?;
    match goal {
        Goal::Images | Goal::Mesh => outcome::finish(&work, &prepared.outcome(), &prepared.manifests())?,
        Goal::Sweep => Patient::new(&work, prepared)?.sweep(SampleMode::Run)?,
        Goal::Estimate => {
            Patient::new(&work, prepared)?.estimate(None)?;
        }
    }
    Ok(work.case)
}

/// What would be refused after minutes is refused now.
fn can_be_done(work: &Work<'_>, goal: Goal) -> Result<(), WorkflowError> {
    work.settings.check()?;
    if goal == Goal::Images {
        return Ok(());
    }
    let engine = work.settings.mesh.engine;
    let refused = |source| WorkflowError::Engine { labels: "the mesh".to_owned(), source };
    work.place.programs.engines().check(engine).map_err(refused)?;
    let law = work.settings.prior.law;
    if goal == Goal::Estimate && law != MetaModel::NeoHookean {
        return Err(WorkflowError::EstimateLaw { law: law.name().to_owned() });
    }
    plan(work.settings, work.subject, goal).map(|_| ())
}

/// The prior's samples on a prepared case: one part of them and nothing else, or all with outcome and page.
///
/// # Errors
/// As [`run`]; also a folder that has not been prepared.
pub fn sweep(
    part: Option<Shard>,
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Case, WorkflowError> {
    let work = Work::new(place, Subject::Patient, settings, progress);
    let patient = Patient::new(&work, Prepared::read(&work.case)?)?;
    if part.is_some() {
        patient.samples(part, SampleMode::Run)?;
        outcome::keep_settings(&work)?;
    } else {
        patient.sweep(SampleMode::Run)?;
    }
    drop(patient);
    Ok(work.case)
}

/// The parts of a sweep joined: outcome, table and page, the same bytes as one run.
///
/// # Errors
/// As [`sweep`]; also a sample that is missing.
pub fn reduce(place: &Place, settings: &Settings, progress: &mut dyn Progress) -> Result<Case, WorkflowError> {
    let work = Work::new(place, Subject::Patient, settings, progress);
    Patient::new(&work, Prepared::read(&work.case)?)?.sweep(SampleMode::Gather)?;
    Ok(work.case)
}

/// The most probable moduli of a prepared case or of a phantom. The samples of an earlier sweep stay beside them.
///
/// # Errors
/// As [`sweep`]; also loads, a law or observations that no estimate can be made with.
pub fn estimate(place: &Place, settings: &Settings, progress: &mut dyn Progress) -> Result<Case, WorkflowError> {
    let subject = Case::open(&place.folder)?.subject().unwrap_or(Subject::Patient);
    let work = Work::new(place, subject, settings, progress);
    if subject == Subject::Patient {
        let patient = Patient::new(&work, Prepared::read(&work.case)?)?;
        let earlier = work.case.path(crate::layout::OUTCOME).exists().then(|| work.case.outcome()).transpose()?;
        patient.estimate(earlier)?;
    } else {
        phantom::estimate(&work)?;
    }
    Ok(work.case)
}

/// The synthetic validation on the template: a reference of known moduli, found again among the samples.
///
/// # Errors
/// As [`run`].
pub fn phantom(
    every_task: bool,
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Case, WorkflowError> {
    let work = Work::new(place, Subject::Phantom { every_task }, settings, progress);
    can_be_done(&work, Goal::Sweep)?;
    phantom::make(&work)?;
    Ok(work.case)
}

/// The name of the sample whose moduli are nearest to a phantom's known ones.
///
/// # Errors
/// A prior that does not exist.
pub fn nearest_sample(settings: &Settings, every_task: bool) -> Result<Option<String>, WorkflowError> {
    let place = Place::default();
    let mut silent = Silent;
    phantom::nearest(&Work::new(&place, Subject::Phantom { every_task }, settings, &mut silent))
}

/// The page again from what is there.
///
/// # Errors
/// A file of the case that cannot be used.
pub fn report(place: &Place) -> Result<Case, WorkflowError> {
    let page = write_report(&place.folder);
    page?;
    Ok(Case::at(&place.folder))
}

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

mod bundled_pair;
mod case;
mod earlier_prediction;
mod error;
mod estimate_options;
mod evaluate;
mod evaluate_prediction;
mod facts;
mod fresh;
mod generative;
mod inputs;
mod labels;
mod landmark_pairs;
mod law_fitting;
mod layer;
mod loads_in_words;
mod lock;
mod lost_label;
mod made_files;
mod maps;
mod meshing;
mod outcome;
mod paper;
mod patient;
mod phantom;
mod plan;
mod planned_resection;
mod planned_scan;
mod posed;
mod prediction;
mod programs;
mod progress;
mod put_back;
mod refusal;
mod registering;
mod segmenting;
mod settings;
mod settings_manual;
mod several_plans;
mod sights;
mod simulation;
mod stage_name;
mod stages;
mod study_level;
mod synthetic;
mod targets;
mod user_file;
mod warning;
mod warp;
mod why;
mod work;

pub mod cohort;
pub mod results_in_words;

pub use bundled_pair::{demo, demo_pair_settings, demo_phantom_settings};
pub use case::Case;
pub use error::{
    AskedError, CaseError, CohortError, ErrorKind, EvaluateError, InputError, LabelMapError, LandmarkError, MaskRole,
    MeshFileError, PredictError, SaysMni, SimulationError, TakenUpError, WarpError, WorkflowError,
};
pub use estimate_options::{EstimateOptions, Observed};
pub use evaluate::evaluate_landmarks;
pub use evaluate_prediction::{Evaluated, SeenAfterwards, evaluate_case, evaluate_prediction};
pub use facts::{EstimateFacts, MeshFacts};
pub use generative::{GenerativeFiles, Studies, Wanted, fit_gp, hyperparameters, sample_gp, show_gp};
pub use inputs::{Inputs, ScanSums, read_mask_of};
pub use labels::{any_labels, labels_of_tool};
pub use landmark_pairs::Landmarks;
pub use law_fitting::{FittedLaw, LawTest, fit_laws};
pub use layer::Layer;
pub use lost_label::LostLabel;
pub use maps::{WarpTo, default_state, named_state};
pub use meshing::{MeshFiles, MeshedFile, mesh_file};
pub use paper::paper;
pub use patient::Shard;
pub use plan::{Goal, Step, plan, samples, tissues};
pub use planned_resection::PlannedResection;
pub use planned_scan::PlanInputs;
pub use posed::{BodySource, Posed, Resection, posed_case, posed_mesh};
pub use prediction::predict;
pub use programs::{Finding, Known, Programs, known};
pub use progress::{Progress, Shared, Silent, StageEnded};
pub use registering::{Onto, RegisterFiles, Registered, register_files};
pub use segmenting::{SegmentFiles, Segmented, segment_file};
pub use settings::{Settings, SettingsError, in_words};
pub use settings_manual::{Setting, annotated, every_setting, settings_of_table};
pub use several_plans::predict_plans;
pub use sights::{Scan, Sights};
pub use simulation::{Simulation, SimulationFiles, simulate, simulate_mesh};
pub use stage_name::{StageName, Subject};
pub use stages::{AnatFacts, RegistrationFacts, mesh_outcome};
pub use study_level::{Expected, fit_study_level, sample_study_level, show_study_level, study_level_file};
pub use synthetic::{SyntheticFiles, synthetic_patient};
pub use user_file::{read_input, read_text, shown};
pub use warning::Warning;
pub use warp::{PointCounts, Through, Warp, Warped, warp, warp_points};
pub use why::{Asked, Explained, why};
pub use work::Place;

use crate::artefact::{check_apart, check_writable};
use crate::experiment::compare::Comparison;
use crate::layout;
use lock::Lock;
use made_files::MadeFiles;
use patient::{Images, Patient, Prepared};
use phantom::Phantom;
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
    check_apart(work.case.own_of(inputs.files()), inputs.files())?;
    work.ended(every_stage(goal, inputs, &work))?;
    Ok(work.case)
}

fn every_stage(goal: Goal, inputs: &Inputs, work: &Work<'_>) -> Result<(), WorkflowError> {
    if goal == Goal::Images {
        let images = Images::make(work, inputs)?;
        work.case.drop_stale();
        return outcome::finish(work, &images.outcome(), &images.manifests());
    }
    let prepared = Prepared::make(work, inputs)?;
    work.case.drop_stale();
    if goal == Goal::Mesh {
        return outcome::finish(work, &prepared.outcome(), &prepared.manifests());
    }
    let patient = Patient::new(work, prepared)?;
    if goal == Goal::Sweep {
        patient.samples(None, SampleMode::Run)?;
    } else {
        patient.estimate()?;
    }
    patient.gather()
}

/// What would be refused after minutes is refused now.
fn can_be_done(work: &Work<'_>, goal: Goal) -> Result<(), WorkflowError> {
    work.settings.check()?;
    check_writable(&work.case.path(layout::SETTINGS))?;
    if goal == Goal::Images {
        return Ok(());
    }
    if goal == Goal::Estimate {
        can_be_estimated(work)?;
    }
    let engine = work.settings.mesh.engine;
    let refused = |source| WorkflowError::Engine { labels: "the mesh".to_owned(), source };
    work.place.programs.engines().check(engine).map_err(refused)?;
    plan(work.settings, work.subject, goal).map(|_| ())
}

/// An estimate holds what has moved against a load, and changes parameters that its law names.
fn can_be_estimated(work: &Work<'_>) -> Result<(), WorkflowError> {
    work.is_of_equilibria("an estimate")?;
    if work.subject == Subject::Patient && !work.settings.resection.is_loaded() {
        return Err(WorkflowError::NoLoad);
    }
    // A prior that is not taken up would be called the cohort's all the same.
    let taught: Vec<&str> = work.settings.prior.taught_tissues().collect();
    let drawn = work.settings.resection.tissue_list();
    let foreign = taught.iter().any(|name| drawn.iter().all(|tissue| tissue.name != *name));
    if work.subject == Subject::Patient && foreign {
        let names: Vec<&str> = drawn.iter().map(|tissue| tissue.name.as_str()).collect();
        return Err(WorkflowError::OtherCohort { taught: taught.join(" and "), drawn: names.join(" and ") });
    }
    Ok(())
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
    prepared_case(&work, part.is_none())?;
    // Settings that no sample can be made with are not the case's.
    samples(settings, work.subject, &[])?;
    let patient = Patient::new(&work, Prepared::read(&work)?)?;
    outcome::keep_settings(&work)?;
    let swept = patient.samples(part, SampleMode::Run);
    if part.is_some() {
        // Parts work side by side: the settings are those of all of them.
        swept?;
    } else {
        work.ended(swept.and_then(|()| patient.gather()))?;
    }
    Ok(work.case.clone())
}

/// Takes a folder that holds a case.
fn prepared_case(work: &Work<'_>, alone: bool) -> Result<(), WorkflowError> {
    Case::open(work.case.folder())?;
    work.hold(alone)
}

/// The parts of a sweep joined: outcome, table and page, the same bytes as one run.
///
/// # Errors
/// As [`sweep`]; also a sample that is missing.
pub fn reduce(place: &Place, settings: &Settings, progress: &mut dyn Progress) -> Result<Case, WorkflowError> {
    let work = Work::new(place, Subject::Patient, settings, progress);
    prepared_case(&work, true)?;
    let patient = Patient::new(&work, Prepared::read(&work)?)?;
    patient.samples(None, SampleMode::Gather)?;
    patient.gather()?;
    Ok(work.case.clone())
}

/// The most probable moduli of a prepared case or of a phantom. The samples of an earlier sweep stay beside them.
///
/// # Errors
/// As [`sweep`]; also loads, a law or observations that no estimate can be made with.
pub fn estimate(place: &Place, settings: &Settings, progress: &mut dyn Progress) -> Result<Case, WorkflowError> {
    let subject = Case::open(&place.folder)?.subject().unwrap_or(Subject::Patient);
    let work = Work::new(place, subject, settings, progress);
    prepared_case(&work, true)?;
    if subject == Subject::Plan {
        return Err(CaseError::Planned { folder: place.folder.clone() }.into());
    }
    can_be_estimated(&work)?;
    if subject == Subject::Patient {
        let patient = Patient::new(&work, Prepared::read(&work)?)?;
        outcome::keep_settings(&work)?;
        work.ended(patient.estimate().and_then(|()| patient.gather()))?;
    } else {
        let phantom = Phantom::read(&work)?;
        outcome::keep_settings(&work)?;
        work.ended(phantom.estimate().and_then(|()| phantom.gather()))?;
    }
    Ok(work.case.clone())
}

/// Models of a prepared case beside each other: which of them what was seen speaks for.
///
/// # Errors
/// As [`estimate`].
pub fn compare(
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<(Case, Comparison), WorkflowError> {
    let work = Work::new(place, Subject::Patient, settings, progress);
    prepared_case(&work, true)?;
    can_be_estimated(&work)?;
    let comparison = Patient::new(&work, Prepared::read(&work)?)?.compare()?;
    Ok((work.case.clone(), comparison))
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
    work.hold(true)?;
    let made = Phantom::make(&work).and_then(|phantom| {
        work.case.drop_stale();
        phantom.samples()?;
        phantom.gather()
    });
    work.ended(made)?;
    Ok(work.case)
}

/// The page again from what is there.
///
/// # Errors
/// A file of the case that cannot be used, or an outcome of an earlier state of the folder.
pub fn report(place: &Place) -> Result<Case, WorkflowError> {
    let case = Case::at(&place.folder);
    if case.subject().is_none() {
        return Err(CaseError::NotACase { folder: place.folder.clone() }.into());
    }
    let _alone = Lock::take(&place.folder, true)?;
    case.check_outcome()?;
    MadeFiles::of(&case).check()?;
    outcome::write_page(&case)?;
    Ok(case)
}

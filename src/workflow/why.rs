//! What made a stage run again, or would.

use super::case::Case;
use super::error::{CaseError, WorkflowError};
use super::facts::MeshFacts;
use super::inputs::{ScanSums, with_own_masks_of};
use super::patient::{Patient, Prepared};
use super::plan::{self, Goal, plan_with};
use super::progress::Silent;
use super::stage_name::{StageName, Subject};
use super::stages;
use super::user_file::read_input;
use super::work::{Made, Place, Work};
use crate::artefact::{Manifest, Reason, Stage, sha256_hex};
use crate::workflow::settings::Settings;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The job that is asked about: what is not given is taken as it was.
#[derive(Clone, Debug)]
pub struct Asked {
    /// How far it would go.
    pub goal: Goal,
    /// Only this stage, by its name in the manifests.
    pub stage: Option<String>,
    /// The pre-operative scan.
    pub pre: Option<PathBuf>,
    /// The post-operative scan.
    pub post: Option<PathBuf>,
}

/// One stage and why it would run; nothing when it would be skipped.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explained {
    /// Its name in the manifests.
    pub stage: String,
    /// Whether it would run.
    pub would_run: bool,
    /// Why.
    pub reasons: Vec<Reason>,
}

/// Which stages of a case would run again if the job were done with these settings, and why.
///
/// # Errors
/// A folder in which no stage has finished, or not the one that is asked about; a scan that cannot be read.
pub fn why(asked: &Asked, place: &Place, settings: &Settings) -> Result<Vec<Explained>, WorkflowError> {
    let case = Case::open(&place.folder)?;
    let recorded = case.recorded();
    let mut silent = Silent;
    let subject = case.subject().unwrap_or(Subject::Patient);
    let posed = posed(asked, &Work::new(place, subject, settings, &mut silent))?;
    let mut explained: Vec<Explained> =
        recorded.iter().map(|manifest| explain(manifest, &posed, case.folder())).collect();
    // Samples that these settings ask for and that are not there.
    let known = |stage: &&Stage| recorded.iter().all(|manifest| manifest.stage != stage.name());
    explained.extend(posed.iter().filter(known).map(|stage| entry(stage.name(), stage.why())));
    follow(&mut explained, &recorded);
    let Some(wanted) = &asked.stage else { return Ok(explained) };
    let stages: Vec<String> = explained.iter().map(|e| e.stage.clone()).collect();
    explained.retain(|e| e.stage == *wanted);
    if explained.is_empty() {
        return Err(CaseError::NoStage { wanted: wanted.clone(), stages }.into());
    }
    Ok(explained)
}

fn entry(stage: &str, reasons: Vec<Reason>) -> Explained {
    Explained { stage: stage.to_owned(), would_run: !reasons.is_empty(), reasons }
}

/// The stages of the plan as this job would pose them, each as if those before it were as they are recorded. Empty for a
/// phantom, whose stages are judged by what is on disk.
fn posed(asked: &Asked, work: &Work<'_>) -> Result<Vec<Stage>, WorkflowError> {
    let of_stage = |name: &StageName| Manifest::of_stage(work.case.folder(), &name.to_string());
    let Some(registered) = of_stage(&StageName::Registration) else { return Ok(Vec::new()) };
    if of_stage(&StageName::Anat).is_none() {
        return Ok(Vec::new());
    }
    let mut made = Made::default();
    let meshed = work.case.stage::<MeshFacts>(&StageName::Mesh).ok();
    let lesions = meshed.as_ref().map_or_else(Vec::new, |(_, meshed)| stages::lesions(&meshed.mesh));
    let steps = plan_with(work.settings, work.subject, asked.goal, &lesions)?;
    for step in &steps {
        if let Some(manifest) = of_stage(&step.stage) {
            made.add(step.stage.clone(), manifest);
        }
    }
    let sum = |given: &Option<PathBuf>, role: &str| -> Result<String, WorkflowError> {
        match given {
            Some(path) => Ok(sha256_hex(&read_input(path)?)),
            None => Ok(registered.inputs.get(role).cloned().unwrap_or_default()),
        }
    };
    let sums = ScanSums { pre: sum(&asked.pre, "pre")?, post: sum(&asked.post, "post")? };
    let resection = &work.settings.resection;
    let mut scenario = resection.scenario(&stages::mni_from_gravity_frame(&work.case, resection.gravity_frame)?);
    if resection.needs_labels() {
        scenario = resection.supported(&scenario, &stages::Anatomy::read(&work.case)?.before)?;
    }
    if let Some((_, mesh)) = &meshed {
        (scenario, _) = stages::with_held_tissues(work, &mesh.mesh, scenario)?;
    }
    let tissues = plan::tissues(work.settings, work.subject);
    let samples =
        if asked.goal == Goal::Sweep { plan::samples(work.settings, work.subject, &lesions)? } else { Vec::new() };
    let pose = |step: &plan::Step| -> Option<Stage> {
        match &step.stage {
            StageName::Registration => {
                let stage = stages::registration_stage(work, &sums);
                Some(match made.get(&StageName::Registration) {
                    Some(earlier) => with_own_masks_of(stage, earlier),
                    None => stage,
                })
            }
            StageName::Anat => {
                Some(with_own_masks_of(stages::anat_stage(work, &made, &sums), made.get(&StageName::Anat)?))
            }
            StageName::Mesh => Some(stages::mesh_stage(work, &made).0),
            StageName::Reference => Some(stages::reference_stage(work, &made)),
            StageName::Sample(id) => {
                // Nothing can be said of samples before there is a mesh and a target.
                made.get(&StageName::Mesh)?;
                made.get(&StageName::Reference)?;
                let sample = samples.iter().find(|sample| sample.id == *id)?;
                Some(stages::sample_stage(work, &made, &scenario, &tissues, sample))
            }
            StageName::Labels
            | StageName::Estimate
            | StageName::Compare
            | StageName::Fields
            | StageName::Pose
            | StageName::Plan
            | StageName::Predict => None,
        }
    };
    let mut posed: Vec<Stage> = steps.iter().filter_map(pose).collect();
    let whole = matches!(asked.goal, Goal::Sweep | Goal::Estimate);
    if whole && posed.iter().all(|stage| stage.why().is_empty()) {
        posed.extend(Patient::new(work, Prepared::read(work)?)?.later_stages(asked.goal)?);
    }
    Ok(posed)
}

fn explain(manifest: &Manifest, posed: &[Stage], folder: &Path) -> Explained {
    let reasons = match posed.iter().find(|stage| stage.name() == manifest.stage) {
        Some(stage) => stage.why(),
        None => [manifest.changed_stages(folder), manifest.changed_outputs(folder)].concat(),
    };
    entry(&manifest.stage, reasons)
}

/// A stage whose earlier stage would run again may run again.
fn follow(explained: &mut [Explained], recorded: &[Manifest]) {
    for n in 0..explained.len() {
        let Some(manifest) = recorded.iter().find(|m| m.stage == explained[n].stage) else { continue };
        let before = |e: &&Explained| e.would_run && manifest.inputs.contains_key(&format!("stage {}", e.stage));
        let moved: Vec<String> = explained.iter().filter(before).map(|e| e.stage.clone()).collect();
        if explained[n].would_run || moved.is_empty() {
            continue;
        }
        explained[n].would_run = true;
        explained[n].reasons = vec![Reason::Follows { stages: moved }];
    }
}

//! Which stages a job has and what each is made from.

use super::error::WorkflowError;
use super::layer::Layer;
use super::settings::Settings;
use super::stage_name::{StageName, Subject};
use crate::experiment::prior::{samples_of_every_task, samples_of_prior};
use crate::experiment::sample::{Sample, Tissue};
use crate::mesh::engine::MeshSize;
use serde::Serialize;

/// How far a job goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Goal {
    /// Registered images and masks.
    Images,
    /// The tagged mesh and the target surfaces.
    Mesh,
    /// The prior's samples.
    Sweep,
    /// The most probable moduli.
    Estimate,
    /// How a planned patient's brain will move.
    Predict,
}

/// One stage of a job and the stages before it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Step {
    /// The stage.
    pub stage: StageName,
    /// What it is made from.
    pub after: &'static [StageName],
}

/// The stages of a job, each after those it is made from. Samples of lesions, which only a body that is there has, are not
/// among them.
///
/// # Errors
/// A prior that does not exist.
pub fn plan(settings: &Settings, subject: Subject, goal: Goal) -> Result<Vec<Step>, WorkflowError> {
    plan_with(settings, subject, goal, &[])
}

/// The same of a body with lesions, by the names of their labels: they have samples of their own where every task is tried.
pub(crate) fn plan_with(
    settings: &Settings,
    subject: Subject,
    goal: Goal,
    lesions: &[String],
) -> Result<Vec<Step>, WorkflowError> {
    let mut stages = match subject {
        Subject::Patient => vec![StageName::Registration, StageName::Anat],
        Subject::Plan => vec![StageName::Pose, StageName::Plan],
        Subject::Phantom { .. } => vec![StageName::Labels],
    };
    if subject == Subject::Plan {
        if goal != Goal::Images {
            stages.push(StageName::Mesh);
        }
        if goal == Goal::Predict {
            stages.push(StageName::Predict);
        }
        return Ok(steps(stages, subject));
    }
    if goal != Goal::Images {
        stages.extend([StageName::Mesh, StageName::Reference]);
    }
    match goal {
        Goal::Sweep => {
            stages.extend(samples(settings, subject, lesions)?.into_iter().map(|sample| StageName::Sample(sample.id)));
        }
        Goal::Estimate => stages.push(StageName::Estimate),
        Goal::Images | Goal::Mesh | Goal::Predict => {}
    }
    if subject == Subject::Patient && matches!(goal, Goal::Sweep | Goal::Estimate) {
        stages.push(StageName::Fields);
    }
    Ok(steps(stages, subject))
}

fn steps(stages: Vec<StageName>, subject: Subject) -> Vec<Step> {
    stages.into_iter().map(|stage| Step { after: stage.after(subject), stage }).collect()
}

/// The tissues whose material is varied.
pub fn tissues(settings: &Settings, subject: Subject) -> Vec<Tissue> {
    match subject {
        Subject::Patient | Subject::Plan => settings.resection.tissue_list(),
        Subject::Phantom { .. } => settings.phantom.tissue_list(),
    }
}

/// The samples of a sweep, in order; `lesions` are the labels of the body, by name, that are not varied otherwise.
///
/// # Errors
/// A prior that does not exist, or samples of every task for two tissues.
pub fn samples(settings: &Settings, subject: Subject, lesions: &[String]) -> Result<Vec<Sample>, WorkflowError> {
    let tissues = tissues(settings, subject);
    let (levels, poisson_ratio, every_task) = match subject {
        Subject::Patient | Subject::Plan => {
            let own = &settings.resection;
            (&own.sd_levels, own.poisson_ratio, own.every_task && subject == Subject::Patient)
        }
        Subject::Phantom { every_task } => (&settings.phantom.sd_levels, settings.phantom.poisson_ratio, every_task),
    };
    if every_task && tissues.len() != 1 {
        return Err(WorkflowError::EveryTaskOfTwo);
    }
    let mut list = if every_task {
        samples_of_every_task(lesions, levels, poisson_ratio, &settings.prior)?
    } else {
        samples_of_prior(&tissues, levels, poisson_ratio, &settings.prior)?
    };
    if matches!(subject, Subject::Phantom { .. }) && settings.phantom.include_reference {
        list.push(settings.phantom.reference_sample());
    }
    Ok(list)
}

/// Tetrahedra of an estimate's mesh: fewer move the moduli (docs/evidence/choices.md).
const ESTIMATE_CELLS: usize = 160_000;

impl Goal {
    /// What takes the place of the defaults for a job that goes this far: an estimate has a finer mesh.
    pub fn own_settings(self) -> Layer {
        let mut own = Layer::default();
        own.set("mesh.size", (self == Self::Estimate).then_some(MeshSize::Cells(ESTIMATE_CELLS)));
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_comes_after_what_it_is_made_from() {
        let settings = Settings::default();
        for subject in [Subject::Patient, Subject::Phantom { every_task: true }] {
            for goal in [Goal::Images, Goal::Mesh, Goal::Sweep, Goal::Estimate] {
                let steps = plan(&settings, subject, goal).unwrap();
                for (n, step) in steps.iter().enumerate() {
                    let before = |name: &StageName| steps[..n].iter().any(|earlier| earlier.stage == *name);
                    assert!(step.after.iter().all(before), "{subject:?} {goal:?}: {}", step.stage);
                }
            }
        }
        let names = plan(&settings, Subject::Plan, Goal::Predict).unwrap();
        let names: Vec<String> = names.iter().map(|step| step.stage.to_string()).collect();
        assert_eq!(names, ["pose", "plan", "mesh", "predict"]);
    }

    #[test]
    fn a_stage_is_found_again_by_its_name() {
        let settings = Settings::default();
        for subject in [Subject::Patient, Subject::Phantom { every_task: false }] {
            for step in plan(&settings, subject, Goal::Sweep).unwrap() {
                assert_eq!(StageName::parse(&step.stage.to_string()), Some(step.stage));
            }
        }
        for step in plan(&settings, Subject::Plan, Goal::Predict).unwrap() {
            assert_eq!(StageName::parse(&step.stage.to_string()), Some(step.stage));
        }
        assert_eq!(StageName::parse("outcome"), None);
    }
}

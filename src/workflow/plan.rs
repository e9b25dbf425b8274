//! Which stages a job has and what each is made from.

use super::error::WorkflowError;
use super::settings::Settings;
use crate::experiment::prior::{samples_of_every_task, samples_of_prior};
use crate::experiment::sample::{Sample, Tissue};
use crate::layout::Maker;
use serde::{Serialize, Serializer};
use std::fmt;

/// What a job starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// A pre- and a post-operative scan.
    Patient,
    /// The template with known moduli.
    Phantom {
        /// Samples of every task of the generative model instead of one task's.
        every_task: bool,
    },
}

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
}

/// A stage by its name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum StageName {
    /// Both scans registered.
    Registration,
    /// A phantom's labels: the template's.
    Labels,
    /// Masks and labels of a patient.
    Anat,
    /// The tagged mesh.
    Mesh,
    /// The target: observed surfaces, or a phantom's known state.
    Reference,
    /// One simulation, by the sample's name.
    Sample(String),
    /// The most probable moduli.
    Estimate,
    /// Models beside each other.
    Compare,
}

impl StageName {
    /// The stages whose files it is made from.
    pub fn after(&self, subject: Subject) -> &'static [StageName] {
        use StageName::{Anat, Labels, Mesh, Reference, Registration};
        match (self, subject) {
            (Self::Registration | Self::Labels, _) => &[],
            (Self::Anat, _) => &[Registration],
            (Self::Mesh | Self::Reference, Subject::Patient) => &[Anat],
            (Self::Mesh, Subject::Phantom { .. }) => &[Labels],
            (Self::Reference, Subject::Phantom { .. }) => &[Mesh],
            (Self::Sample(_), Subject::Patient) => &[Mesh, Reference],
            (Self::Sample(_), Subject::Phantom { .. }) | (Self::Estimate | Self::Compare, _) => &[Reference],
        }
    }

    /// Who the layout says makes its files.
    pub fn maker(&self) -> Option<Maker> {
        Some(match self {
            Self::Registration => Maker::Registration,
            Self::Labels => return None,
            Self::Anat => Maker::Anat,
            Self::Mesh => Maker::Mesh,
            Self::Reference => Maker::Reference,
            Self::Sample(_) => Maker::Sample,
            Self::Estimate => Maker::Estimate,
            Self::Compare => Maker::Compare,
        })
    }

    /// What it is called to a reader: a sample by its own name.
    pub fn shown(&self) -> String {
        match self {
            Self::Sample(id) => id.clone(),
            other => other.to_string(),
        }
    }

    /// The stage of this name in the manifests.
    pub fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "registration" => Self::Registration,
            "labels" => Self::Labels,
            "anat" => Self::Anat,
            "mesh" => Self::Mesh,
            "reference" => Self::Reference,
            "estimate" => Self::Estimate,
            "compare" => Self::Compare,
            other => Self::Sample(other.strip_prefix("sim-")?.to_owned()),
        })
    }
}

impl fmt::Display for StageName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Registration => f.write_str("registration"),
            Self::Labels => f.write_str("labels"),
            Self::Anat => f.write_str("anat"),
            Self::Mesh => f.write_str("mesh"),
            Self::Reference => f.write_str("reference"),
            Self::Sample(id) => write!(f, "sim-{id}"),
            Self::Estimate => f.write_str("estimate"),
            Self::Compare => f.write_str("compare"),
        }
    }
}

impl Serialize for StageName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// One stage of a job and the stages before it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Step {
    /// The stage.
    pub stage: StageName,
    /// What it is made from.
    pub after: &'static [StageName],
}

/// The stages of a job, each after those it is made from.
///
/// # Errors
/// A prior that does not exist.
pub fn plan(settings: &Settings, subject: Subject, goal: Goal) -> Result<Vec<Step>, WorkflowError> {
    let mut stages = match subject {
        Subject::Patient => vec![StageName::Registration, StageName::Anat],
        Subject::Phantom { .. } => vec![StageName::Labels],
    };
    if goal != Goal::Images {
        stages.extend([StageName::Mesh, StageName::Reference]);
    }
    match goal {
        Goal::Sweep => {
            stages.extend(samples(settings, subject)?.into_iter().map(|sample| StageName::Sample(sample.id)));
        }
        Goal::Estimate => stages.push(StageName::Estimate),
        Goal::Images | Goal::Mesh => {}
    }
    Ok(stages.into_iter().map(|stage| Step { after: stage.after(subject), stage }).collect())
}

/// The tissues whose material is varied.
pub fn tissues(settings: &Settings, subject: Subject) -> Vec<Tissue> {
    match subject {
        Subject::Patient => settings.resection.tissue_list(),
        Subject::Phantom { .. } => settings.phantom.tissue_list(),
    }
}

/// The samples of a sweep, in order.
///
/// # Errors
/// A prior that does not exist, or samples of every task for two tissues.
pub fn samples(settings: &Settings, subject: Subject) -> Result<Vec<Sample>, WorkflowError> {
    let tissues = tissues(settings, subject);
    let (levels, poisson_ratio) = match subject {
        Subject::Patient => (&settings.resection.sd_levels, settings.resection.poisson_ratio),
        Subject::Phantom { .. } => (&settings.phantom.sd_levels, settings.phantom.poisson_ratio),
    };
    let mut list = match subject {
        Subject::Phantom { every_task: true } if settings.phantom.tissues != 1 => {
            return Err(WorkflowError::EveryTaskOfTwo);
        }
        Subject::Phantom { every_task: true } => samples_of_every_task(levels, poisson_ratio, &settings.prior)?,
        _ => samples_of_prior(&tissues, levels, poisson_ratio, &settings.prior)?,
    };
    if matches!(subject, Subject::Phantom { .. }) && settings.phantom.include_reference {
        list.push(settings.phantom.reference_sample());
    }
    Ok(list)
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
    }

    #[test]
    fn a_stage_is_found_again_by_its_name() {
        let settings = Settings::default();
        for subject in [Subject::Patient, Subject::Phantom { every_task: false }] {
            for step in plan(&settings, subject, Goal::Sweep).unwrap() {
                assert_eq!(StageName::parse(&step.stage.to_string()), Some(step.stage));
            }
        }
        assert_eq!(StageName::parse("outcome"), None);
    }
}

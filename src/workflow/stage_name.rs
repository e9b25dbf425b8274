//! The stages of a job by their names, and what a job starts from.

use crate::layout::Maker;
use serde::{Serialize, Serializer};
use std::fmt;

/// What a job starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// A pre- and a post-operative scan.
    Patient,
    /// A pre-operative scan alone, and what is to be taken out.
    Plan,
    /// The template with known moduli.
    Phantom {
        /// Samples of every task of the generative model instead of one task's.
        every_task: bool,
    },
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
    /// The pre-operative scan alone on the template.
    Pose,
    /// Its labels, and what is to be taken out.
    Plan,
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
    /// Displacement fields of a patient.
    Fields,
    /// How a planned patient's brain will move.
    Predict,
}

impl StageName {
    /// The stages whose files it is made from.
    pub fn after(&self, subject: Subject) -> &'static [StageName] {
        use StageName::{Anat, Labels, Mesh, Plan, Pose, Reference, Registration};
        match (self, subject) {
            (Self::Registration | Self::Labels | Self::Pose, _) => &[],
            (Self::Plan, _) => &[Pose],
            (Self::Mesh, Subject::Plan) => &[Plan],
            (Self::Predict, _) => &[Plan, Mesh],
            (Self::Anat, _) => &[Registration],
            // With the samples or the estimate whose state it is.
            (Self::Fields, _) => &[Registration, Anat],
            (Self::Mesh, Subject::Patient) | (Self::Reference, Subject::Patient | Subject::Plan) => &[Anat],
            (Self::Mesh, Subject::Phantom { .. }) => &[Labels],
            (Self::Reference, Subject::Phantom { .. }) => &[Mesh],
            (Self::Sample(_), Subject::Patient | Subject::Plan) => &[Mesh, Reference],
            (Self::Sample(_), Subject::Phantom { .. }) | (Self::Estimate | Self::Compare, _) => &[Reference],
        }
    }

    /// Who the layout says makes its files.
    pub fn maker(&self) -> Option<Maker> {
        Some(match self {
            Self::Registration | Self::Pose => Maker::Registration,
            Self::Labels => return None,
            Self::Anat | Self::Plan => Maker::Anat,
            Self::Mesh => Maker::Mesh,
            Self::Reference => Maker::Reference,
            Self::Sample(_) => Maker::Sample,
            Self::Estimate => Maker::Estimate,
            Self::Compare => Maker::Compare,
            Self::Fields => Maker::Fields,
            Self::Predict => Maker::Predict,
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
            "pose" => Self::Pose,
            "plan" => Self::Plan,
            "predict" => Self::Predict,
            "mesh" => Self::Mesh,
            "reference" => Self::Reference,
            "estimate" => Self::Estimate,
            "compare" => Self::Compare,
            "fields" => Self::Fields,
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
            Self::Pose => f.write_str("pose"),
            Self::Plan => f.write_str("plan"),
            Self::Predict => f.write_str("predict"),
            Self::Mesh => f.write_str("mesh"),
            Self::Reference => f.write_str("reference"),
            Self::Sample(id) => write!(f, "sim-{id}"),
            Self::Estimate => f.write_str("estimate"),
            Self::Compare => f.write_str("compare"),
            Self::Fields => f.write_str("fields"),
        }
    }
}

impl Serialize for StageName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

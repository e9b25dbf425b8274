//! Stage `pose`: the pre-operative scan alone onto the template.

use super::reading::WithReading;
use super::registration::{OF_POSE, pose_of, write_transform};
use crate::artefact::{Produced, Stage};
use crate::experiment::outcome::RegistrationOutcome;
use crate::geometry::{Frame, Mni};
use crate::layout;
use crate::workflow::case::Case;
use crate::workflow::error::WorkflowError;
use crate::workflow::planned_scan::{PlannedScan, once};
use crate::workflow::settings::Settings;
use crate::workflow::stage_name::{StageName, Subject};
use crate::workflow::work::{Made, Work, facts};
use serde::{Deserialize, Serialize};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 5;
const NAME: StageName = StageName::Pose;

/// What the report says of the fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PoseFacts {
    /// Pre to MNI.
    pub fit: RegistrationOutcome,
}

/// The stage of the case of one scan, with its inputs but for what the user says of the pose.
pub(crate) fn pose_stage(case: &Case, settings: &Settings, sum: &str) -> Stage {
    let posed = WithReading { settings: &settings.register, image: settings.image };
    let stage = Made::default().stage((case, Subject::Plan), &NAME, VERSION, &posed);
    stage.input_sha256("pre", sum).frame(Mni::NAME)
}

/// Finds the pose as a pair's registration does, and writes it as text and as ITK .tfm.
pub(crate) fn pose(work: &Work<'_>, made: &mut Made, scan: &PlannedScan) -> Result<PoseFacts, WorkflowError> {
    let stage = pose_stage(&work.case, work.settings, &scan.sum);
    let stage = scan.posing().fold(stage, |stage, (role, bytes)| stage.input(&role.to_string(), bytes));
    work.run(made, &NAME, &stage, || {
        work.tell(|p| p.begin("registration", 1));
        work.tell(|p| p.doing(OF_POSE));
        let mut produced = Produced::default();
        produced.warn(&scan.warnings);
        let given = (scan.pose.as_ref(), scan.labels.as_ref().map(|(labels, _)| labels));
        let (mni_from_pre, fit, odd) = once(&scan.shared.pose, || pose_of(&scan.pre, given))?;
        produced.warn(odd);
        work.tell(|p| p.end());
        write_transform(&mut produced, layout::MNI_FROM_PRE_TEXT, layout::MNI_FROM_PRE_ITK, mni_from_pre);
        produced.facts = facts(&PoseFacts { fit: fit.clone() });
        Ok(produced)
    })
}

//! A prediction taken up by the pair that came after it: whether it is one of the same scan, made in the same way.

use super::case::Case;
use super::error::{CaseError, TakenUpError, WorkflowError};
use super::facts::MeshFacts;
use super::inputs::{GivenMask, OwnMasks, Scans};
use super::stage_name::{StageName, Subject};
use super::stages::{
    Earlier, OF_POSE, PlanFacts, PlannedHead, PoseFacts, mesh_stage_of, mni_from_pre, plan_stage, pose_stage,
};
use super::work::{Made, Work};
use crate::artefact::{Manifest, Reason, Stage};
use crate::image::nifti::encode_mask;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Opens the prediction in a folder for this pair.
///
/// # Errors
/// [`TakenUpError`] for a prediction of another scan, of other settings or masks, one that has not ended or whose files have
/// changed.
pub(super) fn earlier_prediction(
    folder: &Path,
    scans: &Scans,
    own: &OwnMasks,
    work: &Work<'_>,
) -> Result<Earlier, WorkflowError> {
    let case = Case::open(folder)?;
    let its = || folder.to_path_buf();
    if case.subject() != Some(Subject::Plan) {
        return Err(TakenUpError::NoPrediction { folder: its() }.into());
    }
    case.check_outcome()?;
    let (settings, sum) = (work.settings, scans.sums.pre.as_str());
    let (posed, pose): (Manifest, PoseFacts) = of_now(&case, &StageName::Pose)?;
    let as_now = |stage: &Stage| match stage.why() {
        reasons if reasons.is_empty() => Ok(()),
        reasons if reasons.contains(&Reason::Input { role: "pre".to_owned() }) => {
            Err(TakenUpError::OtherScan { folder: its() })
        }
        reasons => Err(TakenUpError::MadeOtherwise { folder: its(), reasons }),
    };
    let stage = pose_stage(&case, settings, sum);
    as_now(&own.posing().fold(stage, |stage, (role, bytes)| stage.input(&role.to_string(), bytes)))?;
    let mut made = Made::default();
    made.add(StageName::Pose, posed);
    let (planned, plan): (Manifest, PlanFacts) = of_now(&case, &StageName::Plan)?;
    let stage = plan_stage(&case, settings, &made, sum);
    let stage = planned.inputs.get("resection").into_iter().fold(stage, |s, sum| s.input_sha256("resection", sum));
    as_now(&given_before(own).into_iter().fold(stage, |stage, (role, bytes)| stage.input(&role, &bytes)))?;
    made.add(StageName::Plan, planned);
    let (meshed, _): (Manifest, MeshFacts) = case.stage(&StageName::Mesh)?;
    let same_mesh = mesh_stage_of((&case, Subject::Plan), settings, &made).0.why().is_empty();
    let labels = || PlannedHead::read(&case).map(|head| (head.labels, meshed));
    let meshed = same_mesh.then(labels).transpose()?;
    let mni_from_pre = mni_from_pre(&case)?;
    let odd = made.get(&StageName::Pose).map(|m| m.warnings.clone()).unwrap_or_default();
    let odd = odd.into_iter().filter(|w| w.starts_with(OF_POSE)).collect();
    Ok(Earlier { case, mni_from_pre, fit: (pose.fit, odd), head: plan.head, meshed })
}

/// A stage as this version of the program writes it.
fn of_now<Facts: DeserializeOwned>(case: &Case, stage: &StageName) -> Result<(Manifest, Facts), WorkflowError> {
    case.stage(stage).map_err(|error| match error {
        WorkflowError::Case(CaseError::Damaged { folder, .. }) => {
            TakenUpError::MadeOtherwise { folder, reasons: vec![Reason::Program] }.into()
        }
        other => other,
    })
}

/// What a prediction would have been given of these, by role.
fn given_before(own: &OwnMasks) -> Vec<(String, Vec<u8>)> {
    use super::error::MaskRole::{Brain, Labels, Ventricle};
    let masks = [(Brain, &own.brain), (Ventricle, &own.ventricle)];
    let masks = masks.into_iter().filter_map(|(role, mask)| mask.as_ref().map(|(mask, bytes)| (role, mask, bytes)));
    let masks = masks.map(|(role, mask, bytes)| match mask {
        GivenMask::Pre(mask) => (role.to_string(), encode_mask(mask)),
        // A prediction has no other scan whose grid a mask could be in.
        GivenMask::Post(_) => (role.to_string(), bytes.clone()),
    });
    masks.chain(own.labels.as_ref().map(|(_, bytes)| (Labels.to_string(), bytes.clone()))).collect()
}

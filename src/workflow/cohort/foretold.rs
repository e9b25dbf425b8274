//! The subjects of a data set before the operation, and their predictions once the scan after it is there.

use super::dataset::{Dataset, ScanAndPlan};
use super::published::Published;
use crate::artefact::write_whole;
use crate::layout;
use crate::report::derivatives::plan_files;
use crate::workflow::{
    Case, Goal, Inputs, Place, PlanInputs, PlannedResection, Progress, SeenAfterwards, Settings, Subject,
    WorkflowError, evaluate_prediction, predict, run_to,
};
use std::path::{Path, PathBuf};

/// Beside the case folder of a subject's pair.
const FOLDER: &str = "hgm-plan";

/// The folder of a subject's prediction below the derivatives.
pub fn plan_folder(out: &Path, subject: &str) -> PathBuf {
    out.join(subject).join(FOLDER)
}

/// A subject's page before the operation.
fn page_of(subject: &str) -> String {
    format!("{subject}_plan.html")
}

/// One subject from the scan before surgery and its plan to a prediction, its fields under BIDS names.
///
/// # Errors
/// As [`predict`].
pub fn planned_subject(
    (dataset, planned): (&Dataset, &ScanAndPlan),
    (out, place): (&Path, &Place),
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Case, WorkflowError> {
    let inputs = PlanInputs {
        pre: dataset.folder.join(&planned.pre.0),
        resection: PlannedResection::file(planned.plan.clone()),
        targets: None,
        dseg: None,
        labels: None,
        pose: None,
        pose_start: None,
        brain_mask: None,
        ventricle_mask: None,
    };
    let page = page_of(planned.pre.0.split('/').next().unwrap_or_default());
    let published = Published { out, page: page.clone(), scans: &[&planned.pre] };
    let (case, _) = predict(&inputs, place, settings, progress).or_else(|error| {
        published.after(&Case::at(&place.folder), &error)?;
        Err(error)
    })?;
    let mut files = plan_files(case.folder(), &planned.pre)?;
    files.push((page, case.read(layout::PAGE)?));
    published.replace(&files)?;
    Ok(case)
}

/// The prediction beside a case folder, where one has been made.
fn beside(case: &Path) -> Option<Case> {
    let prediction = Case::open(case.with_file_name(FOLDER)).ok()?;
    (prediction.subject() == Some(Subject::Plan) && prediction.check_outcome().is_ok()).then_some(prediction)
}

/// [`run_to`] with what a prediction of the same subject has made of the scan before, where it was made in the same way. The case is
/// the same with it and without.
pub(super) fn with_prediction(
    goal: Goal,
    inputs: &Inputs,
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Case, WorkflowError> {
    if let Some(prediction) = beside(&place.folder) {
        let inputs = Inputs { prediction: Some(prediction.folder().to_path_buf()), ..inputs.clone() };
        match run_to(goal, &inputs, place, settings, progress) {
            Err(WorkflowError::TakenUp(reason)) => progress.noted(&reason.to_string()),
            ended => return ended,
        }
    }
    run_to(goal, inputs, place, settings, progress)
}

/// Holds the subject's prediction, where one has been made, against its case, and takes the page anew. What cannot be compared is said
/// and is no fault of the case.
pub(super) fn held_against(
    case: &Case,
    (out, subject): (&Path, &str),
    progress: &mut dyn Progress,
) -> Result<(), WorkflowError> {
    let Some(prediction) = beside(case.folder()) else { return Ok(()) };
    let seen = SeenAfterwards { case: Some(case.folder().to_path_buf()), ..SeenAfterwards::default() };
    match evaluate_prediction(prediction.folder(), &seen) {
        Ok(_) => Ok(write_whole(&out.join(page_of(subject)), &prediction.read(layout::PAGE)?)?),
        Err(error) => {
            progress.noted(&format!("the prediction is not held against the case: {error}"));
            Ok(())
        }
    }
}

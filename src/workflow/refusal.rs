//! A pair that cannot be followed further: a picture of what was seen, and where the scans gave an answer, outcome and page.

use super::error::WorkflowError;
use super::inputs::Scans;
use super::outcome;
use super::progress::Progress;
use super::stages;
use super::work::Work;
use crate::artefact::{Manifest, write_whole};
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome};
use crate::layout;
use crate::report::refusal::{Row, as_scanned, picture, posed};
use std::path::{Path, PathBuf};

/// A picture for whoever wrote `output`, beside it: `labels_refused.png` of `labels.nii.gz`. What goes wrong with it is not worth
/// a second message.
pub(super) fn show(rows: &[Row], output: &Path, what: &str, progress: &mut dyn Progress) {
    let Some((png, _)) = picture(rows) else { return };
    let name = output.to_string_lossy();
    let stem = name.strip_suffix(".nii.gz").map_or_else(|| output.with_extension(""), PathBuf::from);
    let path = PathBuf::from(format!("{}_refused.png", stem.display()));
    if write_whole(&path, &png).is_ok() {
        progress.odd(&path.display().to_string(), &format!("look here first: {what}"));
    }
}

/// Keeps what can be known of a refusal in the case folder. `step` is where it ended; `before` are the stages that are there.
///
/// # Errors
/// The disk's.
pub(crate) fn keep(
    work: &Work<'_>,
    scans: &Scans,
    step: &str,
    before: &[&Manifest],
    error: &WorkflowError,
) -> Result<(), WorkflowError> {
    if !matches!(error, WorkflowError::Pair(_) | WorkflowError::Registration { .. }) {
        return Ok(());
    }
    let poses = if before.is_empty() { None } else { stages::transforms(&work.case).ok() };
    let rows = match poses {
        Some((pre_from_post, mni_from_pre)) => {
            [posed(&scans.pre, &mni_from_pre), posed(&scans.post, &pre_from_post.then(&mni_from_pre))]
        }
        None => [as_scanned(&scans.pre), as_scanned(&scans.post)],
    };
    if let Some((png, _)) = picture(&rows) {
        write_whole(&work.case.path(layout::REFUSED_PICTURE), &png)?;
        let file = work.case.path(layout::REFUSED_PICTURE).display().to_string();
        let how = if poses.is_some() { "one registered to the other" } else { "as they were given" };
        let what =
            format!("look here first: both scans {how} when the step `{step}` ended (above the one before surgery)");
        work.tell(|p| p.odd(&file, &what));
    }
    let Some(answer) = error.answer() else { return Ok(()) };
    work.case.drop_stale();
    let warnings = before.iter().flat_map(|m| m.warnings.iter().cloned());
    let outcome = ExperimentOutcome {
        kind: ExperimentKind::Resection,
        answer: Some(answer),
        warnings: std::iter::once(error.to_string()).chain(warnings).collect(),
        ..ExperimentOutcome::default()
    };
    outcome::finish(work, &outcome, before)
}

//! A cohort: the subjects of a BIDS data set, each as one case, and all of them together.

mod dataset;
mod foretold;
mod group_level;
mod participant_level;
mod population;

pub use dataset::{Dataset, DatasetError, ScanAndPlan, ScanPair};
pub use foretold::{plan_folder, planned_subject};
pub use group_level::{Group, group};
pub use participant_level::{
    Ended, Participants, Planned, SubjectError, Work, participants, planned, planned_table, table, unwell,
};
pub use population::{Learnt, POPULATION, learn, merge_populations, population_prior, read_population};

use super::error::CohortError;
use super::{Case, Goal, Inputs, Place, Progress, Settings, WorkflowError};
use crate::artefact::{sha256_hex, write_whole};
use crate::experiment::outcome::ExperimentOutcome;
use crate::layout;
use crate::report::cohort::{Member, Status};
use crate::report::derivatives::{dataset_files, subject_files, way_up};
use foretold::with_prediction;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The case folder of a subject below the derivatives.
pub fn case_folder(out: &Path, subject: &str) -> PathBuf {
    out.join(subject).join("hgm")
}

/// Why a subject could not be done; absent when it could.
pub fn log_file(out: &Path, subject: &str) -> PathBuf {
    out.join(format!("logs/{subject}.json"))
}

/// Why a subject did not end well, as `logs/sub-X.json` keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Log {
    /// `input rejected`, `failed` or `quality gate`.
    pub kind: String,
    /// One sentence with the remedy.
    pub message: String,
    /// What a run of this subject alone would have ended with.
    pub exit_code: u8,
}

/// Writes what lies once at the top of the derivatives.
///
/// # Errors
/// [`CohortError`] when the folder cannot be made.
pub fn begin(dataset: &Dataset, out: &Path) -> Result<(), CohortError> {
    std::fs::create_dir_all(out).map_err(|source| CohortError::NoFolder { out: out.to_path_buf(), source })?;
    let absolute = |folder: &Path| {
        folder.canonicalize().map_err(|source| CohortError::Lost { folder: folder.to_path_buf(), source })
    };
    let (from, raw) = (absolute(out)?, absolute(&dataset.folder)?);
    for (file, bytes) in dataset_files(way_up(&from, &raw).as_deref()) {
        write_whole(&out.join(file), &bytes)?;
    }
    Ok(())
}

/// One subject from its scans to its files under BIDS names.
///
/// # Errors
/// As [`super::run_to`].
pub fn subject(
    goal: Goal,
    (dataset, pair): (&Dataset, &ScanPair),
    (out, place): (&Path, &Place),
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<Case, WorkflowError> {
    let inputs = Inputs::pair(dataset.folder.join(&pair.pre.0), dataset.folder.join(&pair.post.0));
    let name = pair.pre.0.split('/').next().unwrap_or_default();
    let case = with_prediction(goal, &inputs, place, settings, progress).or_else(|error| {
        if error.answer().is_some() {
            // What the scans said has its page, too.
            let page = Case::at(&place.folder).read(layout::PAGE)?;
            write_whole(&out.join(format!("{name}.html")), &page)?;
        }
        Err(error)
    })?;
    for (file, bytes) in subject_files(case.folder(), &pair.pre, &pair.post)? {
        write_whole(&out.join(file), &bytes)?;
    }
    foretold::held_against(&case, (out, name), progress)?;
    Ok(case)
}

/// What is known of a subject for the table of all; `cases` is below which the case folders lie.
///
/// # Errors
/// An outcome or a log that is damaged.
pub fn member(out: &Path, cases: &Path, subject: &str) -> Result<Member, CohortError> {
    let case = case_folder(cases, subject);
    let read = |file: &str| std::fs::read_to_string(case.join(file)).ok();
    let shown = format!("{subject}/hgm/{}", layout::OUTCOME);
    let outcome = read(layout::OUTCOME).map(|text| ExperimentOutcome::from_json(&text, &shown));
    let file = log_file(out, subject);
    let log: Option<Log> = match std::fs::read(&file) {
        Err(_) => None,
        Ok(bytes) => Some(serde_json::from_slice(&bytes).map_err(|_| CohortError::Log { file })?),
    };
    let answer = outcome.as_ref().and_then(|read| read.as_ref().ok()).and_then(|outcome| outcome.answer);
    let status = match (&log, &outcome) {
        (Some(log), _) if log.exit_code == 4 && answer.is_some() => Status::of(answer),
        (Some(log), _) if log.exit_code == 4 => Status::QualityGate,
        (Some(_), _) => Status::Failed,
        (None, Some(_)) => Status::Done,
        (None, None) => Status::Missing,
    };
    Ok(Member {
        participant_id: subject.to_owned(),
        status,
        message: log.map(|log| format!("{}: {}", log.kind, log.message)),
        outcome: outcome.transpose()?,
        settings_sha256: read(layout::SETTINGS).map(|text| sha256_hex(text.as_bytes())),
    })
}

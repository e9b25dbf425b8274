//! A cohort: the subjects of a BIDS data set, each as one case, and all of them together.

mod dataset;
mod folderless;
mod foretold;
mod group_level;
mod out_folder;
mod participant_level;
mod population;
mod published;

pub use dataset::{Dataset, DatasetError, ScanAndPlan, ScanPair};
pub use foretold::{plan_folder, planned_subject};
pub use group_level::{Group, group};
pub use participant_level::{
    Ended, Participants, Planned, SubjectError, Work, participants, planned, planned_table, some_can_be_done, table,
    unwell,
};
pub use population::{Learnt, POPULATION, learn, merge_populations, population_prior, read_population};

use super::error::CohortError;
use super::{Case, Goal, Inputs, Place, Progress, Settings, WorkflowError};
use crate::artefact::{sha256_hex, write_whole};
use crate::experiment::outcome::ExperimentOutcome;
use crate::layout;
use crate::report::cohort::{Member, Status};
use crate::report::derivatives::{dataset_files, subject_files, way_up};
use folderless::without_folders;
use foretold::with_prediction;
use out_folder::may_hold_cases;
use published::Published;
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

/// Writes what lies once at the top of the derivatives; `cases` is below which the case folders lie.
///
/// # Errors
/// [`CohortError`] when the folder cannot be made, or one of the two holds scans or another program's files.
pub fn begin(dataset: &Dataset, out: &Path, cases: &Path) -> Result<(), CohortError> {
    may_hold_cases(dataset, out, cases)?;
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

/// One subject from its scans to its files under BIDS names, in place of those of an earlier run.
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
    let published = Published { out, page: format!("{name}.html"), scans: &[&pair.pre, &pair.post] };
    let case = with_prediction(goal, &inputs, place, settings, progress).or_else(|error| {
        published.after(&Case::at(&place.folder), &error)?;
        Err(error)
    })?;
    published.replace(&subject_files(case.folder(), &pair.pre, &pair.post)?)?;
    foretold::held_against(&case, (out, name), progress)?;
    Ok(case)
}

/// What is known of a subject for the table of all; `cases` is below which the case folders lie. Numbers are those of its last run
/// alone: where that failed, or what lies there is not of one state, an earlier answer is nobody's.
///
/// # Errors
/// An outcome or a log that is damaged.
pub fn member(out: &Path, cases: &Path, subject: &str) -> Result<Member, CohortError> {
    let case = Case::at(&case_folder(cases, subject));
    let read = |file: &str| std::fs::read_to_string(case.path(file)).ok();
    let file = log_file(out, subject);
    let log: Option<Log> = match std::fs::read(&file) {
        Err(_) => None,
        Ok(bytes) => Some(serde_json::from_slice(&bytes).map_err(|_| CohortError::Log { file })?),
    };
    let gated = log.as_ref().map(|log| log.exit_code == 4);
    let (mut outcome, mut stale) = (None, None);
    if let Some(text) = read(layout::OUTCOME).filter(|_| gated != Some(false)) {
        let shown = format!("{subject}/hgm/{}", layout::OUTCOME);
        match case.check_outcome() {
            Ok(()) => outcome = Some(ExperimentOutcome::from_json(&text, &shown)?),
            Err(error) => stale = Some(without_folders(&error.to_string(), &[out, cases])),
        }
    }
    // A gate that what lies there passes has stopped a later run than the one that made it.
    if gated == Some(true) && case.quality_gate().is_ok() {
        outcome = outcome.filter(|outcome| outcome.answer.is_some());
    }
    let answer = outcome.as_ref().and_then(|outcome| outcome.answer);
    let status = match (gated, &outcome, &stale) {
        (Some(true), ..) => Status::of(answer),
        (Some(false), ..) => Status::Failed,
        (None, Some(_), _) => Status::Done,
        (None, None, Some(_)) => Status::Unfinished,
        (None, None, None) => Status::Missing,
    };
    Ok(Member {
        participant_id: subject.to_owned(),
        has_page: published::page_of(out, subject, &status).is_some(),
        status,
        message: log.map(|log| format!("{}: {}", log.kind, log.message)).or(stale),
        settings_sha256: read(layout::SETTINGS).filter(|_| outcome.is_some()).map(|text| sha256_hex(text.as_bytes())),
        outcome,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::fresh::tests::answered;

    /// A data set's derivatives in which one subject has an answer.
    fn derivatives() -> (tempfile::TempDir, Case) {
        let out = tempfile::tempdir().unwrap();
        let case = answered(&case_folder(out.path(), "sub-01"), &["sample-03"]);
        (out, case)
    }

    fn read(out: &Path) -> Member {
        member(out, out, "sub-01").unwrap()
    }

    #[test]
    fn an_answer_of_other_settings_is_unfinished_and_lends_nothing_to_the_table() {
        let (out, case) = derivatives();
        let before = read(out.path());
        assert!(before.status == Status::Done && before.outcome.is_some() && before.settings_sha256.is_some());
        write_whole(&case.path(layout::SETTINGS), b"seed = 1").unwrap();
        let after = read(out.path());
        assert!(after.outcome.is_none() && after.settings_sha256.is_none());
        let said = after.message.unwrap();
        assert!(after.status == Status::Unfinished && said.starts_with("sub-01/hgm: sim/outcome.json"), "{said}");
        // A folder is the same with a slash behind it.
        assert_eq!(read(&out.path().join("")).message.unwrap(), said);
    }

    #[test]
    fn a_subject_whose_last_run_failed_lends_no_earlier_figures() {
        let (out, _) = derivatives();
        for (exit_code, status) in [(1, Status::Failed), (3, Status::Failed), (4, Status::QualityGate)] {
            let log = Log { kind: "input rejected".to_owned(), message: "no brain".to_owned(), exit_code };
            write_whole(&log_file(out.path(), "sub-01"), &serde_json::to_vec(&log).unwrap()).unwrap();
            let member = read(out.path());
            // Where a gate stopped it, what lies there has to be what the gate refused: here nothing says so.
            let told = member.outcome.is_some();
            assert_eq!((member.status, told), (status, exit_code == 4), "exit code {exit_code}");
            assert_eq!(member.message.unwrap(), "input rejected: no brain");
            assert!(!member.has_page, "none was published");
            write_whole(&out.path().join("sub-01.html"), b"page").unwrap();
            assert_eq!(read(out.path()).has_page, exit_code == 4, "exit code {exit_code}");
            std::fs::remove_file(out.path().join("sub-01.html")).unwrap();
        }
    }
}

//! The participant level: each subject through the whole job, then its files under BIDS names.

use super::folderless::without_folders;
use super::out_folder::may_hold_cases;
use super::published::page_of;
use super::{Dataset, DatasetError, Log, begin, case_folder, log_file, plan_folder, planned_subject, subject};
use crate::artefact::write_whole;
use crate::report::cohort::Status;
use crate::workflow::error::{CohortError, ErrorKind, WorkflowError};
use crate::workflow::{Goal, Place, Progress, Settings};
use serde::Serialize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What is done with each subject.
#[derive(Clone, Copy, Debug)]
pub enum Work<'a> {
    /// Its pair of scans, so far.
    Pair(Goal),
    /// A prediction, from its scan before surgery and the mask of what is to be taken.
    Plan {
        /// The data set of the masks.
        plans: &'a Path,
        /// What chooses among several masks of a subject.
        chosen: &'a [String],
    },
}

/// What is asked of the subjects.
#[derive(Clone, Copy, Debug)]
pub struct Participants<'a> {
    /// Their scans.
    pub dataset: &'a Dataset,
    /// What chooses among several scans of a session.
    pub entities: &'a [String],
    /// What is done with each.
    pub work: Work<'a>,
    /// Where the derivatives go.
    pub out: &'a Path,
    /// Below which the case folders lie.
    pub cases: &'a Place,
    /// Whether the first subject that cannot be done is the last.
    pub stop_on_first_crash: bool,
}

impl Participants<'_> {
    /// What page and log of a subject are called.
    fn called(&self, subject: &str) -> String {
        match self.work {
            Work::Pair(_) => subject.to_owned(),
            Work::Plan { .. } => format!("{subject}_plan"),
        }
    }

    /// The folders of this machine that a message may name.
    fn folders(&self) -> Vec<&Path> {
        let plans = match self.work {
            Work::Pair(_) => None,
            Work::Plan { plans, .. } => Some(plans),
        };
        [self.out, &self.dataset.folder, &self.cases.folder].into_iter().chain(plans).collect()
    }

    /// Its case folder.
    fn folder(&self, subject: &str) -> PathBuf {
        let below = match self.work {
            Work::Pair(_) => case_folder,
            Work::Plan { .. } => plan_folder,
        };
        below(&self.cases.folder, subject)
    }
}

/// Why a subject did not end well.
#[derive(Debug, Error)]
pub enum SubjectError {
    /// Its job.
    #[error(transparent)]
    Job(#[from] WorkflowError),
    /// A panic.
    #[error(
        "the program stopped by a defect of its own (its words are on standard error, above this line); the other \
         subjects go on; please report it with those words"
    )]
    Defect,
}

impl SubjectError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Job(error) => error.kind(),
            Self::Defect => ErrorKind::Failed,
        }
    }

    /// What the table of all subjects says of it.
    fn status(&self) -> Status {
        match self {
            Self::Job(error) if error.kind() == ErrorKind::QualityGate => Status::of(error.answer()),
            _ => Status::Failed,
        }
    }
}

/// How a subject ended.
#[derive(Debug, Serialize)]
pub struct Ended {
    /// `sub-01`.
    pub participant_id: String,
    /// In a word.
    pub status: Status,
    /// Its page, where there is one.
    pub page: Option<PathBuf>,
    /// Why it did not end well.
    pub message: Option<String>,
    /// Who is to do something about that.
    #[serde(skip)]
    pub fault: Option<ErrorKind>,
}

/// Every subject, one after the other: what one cannot do costs the others nothing. `words` says what is kept of an error.
///
/// # Errors
/// Derivatives that cannot be begun; the disk's.
///
/// # Panics
/// Never: a log is plain data.
pub fn participants(
    asked: &Participants<'_>,
    settings: &Settings,
    progress: &mut dyn Progress,
    words: &mut dyn FnMut(&str, SubjectError) -> Log,
) -> Result<Vec<Ended>, WorkflowError> {
    begin(asked.dataset, asked.out, &asked.cases.folder)?;
    let mut done = Vec::new();
    for name in &asked.dataset.subjects {
        progress.noted(name);
        // A defect of the program in one subject must not cost the others their night.
        let outcome = catch_unwind(AssertUnwindSafe(|| one(asked, name, settings, progress)));
        let outcome = outcome.unwrap_or(Err(SubjectError::Defect));
        let called = asked.called(name);
        let file = log_file(asked.out, &called);
        let mut end = Ended {
            participant_id: name.clone(),
            status: outcome.as_ref().err().map_or(Status::Done, SubjectError::status),
            page: None,
            message: None,
            fault: outcome.as_ref().err().map(SubjectError::kind),
        };
        match outcome {
            Ok(()) => {
                std::fs::remove_file(&file).ok();
            }
            Err(error) => {
                let mut log = words(name, error);
                log.message = without_folders(&log.message, &asked.folders());
                let text = serde_json::to_string_pretty(&log).expect("a log is plain data") + "\n";
                write_whole(&file, text.as_bytes())?;
                end.message = Some(log.message);
            }
        }
        let failed = end.status == Status::Failed;
        end.page = page_of(asked.out, &called, &end.status);
        done.push(end);
        if failed && asked.stop_on_first_crash {
            break;
        }
    }
    Ok(done)
}

fn one(
    asked: &Participants<'_>,
    name: &str,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<(), SubjectError> {
    let (dataset, entities) = (asked.dataset, asked.entities);
    let place = Place { folder: asked.folder(name), ..asked.cases.clone() };
    let out = (asked.out, &place);
    let case = match asked.work {
        Work::Pair(goal) => {
            let pair = dataset.pair(name, entities).map_err(WorkflowError::from)?;
            subject(goal, (dataset, &pair), out, settings, progress)?
        }
        Work::Plan { plans, chosen } => {
            let planned = dataset.planned(name, entities, (plans, chosen)).map_err(WorkflowError::from)?;
            planned_subject((dataset, &planned), out, settings, progress)?
        }
    };
    Ok(case.quality_gate()?)
}

/// A line for each subject.
pub fn table(done: &[Ended]) -> String {
    let line = |d: &Ended| {
        let page = d.page.as_ref().map(|page| page.display().to_string());
        format!("{:<16} {:<13} {}\n", d.participant_id, d.status.name(), page.unwrap_or_default())
    };
    done.iter().map(line).collect()
}

/// Who did not end well, in a sentence, and whose fault the worst is: a crash is worse than an input that was refused, and that
/// worse than a gate. Nothing where all ended well.
pub fn unwell(done: &[Ended], asked: &Participants<'_>) -> Option<(ErrorKind, String)> {
    let worst = [ErrorKind::Failed, ErrorKind::Rejected, ErrorKind::QualityGate]
        .into_iter()
        .find(|kind| done.iter().any(|d| d.fault == Some(*kind)))?;
    let unwell: Vec<&str> =
        done.iter().filter(|d| d.status != Status::Done).map(|d| d.participant_id.as_str()).collect();
    let all = asked.dataset.subjects.len();
    let left = all - done.len();
    let stopped = if left > 0 { format!(", {left} not begun") } else { String::new() };
    let (count, names, out) = (unwell.len(), unwell.join(", "), asked.out.display());
    Some((worst, format!("{count} of {all} subjects did not end well: {names}{stopped}; see {out}/logs")))
}

/// What would be done with a subject: its scans and its case folder.
#[derive(Debug, Serialize)]
pub struct Planned {
    /// `sub-01`.
    pub participant_id: String,
    /// The scan before surgery.
    pub pre: Option<PathBuf>,
    /// The scan after it.
    pub post: Option<PathBuf>,
    /// The mask of what is to be taken, for a prediction.
    pub plan: Option<PathBuf>,
    /// The case folder.
    pub case: PathBuf,
    /// Why it cannot be done.
    pub message: Option<String>,
}

/// Whether a run would come to a result of anybody.
///
/// # Errors
/// Where it would not.
pub fn some_can_be_done(planned: &[Planned], dataset: &Dataset) -> Result<(), WorkflowError> {
    if planned.iter().all(|subject| subject.message.is_some()) {
        let (dataset, count) = (dataset.folder.clone(), planned.len());
        return Err(CohortError::NobodyToRun { dataset, count }.into());
    }
    Ok(())
}

/// What would be done with every subject; `words` says why one cannot be.
///
/// # Errors
/// A folder that the derivatives or the cases may not go into.
pub fn planned(
    asked: &Participants<'_>,
    words: &dyn Fn(DatasetError) -> String,
) -> Result<Vec<Planned>, WorkflowError> {
    may_hold_cases(asked.dataset, asked.out, &asked.cases.folder)?;
    let (dataset, entities) = (asked.dataset, asked.entities);
    let plan = |name: &String| {
        let found = match asked.work {
            Work::Pair(_) => dataset.pair(name, entities).map(|pair| (pair.pre, Some(pair.post), None)),
            Work::Plan { plans, chosen } => {
                dataset.planned(name, entities, (plans, chosen)).map(|found| (found.pre, None, Some(found.plan)))
            }
        };
        let (found, message) = match found {
            Ok(found) => (Some(found), None),
            Err(error) => (None, Some(words(error))),
        };
        let (pre, post, plan) = found.map_or((None, None, None), |(pre, post, plan)| (Some(pre), post, plan));
        Planned {
            participant_id: name.clone(),
            pre: pre.map(|pre| dataset.folder.join(pre.0)),
            post: post.map(|post| dataset.folder.join(post.0)),
            plan,
            case: asked.folder(name),
            message,
        }
    };
    Ok(asked.dataset.subjects.iter().map(plan).collect())
}

/// A line for each subject that would be done.
pub fn planned_table(planned: &[Planned]) -> String {
    let line = |p: &Planned| {
        let what = p.message.clone().unwrap_or_else(|| format!("would be run into {}", p.case.display()));
        format!("{:<16} {what}\n", p.participant_id)
    };
    planned.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::Silent;

    /// A data set of one subject without scans.
    fn one_subject() -> (tempfile::TempDir, Dataset) {
        let all = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(all.path().join("study/sub-01")).unwrap();
        let dataset = Dataset::open(&all.path().join("study"), &[]).unwrap();
        (all, dataset)
    }

    fn asked<'a>(dataset: &'a Dataset, out: &'a Path, cases: &'a Place) -> Participants<'a> {
        let work = Work::Pair(Goal::Sweep);
        Participants { dataset, entities: &[], work, out, cases, stop_on_first_crash: false }
    }

    #[test]
    fn a_dry_run_refuses_the_folders_that_a_run_would_refuse() {
        let (all, dataset) = one_subject();
        let (raw, out) = (dataset.folder.clone(), all.path().join("out"));
        let plan = |out: &Path, cases: &Path| planned(&asked(&dataset, out, &Place::from(cases)), &|e| e.to_string());
        assert!(plan(&raw, &raw).is_err() && plan(&out, &raw).is_err());
        assert_eq!(plan(&out, &out).unwrap()[0].participant_id, "sub-01");
        assert!(!out.exists());
    }

    #[test]
    fn what_is_kept_of_a_subject_names_no_folder_of_this_machine() {
        let (all, dataset) = one_subject();
        let [out, cases, plans] = ["out/", "scratch/", "hers/plans/"].map(|name| all.path().join(name));
        let place = Place::from(cases.as_path());
        let work = Work::Plan { plans: &plans, chosen: &[] };
        let asked = Participants { work, ..asked(&dataset, &out, &place) };
        let message = format!(
            "{}: none, {}sub-01/x.nii, {}sub-01/hgm, {}sub-01/y.nii",
            plans.display(),
            plans.display(),
            cases.display(),
            out.display()
        );
        let mut words = |_: &str, _| Log { kind: "input rejected".to_owned(), message: message.clone(), exit_code: 3 };
        let done = participants(&asked, &Settings::default(), &mut Silent, &mut words).unwrap();
        let kept = std::fs::read_to_string(log_file(&out, "sub-01_plan")).unwrap();
        let told = done[0].message.as_deref().unwrap();
        assert!(told == "plans/: none, sub-01/x.nii, sub-01/hgm, sub-01/y.nii" && kept.contains(told), "{told}");
    }

    #[test]
    fn a_subject_that_has_no_page_names_none() {
        let (all, dataset) = one_subject();
        let out = all.path().join("out");
        let place = Place::from(out.as_path());
        let mut words = |_: &str, error: SubjectError| Log {
            kind: "input rejected".to_owned(),
            message: error.to_string(),
            exit_code: 3,
        };
        let settings = Settings::default();
        let done = participants(&asked(&dataset, &out, &place), &settings, &mut Silent, &mut words).unwrap();
        assert!(done[0].page.is_none() && done[0].fault == Some(ErrorKind::Rejected));
        assert!(page_of(&out, "sub-02", &Status::QualityGate).is_none());
        std::fs::write(out.join("sub-02.html"), "").unwrap();
        assert!(page_of(&out, "sub-02", &Status::QualityGate).is_some());
        assert!(page_of(&out, "sub-02", &Status::Failed).is_none());
    }
}

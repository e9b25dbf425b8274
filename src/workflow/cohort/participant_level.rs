//! The participant level: each subject through the whole job, then its files under BIDS names.

use super::{Dataset, DatasetError, Log, begin, case_folder, log_file, plan_folder, planned_subject, subject};
use crate::artefact::write_whole;
use crate::report::cohort::Status;
use crate::workflow::error::{ErrorKind, WorkflowError};
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
    /// Its page.
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
    begin(asked.dataset, asked.out)?;
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
                // Without the folders of this machine.
                for folder in [asked.out, &asked.dataset.folder] {
                    log.message = log.message.replace(&format!("{}/", folder.display()), "");
                }
                let text = serde_json::to_string_pretty(&log).expect("a log is plain data") + "\n";
                write_whole(&file, text.as_bytes())?;
                end.message = Some(log.message);
            }
        }
        let failed = end.status == Status::Failed;
        end.page = (!failed).then(|| asked.out.join(format!("{called}.html")));
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

/// What would be done with every subject; `words` says why one cannot be.
pub fn planned(asked: &Participants<'_>, words: &dyn Fn(DatasetError) -> String) -> Vec<Planned> {
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
    asked.dataset.subjects.iter().map(plan).collect()
}

/// A line for each subject that would be done.
pub fn planned_table(planned: &[Planned]) -> String {
    let line = |p: &Planned| {
        let what = p.message.clone().unwrap_or_else(|| format!("would be run into {}", p.case.display()));
        format!("{:<16} {what}\n", p.participant_id)
    };
    planned.iter().map(line).collect()
}

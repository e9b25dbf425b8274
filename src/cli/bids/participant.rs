//! The participant level: each subject through the same code as `hgm run`, then its files under BIDS names.

use super::dataset::{Dataset, NoPair, ScanPair};
use super::{Args, case_folder, log_file};
use crate::artefact::write_whole;
use crate::cli::case::Overrides;
use crate::cli::failure::in_one_line;
use crate::cli::prep;
use crate::cli::{Failure, Reject, Session, run};
use crate::report::cohort::Status;
use crate::report::derivatives::{dataset_files, subject_files, way_up};
use anyhow::{Context, anyhow};
use serde::{Deserialize, Serialize};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Why a subject did not end well, as `logs/sub-X.json` keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Log {
    /// `input rejected`, `failed` or `quality gate`.
    pub kind: String,
    /// One sentence with the remedy.
    pub message: String,
    /// What `hgm run` would have ended with.
    pub exit_code: u8,
}

/// How a subject ended, for `--json`.
#[derive(Debug, Serialize)]
struct Done {
    participant_id: String,
    status: Status,
    page: Option<PathBuf>,
    message: Option<String>,
}

/// What would be run, for workflows: the scans and the case folder of every subject.
#[derive(Debug, Serialize)]
struct Planned {
    participant_id: String,
    pre: Option<PathBuf>,
    post: Option<PathBuf>,
    case: PathBuf,
    message: Option<String>,
}

pub fn plan(args: &Args, dataset: &Dataset, session: &Session) -> Result<(), Failure> {
    let plan = |subject: &String| {
        let (pair, message) = match dataset.pair(subject, &args.entity) {
            Ok(pair) => (Some(pair), None),
            Err(NoPair(message)) => (None, Some(message)),
        };
        Planned {
            participant_id: subject.clone(),
            pre: pair.as_ref().map(|pair| dataset.folder.join(&pair.pre.0)),
            post: pair.as_ref().map(|pair| dataset.folder.join(&pair.post.0)),
            case: case_folder(&args.out, subject),
            message,
        }
    };
    let planned: Vec<Planned> = dataset.subjects.iter().map(plan).collect();
    let line = |p: &Planned| {
        let what = p.message.clone().unwrap_or_else(|| format!("would be run into {}", p.case.display()));
        format!("{:<16} {what}\n", p.participant_id)
    };
    let text: String = planned.iter().map(line).collect();
    session.emit(&serde_json::json!({ "subjects": planned }), &text)
}

pub fn run(args: &Args, dataset: &Dataset, session: &Session) -> Result<(), Failure> {
    let refused = || {
        let out = args.out.display();
        format!("{out}: the folder for the derivatives cannot be made; name a folder that you may write to")
    };
    std::fs::create_dir_all(&args.out).with_context(refused).reject()?;
    let absolute = |folder: &Path| {
        let lost = || format!("{}: the folder cannot be found; check the path", folder.display());
        folder.canonicalize().with_context(lost).reject()
    };
    let (out, raw) = (absolute(&args.out)?, absolute(&dataset.folder)?);
    for (file, bytes) in dataset_files(way_up(&out, &raw).as_deref()) {
        write_whole(&args.out.join(file), &bytes)?;
    }
    let mut done: Vec<Done> = Vec::new();
    let mut worst: Option<Failure> = None;
    for subject in &dataset.subjects {
        // A defect of the program in one subject must not cost the others their night.
        let end = catch_unwind(AssertUnwindSafe(|| one(args, dataset, subject, session)));
        let end = end.unwrap_or_else(|_| Err(defect().into()));
        let page = args.out.join(format!("{subject}.html"));
        let log = log_file(&args.out, subject);
        let status = match &end {
            Ok(()) => {
                std::fs::remove_file(&log).ok();
                Status::Done
            }
            Err(failure) => {
                let log_bytes = serde_json::to_string_pretty(&record(failure, args))? + "\n";
                write_whole(&log, log_bytes.as_bytes())?;
                let (kind, error) = failure.parts();
                eprintln!("hgm: {kind}: {subject}: {}", in_one_line(error));
                if matches!(failure, Failure::QualityGate(_)) { Status::QualityGate } else { Status::Failed }
            }
        };
        let failed = status == Status::Failed;
        let message = end.as_ref().err().map(|failure| record(failure, args).message);
        let page = (!failed).then_some(page);
        done.push(Done { participant_id: subject.clone(), status, page, message });
        worst = end.err().into_iter().chain(worst).max_by_key(severity);
        if failed && args.stop_on_first_crash {
            break;
        }
    }
    session.emit(&serde_json::json!({ "subjects": done }), &table(&done))?;
    let unwell: Vec<&str> =
        done.iter().filter(|d| d.status != Status::Done).map(|d| d.participant_id.as_str()).collect();
    let left = dataset.subjects.len() - done.len();
    let stopped = if left > 0 { format!(", {left} not begun") } else { String::new() };
    let summary = anyhow!(
        "{} of {} subjects did not end well: {}{stopped}; see {}/logs",
        unwell.len(),
        dataset.subjects.len(),
        unwell.join(", "),
        args.out.display()
    );
    match worst {
        None => Ok(()),
        Some(Failure::Failed(_)) => Err(Failure::Failed(summary)),
        Some(Failure::Rejected(_)) => Err(Failure::Rejected(summary)),
        Some(Failure::QualityGate(_)) => Err(Failure::QualityGate(summary)),
    }
}

/// One subject from scans to derivatives.
fn one(args: &Args, dataset: &Dataset, subject: &str, session: &Session) -> Result<(), Failure> {
    let ScanPair { pre, post } =
        dataset.pair(subject, &args.entity).map_err(|NoPair(message)| anyhow!(message)).reject()?;
    let case = case_folder(&args.out, subject);
    tracing::info!("{subject}");
    let job = run::Args {
        prep: prep::Args {
            pre: dataset.folder.join(&pre.0),
            post: dataset.folder.join(&post.0),
            output: case.clone(),
            overrides: Overrides::default(),
            mesh: args.mesh.clone(),
        },
        analysis: args.analysis.clone(),
    };
    let analysed = run::analyse(&job, session)?;
    for (file, bytes) in subject_files(&case, &pre, &post)? {
        write_whole(&args.out.join(file), &bytes)?;
    }
    analysed.patient.quality_gate()
}

/// What is kept of a failure: without the folders of this machine.
fn record(failure: &Failure, args: &Args) -> Log {
    let (kind, error) = failure.parts();
    let mut message = in_one_line(error);
    for folder in [&args.out, &args.bids_dir] {
        message = message.replace(&format!("{}/", folder.display()), "");
    }
    Log { kind: kind.to_owned(), message, exit_code: failure.code() }
}

/// What is said of a subject that met a panic.
fn defect() -> anyhow::Error {
    anyhow!(
        "the program stopped by a defect of its own (its words are on standard error, above this line); the other \
         subjects go on; please report it with those words"
    )
}

/// A crash is worse than an input that was refused, and that worse than a gate.
fn severity(failure: &Failure) -> u8 {
    match failure {
        Failure::Failed(_) => 2,
        Failure::Rejected(_) => 1,
        Failure::QualityGate(_) => 0,
    }
}

fn table(done: &[Done]) -> String {
    let line = |d: &Done| {
        let page = d.page.as_ref().map(|page| page.display().to_string());
        format!("{:<16} {:<13} {}\n", d.participant_id, d.status.name(), page.unwrap_or_default())
    };
    done.iter().map(line).collect()
}

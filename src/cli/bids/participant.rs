//! The participant level: each subject through the same code as `hgm run`, then its files under BIDS names.

use super::options::Args;
use crate::artefact::write_whole;
use crate::cli::failure::{Answered, in_one_line};
use crate::cli::flags::Flags;
use crate::cli::{Failure, Session, run};
use crate::report::cohort::Status;
use crate::workflow::Settings;
use crate::workflow::cohort::{self, Dataset, Log, case_folder, log_file, plan_folder};
use anyhow::anyhow;
use serde::Serialize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

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
    /// The mask of what is to be taken, with `--predict`.
    plan: Option<PathBuf>,
    case: PathBuf,
    message: Option<String>,
}

pub fn plan(args: &Args, dataset: &Dataset, session: &Session) -> Result<(), Failure> {
    let plan = |subject: &String| {
        let found = if args.predict {
            let plans = args.plans();
            let found = dataset.planned(subject, &args.entity, (&plans, &args.plan));
            found.map(|found| (found.pre, None, Some(found.plan)))
        } else {
            dataset.pair(subject, &args.entity).map(|pair| (pair.pre, Some(pair.post), None))
        };
        let (found, message) = match found {
            Ok(found) => (Some(found), None),
            Err(error) => (None, Some(in_one_line(Failure::from(error).parts().1))),
        };
        let (pre, post, plan) = found.map_or((None, None, None), |(pre, post, plan)| (Some(pre), post, plan));
        Planned {
            participant_id: subject.clone(),
            pre: pre.map(|pre| dataset.folder.join(pre.0)),
            post: post.map(|post| dataset.folder.join(post.0)),
            plan,
            case: folder_of(args, subject),
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
    let settings = settings(args, session)?;
    cohort::begin(dataset, &args.out)?;
    let mut done: Vec<Done> = Vec::new();
    let mut worst: Option<Failure> = None;
    for subject in &dataset.subjects {
        // A defect of the program in one subject must not cost the others their night.
        let end = catch_unwind(AssertUnwindSafe(|| one(args, dataset, subject, &settings, session)));
        let end = end.unwrap_or_else(|_| Err(defect().into()));
        let name = name_of(args, subject);
        let page = args.out.join(format!("{name}.html"));
        let log = log_file(&args.out, &name);
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
                match failure {
                    Failure::QualityGate(e) => Status::of(e.downcast_ref::<Answered>().map(|a| a.answer)),
                    _ => Status::Failed,
                }
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

/// Those of `hgm run` or `hgm predict`, with the memory that the mesh engines may take.
fn settings(args: &Args, session: &Session) -> Result<Settings, Failure> {
    let mut settings = if args.predict {
        let mut flags = Flags::default();
        args.mesh.over(&mut flags);
        args.analysis.prior.over(&mut flags);
        args.analysis.population.over(&mut flags)?;
        session.settings(flags)?
    } else {
        run::settings(&args.analysis, &args.mesh, session)?
    };
    if let Some(gb) = args.mem_gb {
        settings.mesh.limits.memory_mb = 1000 * gb;
    }
    Ok(settings)
}

/// What page and log of a subject are called.
fn name_of(args: &Args, subject: &str) -> String {
    if args.predict { format!("{subject}_plan") } else { subject.to_owned() }
}

fn folder_of(args: &Args, subject: &str) -> PathBuf {
    if args.predict { plan_folder(args.cases(), subject) } else { case_folder(args.cases(), subject) }
}

/// One subject from scans to derivatives.
fn one(args: &Args, dataset: &Dataset, subject: &str, settings: &Settings, session: &Session) -> Result<(), Failure> {
    let place = session.place(&folder_of(args, subject));
    if args.predict {
        let planned = dataset.planned(subject, &args.entity, (&args.plans(), &args.plan))?;
        tracing::info!("{subject}");
        let out = (args.out.as_path(), &place);
        let case = cohort::planned_subject((dataset, &planned), out, settings, &mut session.listener())?;
        return Ok(case.quality_gate()?);
    }
    let pair = dataset.pair(subject, &args.entity)?;
    tracing::info!("{subject}");
    let goal = args.analysis.goal();
    let case = cohort::subject(goal, (dataset, &pair), (&args.out, &place), settings, &mut session.listener())?;
    Ok(case.quality_gate()?)
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

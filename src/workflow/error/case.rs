//! Why a case cannot be read or worked on.

use crate::artefact::Reason;
use crate::workflow::stage_name::Subject;
use std::path::PathBuf;
use thiserror::Error;

/// Why a case cannot be read.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum CaseError {
    #[error("no stage `{wanted}` in this case; it has {}", stages.join(", "))]
    NoStage { wanted: String, stages: Vec<String> },
    #[error("{}: there is no state `{state}` in this case; it has {}", folder.display(), known(states))]
    NoState { folder: PathBuf, state: String, states: Vec<String> },
    #[error("{}: not a case folder", folder.display())]
    NotACase { folder: PathBuf },
    #[error("{}: {file} is not there", folder.display())]
    Missing { folder: PathBuf, file: String, subject: Option<Subject> },
    #[error("{}: {file} cannot be read ({source}); check its permissions", folder.display())]
    Unreadable { folder: PathBuf, file: String, source: std::io::Error },
    #[error("{}: {file} is damaged or another version's", folder.display())]
    Damaged { folder: PathBuf, file: String, subject: Option<Subject> },
    #[error("{}: {file} is not on the grid of {other}: one of the two is not this case's", folder.display())]
    Grid { folder: PathBuf, file: &'static str, other: &'static str },
    #[error(
        "{}: {file} holds displacements of {found} nodes and {mesh} has {nodes}: one of the two is not this phantom's",
        folder.display()
    )]
    OtherMesh { folder: PathBuf, file: &'static str, mesh: &'static str, found: usize, nodes: usize },
    #[error("{}: this is a phantom, and a patient's case is asked for", folder.display())]
    Phantom { folder: PathBuf },
    #[error("{}: this is a patient's case, and a phantom is asked for", folder.display())]
    Patient { folder: PathBuf },
    #[error("{}: this is a prediction before an operation, and a case of two scans is asked for", folder.display())]
    Planned { folder: PathBuf },
    #[error("{}: this is a case of two scans or a phantom, and a prediction from one scan is asked for", folder.display())]
    NotPlanned { folder: PathBuf },
    #[error("{}: the case was made from another {which} scan", folder.display())]
    OtherScan { folder: PathBuf, which: &'static str },
    #[error("{}: {what} is not of the present state: {}", folder.display(), in_words(reasons))]
    Stale { folder: PathBuf, what: String, reasons: Vec<Reason> },
    #[error("{}: another job works in this folder{}", folder.display(), by(holder))]
    Held { folder: PathBuf, holder: String },
    #[error("the phantom in this folder has {made} and {asked} were asked for", made = tissues(*made), asked = tissues(*asked))]
    OtherTissues { made: usize, asked: usize },
    #[error("{}: no tissue was resected here that could be put back", folder.display())]
    NothingResected { folder: PathBuf },
    #[error("{}: no result holds an array `{name}`", folder.display())]
    NoField { folder: PathBuf, name: String },
}

pub(super) fn in_words(reasons: &[Reason]) -> String {
    reasons.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn known(states: &[String]) -> String {
    if states.is_empty() { "none yet".to_owned() } else { states.join(", ") }
}

fn by(holder: &str) -> String {
    if holder.is_empty() { " (a part of a sweep)".to_owned() } else { format!(" ({holder})") }
}

fn tissues(count: usize) -> String {
    if count == 1 { "1 tissue".to_owned() } else { format!("{count} tissues") }
}

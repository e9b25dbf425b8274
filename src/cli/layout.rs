//! `hgm layout`: the files of a case, and the commands that fill a cohort's.

use super::{Failure, Session};
use crate::layout::TABLE;
use serde::Serialize;
use serde_json::json;

/// Print every file a case holds: what it is, the frame it is in, who makes it, its name in BIDS derivatives
///
/// With --json also the commands of a cohort, each after the one before it, for workflow managers.
///
/// Example: hgm layout --json
#[derive(Debug, clap::Args)]
pub struct Args {}

/// A command of a cohort; words in braces stand for the subject's files and the part of a sweep.
#[derive(Debug, Serialize)]
struct Command {
    name: &'static str,
    words: &'static [&'static str],
}

const COHORT: [Command; 6] = [
    Command {
        name: "predict",
        words: &["bids", "{bids_dir}", "{out}", "participant", "--predict", "--participant-label", "{participant_id}"],
    },
    Command { name: "prep", words: &["prep", "{pre}", "{post}", "-o", "{case}"] },
    Command { name: "sweep", words: &["sweep", "{case}", "--shard", "{shard}"] },
    Command { name: "reduce", words: &["reduce", "{case}"] },
    Command {
        name: "report",
        words: &["bids", "{bids_dir}", "{out}", "participant", "--participant-label", "{participant_id}"],
    },
    Command { name: "group", words: &["bids", "{bids_dir}", "{out}", "group"] },
];

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let file = |file: &crate::layout::Entry| {
        let bids = file.bids.map(|bids| bids.spelt());
        json!({"path": file.path, "what": file.what, "space": file.space, "maker": file.maker, "bids": bids})
    };
    let files: Vec<_> = TABLE.iter().map(file).collect();
    let line = |text: String, file: &crate::layout::Entry| text + &format!("{:<55} {}\n", file.path, file.what);
    let text = TABLE.iter().fold(String::new(), line);
    session.emit(&json!({ "files": files, "cohort": COHORT }), &text)
}

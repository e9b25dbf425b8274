//! `hgm report CASE`: the page again from what is there.

use super::{Failure, Session};
use crate::workflow;
use std::path::PathBuf;

/// Make CASE/report.html again from the files of a case folder
///
/// Example: hgm report case-01
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run`, `hgm prep` or `hgm phantom`
    pub case: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let shown = workflow::report(&session.place(&args.case))?.page().display().to_string();
    session.emit(&serde_json::json!({ "report": shown }), &shown)
}

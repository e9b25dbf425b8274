//! `hgm report CASE`: the page again from what is there.

use super::{Failure, Reject, Session};
use crate::report::case::write_report;
use std::path::PathBuf;

/// Make CASE/report.html again from the files of a case directory
///
/// Example: hgm report case-01
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Directory made by `hgm run`, `hgm prep` or `hgm phantom`
    pub case: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let report = write_report(&args.case).reject()?;
    let shown = report.display().to_string();
    session.emit(&serde_json::json!({ "report": shown }), &shown)
}

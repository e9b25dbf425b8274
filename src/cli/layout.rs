//! `hgm layout`: the files of a case, and the commands that fill a cohort's.

use super::{Failure, Session};
use crate::manual::{cohort_commands::COHORT, files};
use serde_json::json;

/// Print every file a case holds: what it is, the frame it is in, who makes it, its name in BIDS derivatives
///
/// With --json also the commands of a cohort, each after the one before it, for workflow managers.
///
/// Example: hgm layout --json
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    session.emit(&json!({ "files": files::list(), "cohort": COHORT }), &files::lines())
}

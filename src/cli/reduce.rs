//! `hgm reduce`: the parts of a sweep joined.

use super::run::in_words;
use super::{Failure, Session};
use crate::workflow::{self, Layer};
use std::path::PathBuf;

/// Joins the shards of a sweep: outcome, table and page, the same bytes as one run
///
/// Example: hgm reduce case
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder whose samples `hgm sweep --shard` has made
    case: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = session.settings_of(&args.case, Layer::default())?;
    let case = workflow::reduce(&session.place(&args.case), &settings, &mut *session.listener())?;
    session.emit(&case.outcome()?, &in_words(&case)?)?;
    Ok(case.quality_gate()?)
}

//! `hgm compare`: models of one patient by their evidence.

use super::{Failure, Session};
use crate::report::in_words::models_table;
use crate::workflow::{self, Layer};
use std::path::PathBuf;

/// Models of a prepared case by their evidence: supports fixed or sliding, one or two tissues, each law
///
/// Example: hgm compare case
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run` or `hgm prep`
    case: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = session.settings_of(&args.case, Layer::default())?;
    let (case, comparison) = workflow::compare(&session.place(&args.case), &settings, &mut *session.listener())?;
    let words = format!("{}\n{}", comparison.verdict.sentence, models_table(&comparison));
    session.emit(&comparison, &words)?;
    Ok(case.quality_gate()?)
}

//! `hgm reduce`: the parts of a sweep joined.

use super::case::{Case, PriorOptions, SampleMode};
use super::patient::Patient;
use super::run::summary;
use super::{Failure, Session};
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
    let case = Case::open(&args.case, session);
    let patient = Patient::open(&case, None, session)?;
    let (outcome, page) = patient.sweep(SampleMode::Gather, &PriorOptions::default(), session)?;
    session.emit(&outcome, &summary(&outcome, &page))?;
    patient.quality_gate()
}

//! `hgm compare`: models of one patient by their evidence.

use super::flags::Flags;
use super::{Failure, Session};
use crate::experiment::compare::Comparison;
use crate::workflow;
use std::path::PathBuf;

/// Models of a prepared case beside each other (one or two tissues, each law): which of them what was seen speaks for
///
/// Example: hgm compare case
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run` or `hgm prep`
    case: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = session.settings_of(&args.case, Flags::default())?;
    let (case, comparison) = workflow::compare(&session.place(&args.case), &settings, &mut session.listener())?;
    session.emit(&comparison, &table(&comparison))?;
    Ok(case.quality_gate()?)
}

/// The comparison for a terminal.
fn table(comparison: &Comparison) -> String {
    let best = comparison.candidates.first().map_or(0.0, |c| c.log_evidence);
    let mut text = format!("{}\n", comparison.verdict.sentence);
    text += "model                                       log odds  weight  explained  finding\n";
    for c in &comparison.candidates {
        let (odds, share) = (c.log_evidence - best, 100.0 * c.explained_share);
        let finding = c.finding.short();
        text += &format!("{:<42} {odds:>9.1} {:>7.3} {share:>8.0} %  {finding}\n", c.name, c.weight);
    }
    text
}

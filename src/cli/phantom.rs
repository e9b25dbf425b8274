//! `hgm phantom`: known moduli go in and must come out.

use super::flags::{Flags, MeshOptions, PriorOptions};
use super::run::in_words;
use super::{Failure, Session};
use crate::experiment::outcome::ExperimentOutcome;
use crate::workflow;
use std::path::PathBuf;

/// The synthetic validation on the template: a reference of known moduli, found again among the samples
///
/// Example: hgm phantom --tissues 2 -o phantom
#[derive(Debug, clap::Args)]
pub struct Args {
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples)
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
    /// Nine samples of every task of the generative model (elastography, linear, hyperelastic; grey, white, healthy brain)
    /// instead of one task's; one tissue only
    #[arg(long, conflicts_with = "study")]
    every_task: bool,
    #[command(flatten)]
    prior: PriorOptions,
    /// Also try the reference's own moduli
    #[arg(long)]
    include_reference: bool,
    /// Where to write
    #[arg(short, long, value_name = "DIR", default_value = "phantom")]
    output: PathBuf,
    #[command(flatten)]
    mesh: MeshOptions,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Flags::default();
    flags.set("phantom.tissues", args.tissues);
    flags.switch("phantom.include_reference", args.include_reference);
    args.prior.over(&mut flags);
    args.mesh.over(&mut flags);
    let (outcome, text) = made(flags, args.every_task, &args.output, session)?;
    session.emit(&outcome, &text)
}

/// A phantom's numbers, and those that matter for a terminal.
///
/// # Errors
/// The first stage that is rejected or fails.
pub fn made(
    flags: Flags,
    every_task: bool,
    folder: &std::path::Path,
    session: &Session,
) -> Result<(ExperimentOutcome, String), Failure> {
    let settings = session.settings(flags)?;
    let case = workflow::phantom(every_task, &session.place(folder), &settings, &mut session.listener())?;
    Ok((case.outcome()?, in_words(&case)?))
}

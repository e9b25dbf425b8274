//! `hgm phantom`: known moduli go in and must come out.

use super::flags::{MeshOptions, PriorOptions};
use super::run::in_words;
use super::{Failure, Session};
use crate::workflow::{self, Layer};
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
    let mut flags = Layer::default();
    flags.set("phantom.tissues", args.tissues);
    flags.switch("phantom.include_reference", args.include_reference);
    args.prior.over(&mut flags);
    args.mesh.over(&mut flags);
    let (settings, place) = (session.settings(flags)?, session.place(&args.output));
    let case = workflow::phantom(args.every_task, &place, &settings, &mut *session.listener())?;
    session.emit(&case.outcome()?, &in_words(&case)?)
}

//! `hgm gp fit|sample|show|paper|studies`: the generative model of brain tissue.

mod fit;
mod options;
mod paper;
mod sample;
mod show;
mod studies;

pub use options::StudyOptions;

use super::{Failure, Session};
use clap::Subcommand;

/// The Gaussian process over the literature: fit it, sample it, show it
///
/// Example: hgm gp sample --task hyperelastic-white --draws 1000
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Fit(fit::Args),
    Sample(sample::Args),
    Show(show::Args),
    Paper(paper::Args),
    Studies(studies::Args),
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    match &args.command {
        Command::Fit(args) => fit::run(args, session),
        Command::Sample(args) => sample::run(args, session),
        Command::Show(args) => show::run(args, session),
        Command::Paper(args) => paper::run(args, session),
        Command::Studies(args) => studies::run(args, session),
    }
}

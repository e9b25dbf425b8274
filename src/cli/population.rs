//! `hgm population`: what cohorts say of people.

use super::{Failure, Session};
use crate::report::cohort_population::file_in_words;
use crate::workflow::cohort::{merge_populations, read_population};
use std::path::PathBuf;

/// What cohorts say of people: join the files that `hgm bids ... group` writes, or show one
///
/// Example: hgm population merge site-a/population.toml site-b/population.toml -o both.toml
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Merge(MergeArgs),
    Show(ShowArgs),
}

/// Cohorts as one, from their files alone: as if all patients had been in one cohort
///
/// A file holds no name, image or date: of each patient one Gaussian over the logarithms of the moduli. Nothing else travels.
///
/// Example: hgm population merge site-a/population.toml site-b/population.toml -o both.toml
#[derive(Debug, clap::Args)]
struct MergeArgs {
    /// Two or more files
    #[arg(required = true, num_args = 2.., value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Where to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// What a population's file says, in words
///
/// Example: hgm population show both.toml
#[derive(Debug, clap::Args)]
struct ShowArgs {
    /// The file
    file: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    match &args.command {
        Command::Merge(MergeArgs { files, output }) => {
            let file = merge_populations(files, output)?;
            session.emit(&file, &(file_in_words(&file) + &output.display().to_string()))
        }
        Command::Show(args) => {
            let file = read_population(&args.file)?;
            session.emit(&file, &file_in_words(&file))
        }
    }
}

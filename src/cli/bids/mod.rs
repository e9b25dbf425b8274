//! `hgm bids`: a BIDS App, from a data set of T1 pairs to derivatives and a table of all subjects.

mod group;
mod participant;

use super::flags::{AnalysisOptions, MeshOptions};
use super::{Failure, Session};
use crate::workflow::cohort::Dataset;
use std::path::PathBuf;

/// A BIDS data set (ses-preop, ses-postop) to derivatives: every subject as `hgm run`, then all in one table
///
/// Example: hgm bids study study/derivatives/hgm participant --participant-label 01 02
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The data set: sub-*/ses-preop/anat/*_T1w.nii.gz and sub-*/ses-postop/anat/*_T1w.nii.gz
    bids_dir: PathBuf,
    /// Where the derivatives go
    out: PathBuf,
    /// participant: each subject from scans to page (resumable); group: all subjects in one table
    #[arg(value_enum)]
    level: Level,
    /// Only these subjects, with or without sub-
    #[arg(long, value_name = "LABEL", num_args = 1.., value_delimiter = ',')]
    participant_label: Vec<String>,
    /// Where a session has several T1 scans: take the one with this entity, such as run-2
    #[arg(long, value_name = "ENTITY")]
    entity: Vec<String>,
    /// End with the first subject that cannot be done [default: go on and name them at the end]
    #[arg(long)]
    stop_on_first_crash: bool,
    /// Only tell what would be run
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    mesh: MeshOptions,
    #[command(flatten)]
    analysis: AnalysisOptions,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Level {
    Participant,
    Group,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let dataset = Dataset::open(&args.bids_dir, &args.participant_label)?;
    match args.level {
        Level::Participant if args.dry_run => participant::plan(args, &dataset, session),
        Level::Participant => participant::run(args, &dataset, session),
        Level::Group => group::run(args, &dataset, session),
    }
}

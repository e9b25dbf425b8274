//! The options of `hgm bids`.

use crate::cli::flags::{AnalysisOptions, MeshOptions};
use std::path::PathBuf;

/// A BIDS data set (ses-preop, ses-postop) to derivatives: every subject as `hgm run`, then all in one table
///
/// Example: hgm bids study study/derivatives/hgm participant --participant-label 01 02
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The data set: sub-*/ses-preop/anat/*_T1w.nii.gz and sub-*/ses-postop/anat/*_T1w.nii.gz
    pub bids_dir: PathBuf,
    /// Where the derivatives go
    pub out: PathBuf,
    /// participant: each subject from scans to page (resumable); group: all subjects in one table
    #[arg(value_enum)]
    pub level: Level,
    /// Only these subjects, with or without sub-
    #[arg(long, value_name = "LABEL", num_args = 1.., value_delimiter = ',')]
    pub participant_label: Vec<String>,
    /// Where a session has several T1 scans: take the one with this entity, such as run-2
    #[arg(long, value_name = "ENTITY")]
    pub entity: Vec<String>,
    /// End with the first subject that cannot be done [default: go on and name them at the end]
    #[arg(long)]
    pub stop_on_first_crash: bool,
    /// Only tell what would be run
    #[arg(long)]
    pub dry_run: bool,
    #[command(flatten)]
    pub mesh: MeshOptions,
    #[command(flatten)]
    pub analysis: AnalysisOptions,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Level {
    Participant,
    Group,
}

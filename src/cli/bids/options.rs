//! The options of `hgm bids`.

use crate::cli::flags::{AnalysisOptions, MeshOptions};
use std::path::{Path, PathBuf};

/// A BIDS data set (ses-preop, ses-postop) to derivatives: every subject as `hgm run`, then all in one table
///
/// Example: hgm bids study study/derivatives/hgm participant --participant-label 01 02
#[derive(Debug, clap::Args)]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of its own")]
pub struct Args {
    /// The data set: sub-*/ses-preop/anat/*_T1w.nii.gz and sub-*/ses-postop/anat/*_T1w.nii.gz
    pub bids_dir: PathBuf,
    /// Where the derivatives go
    pub out: PathBuf,
    /// participant: each subject from scans to page (resumable); group: all subjects in one table
    #[arg(value_enum)]
    pub level: Level,
    /// Only these subjects, with or without sub-
    #[arg(long, visible_alias = "participant_label", value_name = "LABEL", num_args = 1.., value_delimiter = ',')]
    pub participant_label: Vec<String>,
    /// Where a session has several T1 scans: take the one with this entity, such as run-2, or none: the one without any; an only scan is
    /// taken unless it says otherwise (run-1)
    #[arg(long, value_name = "ENTITY")]
    pub entity: Vec<String>,
    /// Before the operation: each subject's scan of ses-preop and the mask of what is to be taken, as `hgm predict` (table [predict] of the
    /// settings), into sub-*/hgm-plan. A pair that is run later takes the prediction's work up and holds it against what was seen
    #[arg(long, conflicts_with_all = ["estimate", "every_task", "tissues", "head"])]
    pub predict: bool,
    /// The data set of the plans: sub-*/ses-preop/anat/*_label-resection_mask.nii.gz, with the entities of the scan
    /// [default: BIDS_DIR/derivatives/plans]
    #[arg(long, value_name = "DIR", requires = "predict")]
    pub plans: Option<PathBuf>,
    /// Where a scan has several plans: take the one with this entity, such as desc-wide
    #[arg(long, value_name = "ENTITY", requires = "predict")]
    pub plan: Vec<String>,
    /// End with the first subject that cannot be done [default: go on and name them at the end]
    #[arg(long)]
    pub stop_on_first_crash: bool,
    /// Only tell what would be run
    #[arg(long)]
    pub dry_run: bool,
    /// Where the case folders go (sub-*/hgm), at both levels [default: into OUT]
    #[arg(short, long, alias = "work_dir", value_name = "DIR")]
    pub work_dir: Option<PathBuf>,
    /// Threads to use, as --threads, which wins
    #[arg(long, alias = "n-procs", alias = "n_procs", alias = "n-cpus", alias = "n_cpus", value_name = "N")]
    pub nprocs: Option<usize>,
    /// Memory at hand in GB: a mesh engine that is a program of its own is held to it (setting mesh.limits.memory_mb)
    #[arg(long, alias = "mem_gb", value_name = "GB", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub mem_gb: Option<u64>,
    /// Taken because every BIDS App has it: hgm runs no validator, and refuses by name what it cannot use
    #[arg(long, alias = "skip_bids_validation")]
    pub skip_bids_validation: bool,
    #[command(flatten)]
    pub mesh: MeshOptions,
    #[command(flatten)]
    pub analysis: AnalysisOptions,
}

impl Args {
    /// Where the plans lie.
    pub fn plans(&self) -> PathBuf {
        self.plans.clone().unwrap_or_else(|| self.bids_dir.join("derivatives/plans"))
    }

    /// Below which the case folders lie.
    pub fn cases(&self) -> &Path {
        self.work_dir.as_deref().unwrap_or(&self.out)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Level {
    Participant,
    Group,
}

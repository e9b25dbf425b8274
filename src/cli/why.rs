//! `hgm why`: what made a stage run again, or would.

use super::flags::{AnalysisOptions, MeshOptions};
use super::{Failure, Session, run};
use crate::workflow::{Asked, results_in_words, why};
use std::path::PathBuf;

/// Which input or setting would make a stage of a case run again, if `hgm run` were called with these options
///
/// Example: hgm why case mesh --cells 100000
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run`, `hgm prep` or `hgm phantom`
    case: PathBuf,
    /// Only this stage: registration, anat, mesh, reference, sim-sample-04 ... [default: all]
    stage: Option<String>,
    /// The pre-operative scan, to see whether it is the one the case was made from
    #[arg(long, value_name = "FILE")]
    pre: Option<PathBuf>,
    /// The post-operative scan, likewise
    #[arg(long, value_name = "FILE")]
    post: Option<PathBuf>,
    #[command(flatten)]
    mesh: MeshOptions,
    #[command(flatten)]
    analysis: AnalysisOptions,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = run::settings(&args.analysis, &args.mesh, session)?;
    let asked =
        Asked { goal: args.analysis.goal(), stage: args.stage.clone(), pre: args.pre.clone(), post: args.post.clone() };
    let explained = why(&asked, &session.place(&args.case), &settings)?;
    session.emit(&serde_json::json!({ "stages": explained }), &results_in_words::explained(&explained))
}

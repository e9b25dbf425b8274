//! `hgm run`: prep, sweep or estimate, report.

use super::flags::{AnalysisOptions, MeshOptions, PairOptions};
use super::{Failure, Session};
use crate::report::in_words::summary;
use crate::workflow::{Case, Layer, Settings, run_to};
use anyhow::anyhow;

/// T1 pair -> everything: prep, a sweep over the prior, per-node errors, report; resumable
///
/// Example: hgm run pre.nii.gz post.nii.gz -o case
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pair: PairOptions,
    #[command(flatten)]
    analysis: AnalysisOptions,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = settings(&args.analysis, &args.pair.mesh, session)?;
    let (goal, place) = (args.analysis.goal(), session.place(&args.pair.output));
    let case = run_to(goal, &args.pair.inputs(), &place, &settings, &mut *session.listener())?;
    session.emit(&case.outcome()?, &in_words(&case)?)?;
    Ok(case.quality_gate()?)
}

/// The settings of a patient's whole job.
pub fn settings(analysis: &AnalysisOptions, mesh: &MeshOptions, session: &Session) -> Result<Settings, Failure> {
    let mut flags = Layer::default();
    analysis.over(&mut flags);
    if analysis.population.given() && !analysis.estimate {
        return Err(Failure::Rejected(anyhow!(
            "--population is a prior of estimates, and a sweep tries the literature's samples: add --estimate, or leave it out"
        )));
    }
    analysis.population.over(&mut flags)?;
    mesh.over(&mut flags);
    session.settings_over(&analysis.goal().own_settings().0, flags)
}

/// What a job has found, for a terminal: the page's own verdict, its figures, and where the page is.
pub fn in_words(case: &Case) -> Result<String, Failure> {
    Ok(summary(&case.outcome()?) + &case.page().display().to_string())
}

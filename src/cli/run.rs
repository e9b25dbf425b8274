//! `hgm run`: prep, sweep or estimate, report.

use super::flags::{AnalysisOptions, MeshOptions, PairOptions};
use super::{Failure, Session};
use crate::report::forecast_in_words::evaluation_table;
use crate::report::in_words::summary;
use crate::workflow::{Case, Inputs, Layer, SeenAfterwards, Settings, evaluate_prediction, run_to};
use anyhow::anyhow;
use std::path::PathBuf;

/// T1 pair -> everything: prep, a sweep over the prior, per-node errors, report; resumable
///
/// Example: hgm run pre.nii.gz post.nii.gz -o case
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pair: PairOptions,
    #[command(flatten)]
    analysis: AnalysisOptions,
    /// A folder of `hgm predict` made from the same pre-operative scan, settings and masks: pose and tissue of that scan are taken
    /// from it, the mesh too where what was taken is what was planned, voxel for voxel (else it is made anew, as it follows the
    /// margin). The case comes out the same to the byte. At the end the prediction is held against it, as `hgm evaluate
    /// PREDICTION --against CASE` does
    #[arg(long, value_name = "PREDICTION")]
    prediction: Option<PathBuf>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = settings(&args.analysis, &args.pair.mesh, session)?;
    let (goal, place) = (args.analysis.goal(), session.place(&args.pair.output));
    let inputs = Inputs { prediction: args.prediction.clone(), ..args.pair.inputs() };
    let case = run_to(goal, &inputs, &place, &settings, &mut *session.listener())?;
    let seen = SeenAfterwards { case: Some(args.pair.output.clone()), ..SeenAfterwards::default() };
    let foretold = args.prediction.as_ref().map(|prediction| evaluate_prediction(prediction, &seen));
    let words = match (&args.prediction, &foretold) {
        (Some(prediction), Some(Ok(found))) => {
            let page = Case::open(prediction)?.page();
            format!("{}\n\n{}{}", in_words(&case)?, evaluation_table(found), page.display())
        }
        _ => in_words(&case)?,
    };
    session.emit(&case.outcome()?, &words)?;
    foretold.transpose()?;
    Ok(case.quality_gate()?)
}

/// The settings of a patient's whole job.
pub fn settings(analysis: &AnalysisOptions, mesh: &MeshOptions, session: &Session) -> Result<Settings, Failure> {
    let mut flags = Layer::default();
    analysis.over(&mut flags);
    if analysis.population.population.is_some() && !analysis.estimate {
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

//! `hgm run`: prep, sweep or estimate, report.

use super::flags::{AnalysisOptions, Flags, MeshOptions, PairOptions};
use super::{Failure, Session, estimate};
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::resection::improvement;
use crate::workflow::{Case, Goal, Settings, run_to};

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

/// Tetrahedra of an estimate's mesh: from 60,000 of `cgal` to this many the moduli of a synthetic patient moved by +14 and
/// -13 %, towards what another engine's mesh gave.
const ESTIMATE_CELLS: usize = 160_000;

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = settings(&args.analysis, &args.pair.mesh, session)?;
    let (goal, place) = (args.analysis.goal(), session.place(&args.pair.output));
    let case = run_to(goal, &args.pair.inputs(), &place, &settings, &mut session.listener())?;
    session.emit(&case.outcome()?, &in_words(&case, goal)?)?;
    Ok(case.quality_gate()?)
}

/// The settings of a patient's whole job: an estimate has a finer mesh unless another is asked for.
pub fn settings(analysis: &AnalysisOptions, mesh: &MeshOptions, session: &Session) -> Result<Settings, Failure> {
    let (mut own, mut flags) = (Flags::default(), Flags::default());
    if analysis.estimate {
        own.set("mesh.size.cells", Some(ESTIMATE_CELLS));
    }
    analysis.over(&mut flags);
    mesh.over(&mut flags);
    session.settings_over(&own.0, flags)
}

/// What a patient's job has found, for a terminal.
pub fn in_words(case: &Case, goal: Goal) -> Result<String, Failure> {
    let (outcome, page) = (case.outcome()?, case.page().display().to_string());
    if goal != Goal::Estimate {
        return Ok(summary(&outcome) + &page);
    }
    let facts = case.estimate()?;
    Ok(estimate::table(&facts) + &estimate::comparison(&outcome, &facts) + &page)
}

/// Best sample, errors and verdicts.
fn summary(outcome: &ExperimentOutcome) -> String {
    let mut text = format!("{}\n", outcome.verdict.sentence);
    let floor = outcome.noise_floor.unwrap_or_default();
    if let Some(best) = outcome.best().filter(|_| outcome.verdict.finding.has_stiffness()) {
        let moduli: Vec<String> = best.shear_modulus_pa.iter().map(|(t, m)| format!("{t} {m:.0} Pa")).collect();
        text += &format!("best sample {} ({})\n", best.id, moduli.join(", "));
    }
    if let Some(best) = outcome.best() {
        for (set, deformed) in &best.rmse_mm {
            let rest = outcome.rest_rmse_mm.get(set).copied().unwrap_or(f64::NAN);
            let verdict = improvement(rest, *deformed, &floor);
            text += &format!("RMSE at {set}: rest {rest:.3} mm, deformed {deformed:.3} mm: {verdict}\n");
        }
    }
    if let Some(floor_mm) = floor.combined_mm() {
        text += &format!("noise floor {floor_mm:.3} mm\n");
    }
    text
}

//! `hgm estimate`: the moduli that explain what was observed, with error bars.

use super::flags::Flags;
use super::run::in_words;
use super::{Failure, Session};
use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::resection::improvement;
use crate::workflow::{self, EstimateFacts, Goal, Subject};
use std::path::PathBuf;

/// Shear moduli by optimisation with solver sensitivities: most probable values, 95 % intervals, what limits them
///
/// Example: hgm estimate case --tissues 2
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run`, `hgm prep` or `hgm phantom`
    case: PathBuf,
    /// 1: the whole brain one material; 2: grey and white matter apart [default: as the case was made]
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Flags::default();
    for room in ["resection", "phantom"] {
        flags.set(&format!("{room}.tissues"), args.tissues);
    }
    let settings = session.settings_of(&args.case, flags)?;
    let case = workflow::estimate(&session.place(&args.case), &settings, &mut session.listener())?;
    let facts = case.estimate()?;
    if case.subject() != Some(Subject::Patient) {
        return session.emit(&facts.estimate, &(table(&facts) + &case.page().display().to_string()));
    }
    session.emit(&facts.estimate, &in_words(&case, Goal::Estimate)?)?;
    Ok(case.quality_gate()?)
}

/// The estimate for a terminal.
pub fn table(facts: &EstimateFacts) -> String {
    let EstimateOutcome { posterior, noise_mm, residual_rms_mm, taken_out_rms_mm, tangent_solves, limits, .. } =
        &facts.estimate;
    let verdict = &facts.estimate.verdict;
    let mut text = format!("{}\n", verdict.sentence);
    let shown = verdict.finding.has_stiffness();
    if shown {
        text += "parameter                            mode   95 % interval\n";
    }
    for (n, name) in posterior.names.iter().enumerate().filter(|_| shown) {
        let [low, high] = posterior.interval_95[n];
        text += &format!("{name:<32} {:>8.1}   {low:.1} to {high:.1}\n", posterior.mode[n]);
    }
    text += &format!(
        "residual {residual_rms_mm:.4} mm, noise {noise_mm:.3} mm, {tangent_solves} tangent solves, condition {:.1}\n",
        posterior.identifiability.condition
    );
    if let Some(taken_out) = taken_out_rms_mm {
        text += &format!("registration's own error, {taken_out:.3} mm, measured on the estimate and taken out\n");
    }
    for limit in limits {
        text += &format!("limit: {limit}\n");
    }
    text
}

/// Rest against the estimate's state at every set.
pub fn comparison(outcome: &ExperimentOutcome, facts: &EstimateFacts) -> String {
    let floor = outcome.noise_floor.unwrap_or_default();
    let mut text = String::new();
    for (set, deformed) in &facts.record.rmse_mm {
        let rest = outcome.rest_rmse_mm.get(set).copied().unwrap_or(f64::NAN);
        text += &format!(
            "RMSE at {set}: rest {rest:.3} mm, estimate {deformed:.3} mm: {}\n",
            improvement(rest, *deformed, &floor)
        );
    }
    text
}

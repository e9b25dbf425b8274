//! `hgm run`: prep, sweep, report.

use super::case::{Case, EstimateOptions, MeshOptions, Overrides, PriorOptions};
use super::patient::{Part, Patient};
use super::prep;
use super::{Failure, Session};
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::resection::{ResectionSettings, improvement};
use std::path::PathBuf;

/// T1 pair -> everything: prep, a sweep over the prior, per-node errors, report; resumable
///
/// Example: hgm run pre.nii.gz post.nii.gz -o case
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    prep: prep::Args,
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples)
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
    #[command(flatten)]
    prior: PriorOptions,
    /// Estimate the moduli with their intervals instead of trying the prior's samples
    #[arg(long)]
    estimate: bool,
}

impl Args {
    /// What the demo runs.
    pub fn demo(pre: PathBuf, post: PathBuf, output: PathBuf, mesh: MeshOptions) -> Self {
        Self {
            prep: prep::Args { pre, post, output, overrides: Overrides::default(), mesh },
            tissues: Some(1),
            prior: PriorOptions::default(),
            estimate: false,
        }
    }
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let case = Case::open(&args.prep.output, session);
    let prepared = prep::prepare(&case, &args.prep, session)?;
    let mut settings: ResectionSettings = session.settings("resection")?;
    if let Some(tissues) = args.tissues {
        settings.tissues = usize::from(tissues);
    }
    // The settings of an earlier run of this folder are not this run's.
    case.forget_settings();
    let patient = Patient::new(&case, prepared, settings)?;
    if args.estimate {
        let options: EstimateOptions = session.settings("estimate")?;
        let (outcome, facts, page) = patient.estimate(&options, None, session)?;
        let text = super::estimate::table(&facts) + &super::estimate::comparison(&outcome, &facts) + &page;
        session.emit(&outcome, &text)?;
    } else if let Some((outcome, page)) = patient.sweep(Part::All, &args.prior, session)? {
        session.emit(&outcome, &summary(&outcome, &page))?;
    }
    patient.quality_gate()
}

/// Best sample, errors and verdicts for a terminal.
pub fn summary(outcome: &ExperimentOutcome, page: &str) -> String {
    let mut text = String::new();
    let floor = outcome.noise_floor.unwrap_or_default();
    if let Some(best) = outcome.best() {
        let moduli: Vec<String> = best.shear_modulus_pa.iter().map(|(t, m)| format!("{t} {m:.0} Pa")).collect();
        text += &format!("best sample {} ({})\n", best.id, moduli.join(", "));
        for (set, deformed) in &best.rmse_mm {
            let rest = outcome.rest_rmse_mm.get(set).copied().unwrap_or(f64::NAN);
            let verdict = improvement(rest, *deformed, &floor);
            text += &format!("RMSE at {set}: rest {rest:.3} mm, deformed {deformed:.3} mm: {verdict}\n");
        }
    }
    if let Some(floor_mm) = floor.combined_mm() {
        text += &format!("noise floor {floor_mm:.3} mm\n");
    }
    text + page
}

//! `hgm run`: prep, sweep, report.

use super::case::{Case, EstimateOptions, MeshOptions, Overrides, PriorOptions, SampleMode};
use super::patient::Patient;
use super::prep;
use super::{Failure, Reject, Session};
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::prior::samples_of_prior;
use crate::experiment::resection::{ResectionSettings, improvement};
use std::path::PathBuf;

/// T1 pair -> everything: prep, a sweep over the prior, per-node errors, report; resumable
///
/// Example: hgm run pre.nii.gz post.nii.gz -o case
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub prep: prep::Args,
    #[command(flatten)]
    pub analysis: AnalysisOptions,
}

/// What is asked of a prepared patient.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct AnalysisOptions {
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples)
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    pub tissues: Option<u8>,
    #[command(flatten)]
    pub prior: PriorOptions,
    /// Estimate the moduli with their intervals instead of trying the prior's samples; on 160,000 tetrahedra unless
    /// --cells or --edge-mm says otherwise
    #[arg(long)]
    pub estimate: bool,
}

/// Tetrahedra of an estimate's mesh: from 60,000 of `cgal` to this many the moduli of a synthetic patient moved by +14 and
/// -13 %, towards what another engine's mesh gave.
const ESTIMATE_CELLS: usize = 160_000;

impl AnalysisOptions {
    /// The mesh as asked for, or fine enough for what is asked of it.
    pub fn mesh(&self, asked: &MeshOptions, session: &Session) -> MeshOptions {
        let mut mesh = asked.clone();
        if self.estimate && mesh.cells.is_none() && mesh.edge_mm.is_none() && !session.has_settings("mesh", "size") {
            mesh.cells = Some(ESTIMATE_CELLS);
        }
        mesh
    }
}

impl Args {
    /// What the demo runs.
    pub fn demo(pre: PathBuf, post: PathBuf, output: PathBuf, mesh: MeshOptions) -> Self {
        Self {
            prep: prep::Args { pre, post, output, overrides: Overrides::default(), mesh },
            analysis: AnalysisOptions { tissues: Some(1), ..AnalysisOptions::default() },
        }
    }
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let Analysed { outcome, text, patient } = analyse(args, session)?;
    session.emit(&outcome, &text)?;
    patient.quality_gate()
}

/// A patient's job, done.
pub struct Analysed {
    /// The numbers.
    pub outcome: ExperimentOutcome,
    /// The numbers that matter, for a terminal.
    pub text: String,
    /// The patient.
    pub patient: Patient,
}

/// Runs (or skips) every stage from the scans to the page.
///
/// # Errors
/// The first stage that is rejected or fails.
pub fn analyse(args: &Args, session: &Session) -> Result<Analysed, Failure> {
    let case = Case::open(&args.prep.output, session);
    let mesh = args.analysis.mesh(&args.prep.mesh, session);
    let mut settings: ResectionSettings = session.settings("resection")?;
    if let Some(tissues) = args.analysis.tissues {
        settings.tissues = usize::from(tissues);
    }
    // What would be refused after minutes is refused now.
    let prior = args.analysis.prior.over(&session.settings("prior")?);
    samples_of_prior(&settings.tissue_list(), &settings.sd_levels, settings.poisson_ratio, &prior).reject()?;
    let prepared = prep::prepare(&case, &prep::Args { mesh, ..args.prep.clone() }, session)?;
    // The settings of an earlier run of this folder are not this run's.
    case.forget_settings();
    let patient = Patient::new(&case, prepared, settings)?;
    let (outcome, text) = if args.analysis.estimate {
        let options: EstimateOptions = session.settings("estimate")?;
        let (outcome, facts, page) = patient.estimate(&options, None, session)?;
        let text = super::estimate::table(&facts) + &super::estimate::comparison(&outcome, &facts) + &page;
        (outcome, text)
    } else {
        let (outcome, page) = patient.sweep(SampleMode::Run, &args.analysis.prior, session)?;
        let text = summary(&outcome, &page);
        (outcome, text)
    };
    Ok(Analysed { outcome, text, patient })
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

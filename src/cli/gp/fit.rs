//! `hgm gp fit`: hyperparameters of greatest likelihood.

use super::options::{ModelOption, StudyOptions, only_with};
use crate::cli::{Failure, Session, session::warn};
use crate::material::generative::GenerativeModel;
use crate::workflow::{Layer, fit_gp, fit_study_level, results_in_words};
use serde_json::json;
use std::path::PathBuf;

/// Fit the hyperparameters to the literature, and to studies of your own
///
/// Writes hyperparameters.toml, which `hgm gp sample` and `hgm gp show` read. With `--model study-level`: study-level.toml, the
/// spreads between and within publications with their 90 % intervals, and the moduli of a person nobody has measured.
///
/// Example: hgm gp fit --studies my-studies.csv -o my-gp
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    generative: ModelOption,
    #[command(flatten)]
    studies: StudyOptions,
    /// Rank of the coregionalisation of the twelve tasks [default: 1]
    #[arg(long, value_name = "N")]
    rank: Option<usize>,
    /// Seeded starts of the search [default: 6]
    #[arg(long, value_name = "N")]
    starts: Option<usize>,
    /// Where to write
    #[arg(short, long, value_name = "DIR", default_value = "gp")]
    output: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    if args.generative.model == GenerativeModel::StudyLevel {
        return study_level(args, session);
    }
    let mut flags = Layer::default();
    flags.set("gp.rank", args.rank);
    flags.set("gp.starts", args.starts);
    let settings = session.settings(flags)?.gp;
    let studies = args.studies.read()?;
    let made = fit_gp(&studies, &settings, &args.output, session.options.force)?;
    warn(&made.warnings());
    let (facts, file) = (made.facts, made.files[0].display().to_string());
    let text = results_in_words::fitted_process(&facts, settings.rank) + &file;
    session.emit(&json!({ "hyperparameters": file, "settings": made.settings, "fit": facts }), &text)
}

fn study_level(args: &Args, session: &Session) -> Result<(), Failure> {
    only_with(args.rank.is_some(), "--rank", "published")?;
    only_with(args.starts.is_some(), "--starts", "published")?;
    let place = (args.output.as_path(), session.options.force);
    let mut made = fit_study_level(&args.studies.read()?, session.options.seed.unwrap_or(0), place)?;
    let text = made.take_text();
    warn(&made.warnings());
    let (facts, file) = (made.facts, made.files[0].display().to_string());
    let text = format!("{} points of {} publications\n{text}\n{file}", facts["points"], facts["publications"]);
    session.emit(&json!({ "study_level": file, "settings": made.settings, "fit": facts }), &text)
}

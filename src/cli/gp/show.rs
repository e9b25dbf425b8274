//! `hgm gp show`: the paper's figures, table and tests.

use super::options::{HyperparameterOptions, StudyOptions};
use crate::cli::{Failure, Session};
use crate::material::generative::SampleSettings;
use crate::workflow::show_gp;
use serde_json::json;
use std::path::PathBuf;

/// Figures of the posterior and of the meta-models, shear moduli per task, tests between the laws
///
/// Writes fig-2-posterior.svg (twelve panels: studies, mean, 2 standard deviations), fig-3-meta-models.svg (four
/// literature models with four fitted laws) and shear-moduli.csv.
///
/// Example: hgm gp show --published -o paper
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Literature models of the second figure, by id
    #[arg(long, value_delimiter = ',', default_value = "44,52,60,62", value_name = "ID,ID,...")]
    models: Vec<u32>,
    #[command(flatten)]
    studies: StudyOptions,
    #[command(flatten)]
    hyperparameters: HyperparameterOptions,
    /// Where to write
    #[arg(short, long, value_name = "DIR", default_value = "gp")]
    output: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let studies = args.studies.read()?;
    let base = if args.studies.published { SampleSettings::published() } else { SampleSettings::default() };
    let settings = SampleSettings { hyperparameters: args.hyperparameters.read()?, ..base };
    let mut made = show_gp(&studies, &args.models, &settings, (&args.output, session.options.force))?;
    let text = made.facts.as_object_mut().and_then(|facts| facts.remove("text"));
    let files: Vec<String> = made.files.iter().map(|file| file.display().to_string()).collect();
    let shown = format!("{}\n{}", text.as_ref().and_then(|text| text.as_str()).unwrap_or_default(), files.join("\n"));
    session.emit(&json!({ "files": files, "settings": made.settings, "result": made.facts }), &shown)
}

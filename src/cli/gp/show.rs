//! `hgm gp show`: the paper's figures, table and tests.

use super::options::{HyperparameterOptions, ModelOption, StudyOptions, emit, only_with};
use crate::cli::{Failure, Session};
use crate::material::generative::{GenerativeModel, SampleSettings};
use crate::workflow::{show_gp, show_study_level};
use std::path::PathBuf;

/// Figures of the posterior and of the meta-models, shear moduli per task, tests between the laws
///
/// Writes fig-2-posterior.svg (twelve panels: studies, mean, 2 standard deviations), fig-3-meta-models.svg (four
/// literature models with four fitted laws) and shear-moduli.csv. With `--model study-level`: study-level-bands.svg (95 % of the
/// mean, of a laboratory's average, of a new study), study-level-left-out.svg (each publication against what all others say
/// of it), study-level-moduli.csv, study-level-person.csv and study-level-left-out.csv.
///
/// Example: hgm gp show --published -o paper
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Literature models of the second figure, by id [default: 44,52,60,62]
    #[arg(long, value_delimiter = ',', value_name = "ID,ID,...")]
    models: Vec<u32>,
    #[command(flatten)]
    generative: ModelOption,
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
    if args.generative.model == GenerativeModel::StudyLevel {
        only_with(!args.models.is_empty(), "--models", "published")?;
        let own = args.hyperparameters.study_level()?.map(|file| file.spreads);
        let (seed, place) = (session.options.seed.unwrap_or(0), (args.output.as_path(), session.options.force));
        return emit(show_study_level(&studies, own.as_ref(), seed, place)?, session);
    }
    let base = if args.studies.published { SampleSettings::published() } else { SampleSettings::default() };
    let settings = SampleSettings { hyperparameters: args.hyperparameters.read()?, ..base };
    emit(show_gp(&studies, &args.models, &settings, (&args.output, session.options.force))?, session)
}

//! `hgm gp sample`: materials from the generative model.

use super::options::{HyperparameterOptions, ModelOption, StudyOptions, only_with};
use crate::cli::{Failure, Session};
use crate::manual::help::laws;
use crate::material::Task;
use crate::material::generative::{GenerativeModel, SampleSettings};
use crate::material::gp::Spread;
use crate::material::meta_model::MetaModel;
use crate::material::study_level::Of;
use crate::workflow::{Expected, GenerativeFiles, Wanted, results_in_words, sample_gp, sample_study_level};
use serde_json::json;
use std::path::PathBuf;

/// Materials of one tissue: at standard deviations from the mean, or fitted to random curves
///
/// Writes the materials and the posterior over the stretch as CSV. Levels are the paper's quantile envelopes (mean
/// and k standard deviations of a new observation); draws are whole random curves. With `--model study-level` both are of
/// `--of`: the tissue of a new person, what another laboratory publishes or finds on average, or the task's mean.
///
/// Example: hgm gp sample --task hyperelastic-white --draws 1000 --law ogden
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Kind of study and region, as hyperelastic-grey, mre-white, linear-healthy
    #[arg(long, default_value = "hyperelastic-healthy")]
    task: Task,
    /// Standard deviations from the mean [default: -2 to 2 in halves]
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_name = "K,K,...")]
    levels: Vec<f64>,
    /// Random curves instead of levels
    #[arg(long, value_name = "N", conflicts_with = "levels")]
    draws: Option<u64>,
    /// What a draw is of: the tissue's own curve, or what one more study would report of it [default: tissue]
    #[arg(long, requires = "draws", conflicts_with = "levels", value_name = "tissue|study")]
    spread: Option<Spread>,
    #[command(flatten)]
    generative: ModelOption,
    /// What materials of the study-level model are of [default: person]
    #[arg(long, value_name = "mean|laboratory|person|study")]
    of: Option<Of>,
    /// Also write the drawn curves, one column a draw
    #[arg(long, requires = "draws", conflicts_with = "levels")]
    curves: bool,
    #[arg(long, default_value = "neo-hookean", help = laws("Law fitted to each: {}"))]
    law: MetaModel,
    /// Points over the task's window
    #[arg(long, default_value_t = 501, value_name = "N", value_parser = clap::value_parser!(u16).range(5..=5001))]
    stretches: u16,
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
    let settings = SampleSettings { model: args.law, stretches: usize::from(args.stretches), ..base };
    let (seed, place) = (session.options.seed.unwrap_or(0), (args.output.as_path(), session.options.force));
    if args.generative.model == GenerativeModel::StudyLevel {
        only_with(args.spread.is_some(), "--spread", "published")?;
        let own = args.hyperparameters.study_level()?;
        let wanted = match args.draws {
            None => Expected::Levels(args.levels.clone()),
            Some(count) => Expected::Draws { count, curves: args.curves },
        };
        let what = (args.task, args.of.unwrap_or_default());
        let how = (&settings, own.as_ref().map(|file| &file.spreads));
        return emit(sample_study_level(&studies, what, &wanted, how, seed, place)?, seed, session);
    }
    only_with(args.of.is_some(), "--of", "study-level")?;
    let settings = SampleSettings { hyperparameters: args.hyperparameters.read()?, ..settings };
    let wanted = match args.draws {
        None => Wanted::Levels(args.levels.clone()),
        Some(count) => Wanted::Draws { count, spread: args.spread.unwrap_or_default(), curves: args.curves },
    };
    emit(sample_gp(&studies, args.task, &wanted, &settings, seed, place)?, seed, session)
}

fn emit(made: GenerativeFiles, seed: u64, session: &Session) -> Result<(), Failure> {
    let (file, facts) = (made.files[0].display().to_string(), made.facts);
    let text = results_in_words::materials(&facts, &made.settings) + &file;
    session.emit(&json!({ "file": file, "settings": made.settings, "seed": seed, "result": facts }), &text)
}

//! `hgm gp fit`: hyperparameters of greatest likelihood.

use super::options::{StudyOptions, VERSION, facts};
use crate::artefact::{Produced, Stage};
use crate::cli::flags::Flags;
use crate::cli::{Failure, Session};
use crate::material::gp::{Hyperparameters, fit_hyperparameters, negative_log_likelihood};
use crate::material::training::TrainingData;
use serde_json::json;
use std::path::PathBuf;

/// Fit the hyperparameters to the literature, and to studies of your own
///
/// Writes hyperparameters.toml, which `hgm gp sample` and `hgm gp show` read.
///
/// Example: hgm gp fit --studies my-studies.csv -o my-gp
#[derive(Debug, clap::Args)]
pub struct Args {
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
    let mut flags = Flags::default();
    flags.set("gp.rank", args.rank);
    flags.set("gp.starts", args.starts);
    let mut settings = session.settings(flags)?.gp;
    settings.finalists = settings.finalists.min(settings.starts.max(1));
    let studies = args.studies.read()?;
    let stage = Stage::new("gp-fit", VERSION, &args.output, &(&settings, studies.curves)).seed(settings.seed);
    let outcome = studies.input(stage).run(session.options.force, || {
        let data = TrainingData::from_literature(&studies.models, studies.curves);
        let fit = fit_hyperparameters(&data, &settings)?;
        let facts = json!({
            "negative_log_likelihood": fit.negative_log_likelihood,
            "negative_log_likelihood_of_published_hyperparameters":
                negative_log_likelihood(&Hyperparameters::published(), &data),
            "gradient_norm": fit.gradient_norm,
            "lengthscale": fit.hyperparameters.lengthscale,
            "studies": studies.models.len(),
            "observations": data.observations(),
            "unique_inputs": data.inputs().len(),
            "starts": fit.starts,
        });
        let files = vec![("hyperparameters.toml".to_owned(), fit.hyperparameters.to_toml().into_bytes())];
        Ok::<_, crate::material::gp::FitRefusal>(Produced { files, facts, ..Produced::default() })
    });
    let facts = facts(outcome)?;
    let file = args.output.join("hyperparameters.toml").display().to_string();
    let figure = |name: &str| facts[name].as_f64().unwrap_or(f64::NAN);
    let text = format!(
        "{} observations of {} studies, rank {}\n\
         negative log marginal likelihood {:.6} (at the published hyperparameters {:.6})\n\
         lengthscale {:.6}\n{file}",
        facts["observations"],
        facts["studies"],
        settings.rank,
        figure("negative_log_likelihood"),
        figure("negative_log_likelihood_of_published_hyperparameters"),
        figure("lengthscale"),
    );
    session.emit(&json!({ "hyperparameters": file, "settings": settings, "fit": facts }), &text)
}

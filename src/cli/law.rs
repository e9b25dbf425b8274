//! `hgm law fit`: simple stable laws for a laboratory's test or a literature model.

use super::gp::StudyOptions;
use super::{Failure, Session};
use crate::manual::help::laws;
use crate::material::meta_model::{MetaModel, Search};
use crate::workflow::{LawTest, Layer, fit_laws, results_in_words};
use clap::Subcommand;
use serde_json::json;
use std::path::PathBuf;

/// Fit constitutive laws to your own tests and to the literature
///
/// Example: hgm law fit rheometry.csv --law ogden
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Fit(FitArgs),
}

/// Fit a law to a uniaxial test (CSV) or to a literature model
///
/// The CSV's header names quantity and unit: `stretch,nominal stress (kPa)`, `stretch,true stress (Pa)`,
/// `strain (%),stress (kPa)` or `stretch,energy (Pa)`; other columns are left alone. Stresses are fitted as stresses,
/// energies as ln W.
///
/// Example: hgm law fit rheometry.csv --law ogden,mooney-rivlin
#[derive(Debug, clap::Args)]
struct FitArgs {
    /// The test
    #[arg(required_unless_present = "literature", conflicts_with_all = ["literature", "studies"], value_name = "CSV")]
    test: Option<PathBuf>,
    /// A literature model by id instead
    #[arg(long, value_name = "ID")]
    literature: Option<u32>,
    #[arg(long, value_delimiter = ',', value_name = "NAME", help = laws("Laws, with commas between: {} [default: all]"))]
    law: Vec<MetaModel>,
    /// Poisson's ratio of the material tables in the result
    #[arg(long, default_value_t = 0.45, value_name = "NU")]
    poisson_ratio: f64,
    #[command(flatten)]
    studies: StudyOptions,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let Command::Fit(args) = &args.command;
    let mut settings = session.settings(Layer::default())?.law;
    if args.studies.published {
        settings.search = Search::Published;
    }
    let test = match &args.test {
        Some(file) => LawTest::measured(file)?,
        None => LawTest::literature(args.literature.unwrap_or_default(), &args.studies.read()?)?,
    };
    let fits = fit_laws(&test, &args.law, args.poisson_ratio, &settings)?;
    let points = test.points.stretches.len();
    session.emit(
        &json!({ "source": test.name, "settings": settings, "points": points, "fits": fits }),
        &results_in_words::fitted(&test, &fits),
    )
}

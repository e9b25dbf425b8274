//! `hgm law fit`: simple stable laws for a laboratory's test or a literature model.

use super::flags::{Flags, laws};
use super::gp::StudyOptions;
use super::{Failure, Reject, Session};
use crate::material::law::Material;
use crate::material::literature::citation;
use crate::material::meta_model::{Fit, MetaModel, Search};
use crate::material::rheometry::{Measured, Rheometry, fit_rheometry, read_rheometry};
use crate::report::in_words::fit_in_words;
use crate::workflow::read_input;
use anyhow::{Context, anyhow};
use clap::Subcommand;
use serde::Serialize;
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
    #[arg(required_unless_present = "literature", conflicts_with = "literature", value_name = "CSV")]
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

/// One fitted law.
#[derive(Serialize)]
struct Fitted {
    fit: Fit,
    parameter_names: &'static [&'static str],
    parameter_sd: Vec<f64>,
    stable_everywhere: bool,
    /// A `[materials.NAME]` table of a scenario.
    material: Material,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let Command::Fit(args) = &args.command;
    let mut settings = session.settings(Flags::default())?.law;
    if args.studies.published {
        settings.search = Search::Published;
    }
    if !(0.0..0.5).contains(&args.poisson_ratio) {
        let nu = args.poisson_ratio;
        return Err(Failure::Rejected(anyhow!("--poisson-ratio is {nu}: it must be at least 0 and below 0.5")));
    }
    let (name, test) = points(args)?;
    let laws = if args.law.is_empty() { MetaModel::all().collect() } else { args.law.clone() };
    let mut fitted = Vec::new();
    for law in laws {
        let fit = fit_rheometry(law, &test, &settings).with_context(|| name.clone()).reject()?;
        let parameter_sd = (0..fit.parameters.len()).map(|i| fit.covariance[i][i].sqrt()).collect();
        let material = fit.material(args.poisson_ratio);
        let (parameter_names, stable_everywhere) = (law.parameter_names(), fit.stability.everywhere());
        fitted.push(Fitted { fit, parameter_names, parameter_sd, stable_everywhere, material });
    }
    let measured = match test.measured {
        Measured::NominalStress => "nominal stress",
        Measured::Energy => "strain energy density",
    };
    let mut text = format!("{name}: {} points of {measured}\n", test.stretches.len());
    for one in &fitted {
        text += &fit_in_words(&one.fit, one.parameter_names, &one.parameter_sd);
    }
    session
        .emit(&json!({ "source": name, "settings": settings, "points": test.stretches.len(), "fits": fitted }), &text)
}

fn points(args: &FitArgs) -> Result<(String, Rheometry), Failure> {
    if let Some(path) = &args.test {
        let name = path.display().to_string();
        let test = read_rheometry(&read_input(path)?).with_context(|| name.clone()).reject()?;
        return Ok((name, test));
    }
    let id = args.literature.unwrap_or_default();
    let studies = args.studies.read()?;
    let model = studies.model(id)?;
    let curve = model.curve(studies.curves);
    let values_pa = curve.energies_pa.iter().map(|w| w.max(0.0)).collect();
    let words = [model.study.clone(), citation(model)].into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>();
    let name = format!("literature model {id} {}", words.join(", "));
    Ok((name, Rheometry { measured: Measured::Energy, stretches: curve.stretches, values_pa }))
}

//! `hgm gp show`: the paper's figures, table and tests.

use super::options::{HyperparameterOptions, Studies, StudyOptions, VERSION, facts};
use crate::artefact::{Produced, Stage};
use crate::cli::{Failure, Session};
use crate::material::Task;
use crate::material::generative::{SampleSettings, nine_levels, sample_prior};
use crate::material::gp::posterior;
use crate::material::literature::LiteratureModel;
use crate::material::meta_model::{FitError, MetaModel, fit};
use crate::material::statistics::{CostDigits, compare};
use crate::material::task::stretches;
use crate::material::training::TrainingData;
use crate::report::material_figure::{FittedCurve, meta_model_figure, posterior_figure};
use crate::report::material_tables::{TaskModuli, moduli_csv, moduli_text};
use anyhow::anyhow;
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

/// Points over a window: the published table's and, for the tests between laws, the published tests'.
const TABLE_STRETCHES: usize = 501;
const TEST_STRETCHES: usize = 101;

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let studies = args.studies.read()?;
    let hyperparameters = args.hyperparameters.read()?;
    let base = if args.studies.published { SampleSettings::published() } else { SampleSettings::default() };
    let settings = SampleSettings { hyperparameters, stretches: TABLE_STRETCHES, ..base };
    let chosen = chosen(&args.models, &studies)?;
    let used = json!({
        "models": args.models, "curves": studies.curves, "search": settings.meta_model,
        "hyperparameters": settings.hyperparameters.to_toml(),
    });
    let stage = Stage::new("gp-show", VERSION, &args.output, &used);
    let outcome = studies.input(stage).run(session.options.force, || {
        let data = TrainingData::from_literature(&studies.models, studies.curves);
        let prior = |task: Task, points: usize| {
            let [low, high] = task.stretch_window();
            posterior(&settings.hyperparameters, &data, task, &stretches(low, high, points))
        };
        let mut rows = Vec::new();
        let mut panels = Vec::new();
        for task in Task::all() {
            let prior = prior(task, TABLE_STRETCHES);
            let moduli = sample_prior(&prior, &nine_levels(), &settings)?;
            let shear_modulus_pa = moduli.iter().map(|m| m.shear_modulus_pa).collect();
            rows.push(TaskModuli { task: task.to_string(), shear_modulus_pa });
            let own = studies.models.iter().filter(|model| model.task == task);
            panels.push((prior, own.map(|model| model.curve(studies.curves)).collect()));
        }
        let digits = if args.studies.published { CostDigits::Two } else { CostDigits::All };
        let mut tests = Vec::new();
        for task in [Task::HYPERELASTIC_GREY, Task::HYPERELASTIC_WHITE, Task::HYPERELASTIC_HEALTHY] {
            tests.push((task.to_string(), compare(&prior(task, TEST_STRETCHES), &settings.meta_model, digits)?));
        }
        let fitted = chosen.iter().map(|model| fitted(model, &studies, &settings)).collect::<Result<Vec<_>, _>>()?;
        let files = vec![
            ("fig-2-posterior.svg".to_owned(), posterior_figure(&panels).into_bytes()),
            ("fig-3-meta-models.svg".to_owned(), meta_model_figure(&fitted).into_bytes()),
            ("shear-moduli.csv".to_owned(), moduli_csv(&rows).into_bytes()),
        ];
        let facts =
            json!({ "sd_levels": nine_levels(), "moduli": rows, "tests": tests, "text": moduli_text(&rows, &tests) });
        Ok::<_, FitError>(Produced { files, facts, ..Produced::default() })
    });
    let mut facts = facts(outcome)?;
    let text = facts["text"].take().as_str().unwrap_or_default().to_owned();
    if let Some(facts) = facts.as_object_mut() {
        facts.remove("text");
    }
    let names = ["fig-2-posterior.svg", "fig-3-meta-models.svg", "shear-moduli.csv"];
    let files: Vec<String> = names.iter().map(|name| args.output.join(name).display().to_string()).collect();
    let shown = format!("{text}\n{}", files.join("\n"));
    session.emit(&json!({ "files": files, "settings": used, "result": facts }), &shown)
}

fn chosen(ids: &[u32], studies: &Studies) -> Result<Vec<LiteratureModel>, Failure> {
    let find = |id: &u32| {
        studies.models.iter().find(|model| model.id == *id).cloned().ok_or_else(|| {
            let last = studies.models.iter().map(|model| model.id).max().unwrap_or(0);
            Failure::Rejected(anyhow!(
                "--models: there is no literature model {id}; ids go from 0 to {last}; `hgm gp studies` lists them"
            ))
        })
    };
    ids.iter().map(find).collect()
}

fn fitted(model: &LiteratureModel, studies: &Studies, settings: &SampleSettings) -> Result<FittedCurve, FitError> {
    let curve = model.curve(studies.curves);
    let offset = settings.meta_model.log_offset_pa;
    let targets: Vec<f64> = curve.energies_pa.iter().map(|w| (w.max(0.0) + offset).ln()).collect();
    let fits = MetaModel::PAPER.map(|law| fit(law, &curve.stretches, &targets, &settings.meta_model));
    let fits = fits.into_iter().collect::<Result<_, _>>()?;
    Ok(FittedCurve { name: format!("{}: {} ({})", model.id, model.study, model.citation), curve, fits })
}

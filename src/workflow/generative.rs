//! The generative model of brain tissue, from a table of studies to files: fitted, sampled, shown.

use super::error::{AskedError, WorkflowError};
use super::user_file::{read_input, read_text};
use crate::artefact::{Produced, Stage, StageError, StageOutcome};
use crate::material::Task;
use crate::material::generative::{SampleSettings, draw_materials, joint_tissue_prior, nine_levels, sample_prior};
use crate::material::gp::{
    FitRefusal, FitSettings, Hyperparameters, Spread, fit_hyperparameters, negative_log_likelihood, posterior,
};
use crate::material::literature::{Curves, LiteratureModel, merge, read_studies, table};
use crate::material::meta_model::{FitError, MetaModel, fit};
use crate::material::statistics::{CostDigits, compare};
use crate::material::task::stretches;
use crate::material::training::TrainingData;
use crate::report::material_figure::{FittedCurve, meta_model_figure, posterior_figure};
use crate::report::material_tables::{
    Sampled, TaskModuli, curves_csv, materials_csv, moduli_csv, moduli_text, posterior_csv, quantiles,
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Raised when this code changes its files.
const VERSION: u32 = 2;
/// Points over a window: the published table's and, for the tests between laws, the published tests'.
const TABLE_STRETCHES: usize = 501;
/// Literature models of the paper's Fig. 3.
pub(super) const FIGURE_3: [u32; 4] = [44, 52, 60, 62];
/// Beyond these standard deviations an envelope is no material that anybody has.
const LEVELS: [f64; 2] = [-6.0, 6.0];
/// Random materials in one file.
const MOST_DRAWS: u64 = 1_000_000;
const TEST_STRETCHES: usize = 101;

/// Studies and the bytes they came from.
#[derive(Clone, Debug)]
pub struct Studies {
    /// One model for each study and tissue.
    pub models: Vec<LiteratureModel>,
    /// The published program's curves, or those of the studies it mis-coded put right.
    pub curves: Curves,
    bytes: Option<Vec<u8>>,
}

impl Studies {
    /// The embedded table, with the rows of a user's own table (CSV) in place of those of their id, or after them.
    ///
    /// # Errors
    /// A file that cannot be read or is no table of studies.
    pub fn read(own: Option<&Path>, curves: Curves) -> Result<Self, WorkflowError> {
        let Some(path) = own else { return Ok(Self { models: table(), curves, bytes: None }) };
        let bytes = read_input(path)?;
        let file = path.display().to_string();
        let own = read_studies(&bytes).map_err(|source| WorkflowError::Studies { file, source })?;
        Ok(Self { models: merge(table(), own), curves, bytes: Some(bytes) })
    }

    /// A study by its id.
    ///
    /// # Errors
    /// An id that the table does not hold.
    pub fn model(&self, id: u32) -> Result<&LiteratureModel, WorkflowError> {
        let last = self.models.iter().map(|model| model.id).max().unwrap_or(0);
        self.models.iter().find(|model| model.id == id).ok_or(WorkflowError::NoSuchModel { id, last })
    }

    /// The stage with the user's table among its inputs.
    pub(super) fn input(&self, stage: Stage) -> Stage {
        match &self.bytes {
            Some(bytes) => stage.input("studies", bytes),
            None => stage,
        }
    }
}

/// A user's hyperparameters (TOML), else the published ones.
///
/// # Errors
/// A file that cannot be read or does not hold them.
pub fn hyperparameters(own: Option<&Path>) -> Result<Hyperparameters, WorkflowError> {
    let Some(path) = own else { return Ok(Hyperparameters::published()) };
    let file = path.display().to_string();
    Hyperparameters::from_toml(&read_text(path)?).map_err(|source| WorkflowError::Hyperparameters { file, source })
}

/// What a command on the generative model has left.
#[derive(Clone, Debug)]
pub struct GenerativeFiles {
    /// The files, the most important first.
    pub files: Vec<PathBuf>,
    /// What it was made with.
    pub settings: Value,
    /// What was found.
    pub facts: Value,
}

impl GenerativeFiles {
    /// The facts' `text`, the table for a terminal, which is no fact of its own.
    pub fn take_text(&mut self) -> String {
        let text = self.facts.as_object_mut().and_then(|facts| facts.remove("text"));
        text.as_ref().and_then(Value::as_str).unwrap_or_default().to_owned()
    }

    /// What the facts warn of.
    pub fn warnings(&self) -> Vec<String> {
        let warnings = self.facts["warnings"].as_array().map_or(&[][..], Vec::as_slice);
        warnings.iter().filter_map(Value::as_str).map(str::to_owned).collect()
    }

    /// The files' names.
    pub fn names(&self) -> Vec<String> {
        self.files.iter().map(|file| file.display().to_string()).collect()
    }
}

/// Hyperparameters of greatest likelihood, into `hyperparameters.toml` of `folder`.
///
/// # Errors
/// A table that holds too little; the disk's.
pub fn fit_gp(
    studies: &Studies,
    settings: &FitSettings,
    folder: &Path,
    force: bool,
) -> Result<GenerativeFiles, WorkflowError> {
    // Of fewer starts than finalists, all are searched to the end.
    let settings = &FitSettings { finalists: settings.finalists.min(settings.starts.max(1)), ..*settings };
    let stage = Stage::new("gp-fit", VERSION, folder, &(settings, studies.curves)).seed(settings.seed);
    let outcome = studies.input(stage).run(force, || {
        let data = TrainingData::from_literature(&studies.models, studies.curves);
        let fit = fit_hyperparameters(&data, settings)?;
        let published = negative_log_likelihood(&Hyperparameters::published(), &data);
        let warnings: Vec<String> = fit.warnings(settings, &data, published).iter().map(ToString::to_string).collect();
        let facts = json!({
            "negative_log_likelihood": fit.negative_log_likelihood,
            "negative_log_likelihood_of_published_hyperparameters": published,
            "gradient_norm": fit.gradient_norm,
            "lengthscale": fit.hyperparameters.lengthscale,
            "studies": studies.models.len(),
            "observations": data.observations(),
            "unique_inputs": data.inputs().len(),
            "starts": fit.starts,
            "warnings": warnings,
        });
        let files = vec![("hyperparameters.toml".to_owned(), fit.hyperparameters.to_toml().into_bytes())];
        Ok::<_, FitRefusal>(Produced { files, warnings, facts })
    });
    let files = vec![folder.join("hyperparameters.toml")];
    Ok(GenerativeFiles { files, settings: json!(settings), facts: facts(outcome)? })
}

/// Which materials of a task are asked for.
#[derive(Clone, Debug)]
pub enum Wanted {
    /// At standard deviations from the mean; at the paper's nine where none is named.
    Levels(Vec<f64>),
    /// Fitted to random curves.
    Draws {
        /// How many.
        count: u64,
        /// Of the tissue's own curve, or of what one more study would report.
        spread: Spread,
        /// Whether the curves are written too.
        curves: bool,
    },
}

/// The levels that are named, or the paper's nine.
pub(super) fn levels_asked(named: &[f64]) -> Result<Vec<f64>, AskedError> {
    let [low, high] = LEVELS;
    match named.iter().find(|level| !(low..=high).contains(*level)) {
        Some(&level) => Err(AskedError::Level { level, low, high }),
        None if named.is_empty() => Ok(nine_levels().to_vec()),
        None => Ok(named.to_vec()),
    }
}

/// Refuses a number of random materials that no file is made of.
pub(super) fn check_draws(count: u64) -> Result<(), AskedError> {
    if (1..=MOST_DRAWS).contains(&count) { Ok(()) } else { Err(AskedError::Draws { count, most: MOST_DRAWS }) }
}

/// Materials of one task and the posterior over the stretch, as CSV into `folder`. `seed` is that of the draws.
///
/// # Errors
/// A level or a number of draws out of range, a law that cannot be fitted; the disk's.
pub fn sample_gp(
    studies: &Studies,
    task: Task,
    wanted: &Wanted,
    settings: &SampleSettings,
    seed: u64,
    (folder, force): (&Path, bool),
) -> Result<GenerativeFiles, WorkflowError> {
    let (how, levels, draws, spread, curves) = match wanted {
        Wanted::Levels(named) => ("samples", levels_asked(named)?, None, Spread::Tissue, false),
        Wanted::Draws { count, spread, curves } => ("draws", vec![], Some(*count), *spread, *curves),
    };
    draws.map_or(Ok(()), check_draws)?;
    let used = json!({
        "task": task.to_string(), "law": settings.model, "search": settings.meta_model, "curves": studies.curves,
        "stretches": settings.stretches, "levels": levels, "draws": draws, "spread": spread, "write_curves": curves,
        "hyperparameters": settings.hyperparameters.to_toml(),
    });
    let name = format!("{how}-{task}");
    let stage = Stage::new(&format!("gp-{name}"), VERSION, folder, &used).seed(seed);
    let outcome = studies.input(stage).run(force, || {
        let joint = joint_tissue_prior(task, &studies.models, settings);
        let sampled: Vec<Sampled> = match wanted {
            Wanted::Levels(_) => sample_prior(&joint.prior, &levels, settings)?
                .into_iter()
                .map(|m| Sampled { sd_level: Some(m.sd_level), draw: None, fit: m.fit })
                .collect(),
            Wanted::Draws { count, spread, .. } => draw_materials(&joint, *count, seed, *spread, settings)?
                .into_iter()
                .map(|m| Sampled { sd_level: None, draw: Some(m.draw), fit: m.fit })
                .collect(),
        };
        let mut files = vec![
            (format!("{name}.csv"), materials_csv(&sampled, settings.model).into_bytes()),
            (format!("posterior-{task}.csv"), posterior_csv(&joint).into_bytes()),
        ];
        if let Some(draws) = draws.filter(|_| curves) {
            files.push((format!("curves-{task}.csv"), curves_csv(&joint, draws, seed, spread).into_bytes()));
        }
        // All materials, or the first twenty of a long list: the rest is in the file.
        let first: Vec<&Sampled> = sampled.iter().take(20).collect();
        let facts = json!({ "shear_modulus_pa": quantiles(&sampled), "materials": first });
        Ok::<_, FitError>(Produced { files, facts, ..Produced::default() })
    });
    let files = vec![folder.join(format!("{name}.csv"))];
    Ok(GenerativeFiles { files, settings: used, facts: facts(outcome)? })
}

/// The paper's figures, table and tests between the laws, into `folder`; `models` are those of the second figure, the paper's
/// four where none is named. The facts' `text` is the table for a terminal.
///
/// # Errors
/// A model that the studies do not hold, a law that cannot be fitted; the disk's.
pub fn show_gp(
    studies: &Studies,
    models: &[u32],
    settings: &SampleSettings,
    (folder, force): (&Path, bool),
) -> Result<GenerativeFiles, WorkflowError> {
    let settings = SampleSettings { stretches: TABLE_STRETCHES, ..settings.clone() };
    let models = if models.is_empty() { &FIGURE_3 } else { models };
    let chosen = models.iter().map(|id| studies.model(*id)).collect::<Result<Vec<_>, _>>()?;
    let used = json!({
        "models": models, "curves": studies.curves, "search": settings.meta_model,
        "hyperparameters": settings.hyperparameters.to_toml(),
    });
    let stage = Stage::new("gp-show", VERSION, folder, &used);
    let names = ["fig-2-posterior.svg", "fig-3-meta-models.svg", "shear-moduli.csv"];
    let outcome = studies.input(stage).run(force, || {
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
        let published = matches!(studies.curves, Curves::Published);
        let digits = if published { CostDigits::Two } else { CostDigits::All };
        let mut tests = Vec::new();
        for task in [Task::HYPERELASTIC_GREY, Task::HYPERELASTIC_WHITE, Task::HYPERELASTIC_HEALTHY] {
            tests.push((task.to_string(), compare(&prior(task, TEST_STRETCHES), &settings.meta_model, digits)?));
        }
        let fitted = chosen.iter().map(|model| fitted(model, studies, &settings)).collect::<Result<Vec<_>, _>>()?;
        let texts = [posterior_figure(&panels), meta_model_figure(&fitted), moduli_csv(&rows)];
        let files = names.map(str::to_owned).into_iter().zip(texts.map(String::into_bytes)).collect();
        let facts =
            json!({ "sd_levels": nine_levels(), "moduli": rows, "tests": tests, "text": moduli_text(&rows, &tests) });
        Ok::<_, FitError>(Produced { files, facts, ..Produced::default() })
    });
    let files = names.iter().map(|name| folder.join(name)).collect();
    Ok(GenerativeFiles { files, settings: used, facts: facts(outcome)? })
}

fn fitted(model: &LiteratureModel, studies: &Studies, settings: &SampleSettings) -> Result<FittedCurve, FitError> {
    let curve = model.curve(studies.curves);
    let offset = settings.meta_model.log_offset_pa;
    let targets: Vec<f64> = curve.energies_pa.iter().map(|w| (w.max(0.0) + offset).ln()).collect();
    let fits = MetaModel::PAPER.map(|law| fit(law, &curve.stretches, &targets, &settings.meta_model));
    let fits = fits.into_iter().collect::<Result<_, _>>()?;
    Ok(FittedCurve { name: format!("{}: {} ({})", model.id, model.study, model.citation), curve, fits })
}

/// The figures of a stage.
pub(super) fn facts<E>(outcome: Result<StageOutcome, StageError<E>>) -> Result<Value, WorkflowError>
where
    WorkflowError: From<E>,
{
    match outcome {
        Ok(outcome) => Ok(outcome.manifest.facts),
        Err(StageError::Compute(error)) => Err(error.into()),
        Err(StageError::Write(error)) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_level_means_the_papers_nine_and_one_beyond_six_sd_or_none_at_all_is_refused() {
        assert_eq!(levels_asked(&[]).unwrap(), nine_levels());
        assert_eq!(levels_asked(&[-6.0, 0.5, 6.0]).unwrap(), [-6.0, 0.5, 6.0]);
        for bad in [6.1, -7.0, f64::NAN, f64::INFINITY] {
            let said = levels_asked(&[0.0, bad]).unwrap_err().to_string();
            assert!(said.contains(&bad.to_string()) && said.contains("-6 to 6"), "{said}");
        }
    }

    #[test]
    fn a_file_holds_one_to_a_million_random_materials() {
        assert!(check_draws(1).is_ok() && check_draws(1_000_000).is_ok());
        for count in [0, 1_000_001] {
            assert_eq!(check_draws(count), Err(AskedError::Draws { count, most: 1_000_000 }));
        }
    }
}

//! The study-level model of brain tissue, from a table of studies to files: fitted, sampled, shown.

use super::error::WorkflowError;
use super::generative::{GenerativeFiles, Studies, check_draws, facts, levels_asked};
use super::user_file::read_text;
use crate::artefact::{Produced, Stage};
use crate::material::Task;
use crate::material::generative::{SampleSettings, nine_levels};
use crate::material::literature::Curves;
use crate::material::study_level::Studies as Publications;
use crate::material::study_level::{
    Evidence, FitError, ModuliPrior, Of, SPREADS, Spreads, StudyLevelFile, StudyLevelFit, StudyLevelPrior,
    drawn_materials, fit, intervals, leave_one_publication_out, materials_at_levels, predict, predict_jointly, refit,
    uniform_probability,
};
use crate::material::task::stretches;
use crate::report::material_tables::{Sampled, TaskModuli, materials_csv, moduli_csv, quantiles};
use crate::report::study_level_figure::{TaskBands, bands_figure, left_out_figure};
use crate::report::study_level_tables::{
    fit_text, left_out_csv, left_out_text, log_curves_csv, moduli_prior_csv, prediction_csv, show_text,
};
use serde_json::json;
use std::path::Path;

/// Raised when this code changes its files.
const VERSION: u32 = 3;
/// Points over a window for the laws that are fitted, as in the published tests between laws.
const STRETCHES: usize = 101;
/// Persons drawn for the moduli's moments: their sd is known to 1.6 %.
const PERSONS: u64 = 2000;

/// A user's fitted spreads (TOML, as `hgm gp fit --model study-level` writes them).
///
/// # Errors
/// A file that cannot be read or does not hold them.
pub fn study_level_file(path: &Path) -> Result<StudyLevelFile, WorkflowError> {
    let file = path.display().to_string();
    StudyLevelFile::from_toml(&read_text(path)?).map_err(|reason| WorkflowError::StudyLevelFile { file, reason })
}

/// The publications, with the spreads of a file or those fitted to them.
fn model(studies: &Publications, own: Option<&Spreads>) -> Result<(Spreads, Evidence), FitError> {
    let spreads = match own {
        Some(spreads) => *spreads,
        None => refit(studies, &Spreads::default())?.spreads,
    };
    let evidence = Evidence::new(studies, &spreads).ok_or(FitError::NotFinite)?;
    Ok((spreads, evidence))
}

fn publications(studies: &Studies) -> Publications {
    Publications::from_literature(&studies.models, studies.curves)
}

fn law_settings(curves: Curves) -> SampleSettings {
    SampleSettings { curves, stretches: STRETCHES, ..SampleSettings::default() }
}

/// Spreads of highest posterior density with their intervals, and the moduli of a person nobody has measured, into
/// `study-level.toml` of `folder`.
///
/// # Errors
/// A table that holds too little; the disk's.
pub fn fit_study_level(
    studies: &Studies,
    seed: u64,
    (folder, force): (&Path, bool),
) -> Result<GenerativeFiles, WorkflowError> {
    let settings = json!({ "model": "study-level", "curves": studies.curves, "persons": PERSONS, "seed": seed });
    let stage = Stage::new("gp-fit-study-level", VERSION, folder, &settings).seed(seed);
    let outcome = studies.input(stage).run(force, || {
        let publications = publications(studies);
        let fit = fit(&publications, &Spreads::default(), seed)?;
        let warnings: Vec<String> = fit.warning(&publications).iter().map(ToString::to_string).collect();
        let evidence = Evidence::new(&publications, &fit.spreads).ok_or(FitError::NotFinite)?;
        let moduli = person_moduli(&evidence, &fit.spreads, seed, studies.curves)?;
        let intervals = intervals(&publications, &fit).unwrap_or([[0.0, f64::MAX]; SPREADS]);
        let file = StudyLevelFile::new(fit.spreads, intervals, moduli);
        let StudyLevelFit { log_likelihood, log_evidence, gradient_norm, .. } = fit;
        let facts = json!({
            "log_likelihood": log_likelihood, "log_evidence": log_evidence, "gradient_norm": gradient_norm,
            "publications": publications.publications.len(), "studies": studies.models.len(),
            "points": publications.points(), "spreads": file.spreads, "intervals_90": file.intervals_90,
            "moduli": file.moduli, "warnings": warnings, "text": fit_text(&file),
        });
        let files = vec![("study-level.toml".to_owned(), file.to_toml().into_bytes())];
        Ok::<_, FitError>(Produced { files, warnings, facts })
    });
    let files = vec![folder.join("study-level.toml")];
    Ok(GenerativeFiles { files, settings, facts: facts(outcome)? })
}

fn person_moduli(evidence: &Evidence, spreads: &Spreads, seed: u64, curves: Curves) -> Result<ModuliPrior, FitError> {
    let tasks: Vec<Task> = Task::all().collect();
    let joint = predict_jointly(&evidence.means, spreads, &tasks, Of::Person, STRETCHES);
    Ok(ModuliPrior::from_draws(&joint, PERSONS, seed, &law_settings(curves))?)
}

/// Which materials of a task are asked of the study-level model.
#[derive(Clone, Debug)]
pub enum Expected {
    /// At standard deviations from the mean; at the paper's nine where none is named.
    Levels(Vec<f64>),
    /// Fitted to random functions.
    Draws {
        /// How many.
        count: u64,
        /// Whether the functions are written too.
        curves: bool,
    },
}

/// Materials of one task and the prediction over the stretch, as CSV into `folder`. `seed` is that of the draws.
///
/// # Errors
/// A level or a number of draws out of range, a law that cannot be fitted; the disk's.
pub fn sample_study_level(
    studies: &Studies,
    (task, of): (Task, Of),
    wanted: &Expected,
    (settings, spreads): (&SampleSettings, Option<&Spreads>),
    seed: u64,
    (folder, force): (&Path, bool),
) -> Result<GenerativeFiles, WorkflowError> {
    let (how, levels, draws, curves) = match wanted {
        Expected::Levels(named) => ("levels", levels_asked(named)?, None, false),
        Expected::Draws { count, curves } => ("draws", vec![], Some(*count), *curves),
    };
    draws.map_or(Ok(()), check_draws)?;
    let used = json!({
        "model": "study-level", "task": task.to_string(), "of": of, "law": settings.model,
        "search": settings.meta_model, "curves": studies.curves, "stretches": settings.stretches, "levels": levels,
        "draws": draws, "write_curves": curves, "spreads": spreads,
    });
    let name = format!("study-level-{how}-{}-{task}", of.name());
    let stage = Stage::new(&format!("gp-{name}"), VERSION, folder, &used).seed(seed);
    let outcome = studies.input(stage).run(force, || {
        let (spreads, evidence) = model(&publications(studies), spreads)?;
        let prior = over_window(&evidence, &spreads, task, of, settings.stretches);
        let sampled: Vec<Sampled> = match wanted {
            Expected::Levels(_) => materials_at_levels(&prior, &levels, settings)?
                .into_iter()
                .map(|m| Sampled { sd_level: Some(m.sd_level), draw: None, fit: m.fit })
                .collect(),
            Expected::Draws { count, .. } => drawn_materials(&prior, *count, seed, settings)?
                .into_iter()
                .map(|m| Sampled { sd_level: None, draw: Some(m.draw), fit: m.fit })
                .collect(),
        };
        let mut files = vec![
            (format!("{name}.csv"), materials_csv(&sampled, settings.model).into_bytes()),
            (format!("study-level-prediction-{}-{task}.csv", of.name()), prediction_csv(&prior).into_bytes()),
        ];
        if let Some(draws) = draws.filter(|_| curves) {
            let text = log_curves_csv(&prior, draws, seed);
            files.push((format!("study-level-curves-{}-{task}.csv", of.name()), text.into_bytes()));
        }
        let first: Vec<&Sampled> = sampled.iter().take(20).collect();
        let facts = json!({ "shear_modulus_pa": quantiles(&sampled), "materials": first });
        Ok::<_, FitError>(Produced { files, facts, ..Produced::default() })
    });
    let files = vec![folder.join(format!("{name}.csv"))];
    Ok(GenerativeFiles { files, settings: used, facts: facts(outcome)? })
}

fn over_window(evidence: &Evidence, spreads: &Spreads, task: Task, of: Of, points: usize) -> StudyLevelPrior {
    let [low, high] = task.stretch_window();
    predict(&evidence.means, spreads, task, of, &stretches(low, high, points))
}

/// Bands of all tasks, each publication against what the others say of it, and the moduli of a person nobody has
/// measured, into `folder`: all of these studies, whatever studies the spreads were fitted to. `seed` is that of the persons who are
/// drawn. The facts' `text` is for a terminal.
///
/// # Errors
/// A table that holds too little; the disk's.
pub fn show_study_level(
    studies: &Studies,
    own: Option<&Spreads>,
    seed: u64,
    (folder, force): (&Path, bool),
) -> Result<GenerativeFiles, WorkflowError> {
    let used =
        json!({ "model": "study-level", "curves": studies.curves, "spreads": own, "persons": PERSONS, "seed": seed });
    let stage = Stage::new("gp-show-study-level", VERSION, folder, &used).seed(seed);
    let names = [
        "study-level-bands.svg",
        "study-level-left-out.svg",
        "study-level-moduli.csv",
        "study-level-person.csv",
        "study-level-left-out.csv",
    ];
    let outcome = studies.input(stage).run(force, || {
        let settings = law_settings(studies.curves);
        let publications = publications(studies);
        let all = refit(&publications, &own.copied().unwrap_or_default())?;
        let spreads = own.copied().unwrap_or(all.spreads);
        let evidence = Evidence::new(&publications, &spreads).ok_or(FitError::NotFinite)?;
        let mut rows = Vec::new();
        let mut panels = Vec::new();
        for task in Task::all() {
            let prior = |of: Of| over_window(&evidence, &spreads, task, of, STRETCHES);
            let moduli = materials_at_levels(&prior(Of::Person), &nine_levels(), &settings)?;
            let shear_modulus_pa = moduli.iter().map(|m| m.shear_modulus_pa).collect();
            rows.push(TaskModuli { task: task.to_string(), shear_modulus_pa });
            let curves = publications.publications.iter().flat_map(|(_, curves)| curves);
            let curves = curves.filter(|curve| curve.task == task).cloned().collect();
            panels.push(TaskBands { bands: [Of::Study, Of::Laboratory, Of::Mean].map(prior), curves });
        }
        let left_out = leave_one_publication_out(&publications, &all)?;
        let moduli = person_moduli(&evidence, &spreads, seed, studies.curves)?;
        let ranks: Vec<f64> = left_out.iter().map(|left| left.rank).collect();
        let points = left_out.iter().map(|left| left.points).sum::<usize>() as f64;
        let texts = [
            bands_figure(&panels),
            left_out_figure(&left_out),
            moduli_csv(&rows),
            moduli_prior_csv(&moduli),
            left_out_csv(&left_out),
        ];
        let files = names.map(str::to_owned).into_iter().zip(texts.map(String::into_bytes)).collect();
        let facts = json!({
            "sd_levels": nine_levels(), "moduli": rows, "left_out": left_out,
            "log_density_per_point": left_out.iter().map(|left| left.log_density).sum::<f64>() / points,
            "rank_probability": uniform_probability(&ranks),
            "text": format!("{}\n{}", show_text(&rows), left_out_text(&left_out)),
        });
        Ok::<_, FitError>(Produced { files, facts, ..Produced::default() })
    });
    let files = names.iter().map(|name| folder.join(name)).collect();
    Ok(GenerativeFiles { files, settings: used, facts: facts(outcome)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_a_persons_moduli_are_of_the_studies_and_the_seed_that_are_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let mut studies = Studies::read(None, Curves::Corrected).unwrap();
        studies.models.truncate(8);
        fit_study_level(&studies, 3, (folder.path(), false)).unwrap();
        let fitted = study_level_file(&folder.path().join("study-level.toml")).unwrap();
        let shown = |studies: &Studies, seed: u64, name: &str| {
            let place = folder.path().join(name);
            show_study_level(studies, Some(&fitted.spreads), seed, (&place, false)).unwrap();
            std::fs::read_to_string(place.join("study-level-person.csv")).unwrap()
        };
        // The studies and the seed of the fit give what the fit has found.
        let own = shown(&studies, 3, "own");
        assert_eq!(own, moduli_prior_csv(&fitted.moduli));
        // Another seed is other persons, where the first ones lie already.
        assert_ne!(shown(&studies, 4, "own"), own);
        let mut fewer = studies.clone();
        fewer.models.remove(0);
        assert_ne!(shown(&fewer, 3, "fewer"), own);
    }
}

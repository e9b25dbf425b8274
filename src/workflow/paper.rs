//! The paper's figures and table in one go: literature, Gaussian process, laws, phantom.

use super::error::WorkflowError;
use super::generative::{FIGURE_3, GenerativeFiles, Studies, show_gp};
use super::progress::Progress;
use super::settings::Settings;
use super::work::Place;
use crate::artefact::write_whole;
use crate::experiment::outcome::{ExperimentOutcome, SampleOutcome};
use crate::material::Task;
use crate::material::generative::{SampleSettings, sample_prior, tissue_prior};
use crate::material::literature::Curves;
use crate::material::meta_model::MetaModelSettings;
use crate::material::published::{printed_kruskal_wallis, printed_moduli};
use crate::material::statistics::{CostDigits, compare};
use crate::report::paper::{ModulusBeside, TaskErrors, TestBeside, errors_csv, errors_figure, page, table_1_csv};
use serde_json::json;

/// Points over a window of the published tests.
const TEST_STRETCHES: usize = 101;
/// Where the phantom's case lies.
const PHANTOM: &str = "phantom";

/// Fig. 2, 3 and 4 and Table 1 with its tests, beside what is printed, into the folder of `place`.
///
/// # Errors
/// A law that cannot be fitted, a phantom that cannot be simulated; the disk's.
pub fn paper(
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<GenerativeFiles, WorkflowError> {
    let folder = &place.folder;
    let published = SampleSettings::published();
    let studies = Studies::read(None, Curves::Published)?;
    let shown = show_gp(&studies, &FIGURE_3, &published, (folder, place.force))?;
    let (moduli, tests) = (moduli_beside()?, tests_beside()?);
    let inside = Place { folder: folder.join(PHANTOM), ..place.clone() };
    let outcome = super::phantom(true, &inside, settings, progress)?.outcome()?;
    let errors = errors(&outcome);
    let best = outcome.best_sample.clone().unwrap_or_else(|| "none".to_owned());
    let texts = [
        ("paper.md", page(&moduli, &tests, &best)),
        ("table-1.csv", table_1_csv(&moduli)),
        ("fig-4-phantom.svg", errors_figure(&errors)),
        ("fig-4-phantom.csv", errors_csv(&errors)),
    ];
    let mut files = Vec::new();
    for (name, text) in texts {
        write_whole(&folder.join(name), text.as_bytes())?;
        files.push(folder.join(name));
    }
    files.extend(shown.files);
    let facts = json!({ "moduli": moduli, "tests": tests, "phantom": errors, "best_sample": best });
    Ok(GenerativeFiles { files, settings: json!({ "phantom": settings.phantom, "mesh": settings.mesh }), facts })
}

/// Table 1's moduli, printed and computed three ways.
///
/// # Errors
/// A law that cannot be fitted.
pub fn moduli_beside() -> Result<Vec<ModulusBeside>, WorkflowError> {
    let published = SampleSettings::published();
    let exact = SampleSettings { meta_model: MetaModelSettings::default(), ..published.clone() };
    let ways = [published, exact, SampleSettings::default()];
    let printed = printed_moduli();
    let mut rows = Vec::new();
    // Every task's posterior once for each way.
    for of_task in printed.chunk_by(|a, b| a.task == b.task) {
        let task = of_task[0].task;
        let levels: Vec<f64> = of_task.iter().map(|p| p.sd_level).collect();
        let found = |settings: &SampleSettings| sample_prior(&tissue_prior(task, settings), &levels, settings);
        let [as_published, exact_fit, corrected] = [found(&ways[0])?, found(&ways[1])?, found(&ways[2])?];
        for (n, p) in of_task.iter().enumerate() {
            rows.push(ModulusBeside {
                task: task.to_string(),
                sd_level: p.sd_level,
                printed_pa: p.shear_modulus_pa,
                as_published_pa: as_published[n].shear_modulus_pa,
                exact_fit_pa: exact_fit[n].shear_modulus_pa,
                corrected_pa: corrected[n].shear_modulus_pa,
            });
        }
    }
    Ok(rows)
}

/// The tests between the laws, printed and computed.
///
/// # Errors
/// A law that cannot be fitted.
pub fn tests_beside() -> Result<Vec<TestBeside>, WorkflowError> {
    let ours = SampleSettings { stretches: TEST_STRETCHES, ..SampleSettings::default() };
    let theirs = SampleSettings { stretches: TEST_STRETCHES, ..SampleSettings::published() };
    let one = |(task, printed_h): (Task, f64)| -> Result<TestBeside, WorkflowError> {
        let as_published = compare(&tissue_prior(task, &theirs), &theirs.meta_model, CostDigits::Two)?.kruskal_wallis;
        let friedman = compare(&tissue_prior(task, &ours), &ours.meta_model, CostDigits::All)?.friedman;
        Ok(TestBeside { task: task.to_string(), printed_h, as_published, friedman })
    };
    printed_kruskal_wallis().into_iter().map(one).collect()
}

/// The errors of every task's samples, in the order of the tasks.
fn errors(outcome: &ExperimentOutcome) -> Vec<TaskErrors> {
    let one = |task: Task| {
        let own = |sample: &&SampleOutcome| sample.task.as_deref() == Some(task.to_string().as_str());
        let figures = |sample: &SampleOutcome| {
            let level = sample.sd_levels.values().next()?;
            Some((*level, *sample.shear_modulus_pa.values().next()?, *sample.rmse_mm.get("all")?))
        };
        let samples: Vec<_> = outcome.samples.iter().filter(own).filter_map(figures).collect();
        let name = task.to_string();
        let (kind, region) = name.split_once('-').unwrap_or((&name, ""));
        TaskErrors { kind: kind.to_owned(), region: region.to_owned(), samples }
    };
    Task::all().map(one).filter(|task| !task.samples.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printed_number_comes_out() {
        let moduli = moduli_beside().unwrap();
        assert_eq!(moduli.len(), 15);
        for row in &moduli {
            assert!((row.as_published_pa - row.printed_pa).abs() < 0.7, "{row:?}");
        }
        // The exact fit's, computed by another program from the same posterior.
        let exact = [528.7, 636.0, 765.0, 920.2, 1331.0, 2314.9, 314.8, 372.4, 440.5, 521.0, 616.2, 1205.1];
        for (row, exact) in moduli.iter().zip(exact) {
            assert!((row.exact_fit_pa - exact).abs() < 0.06, "{row:?} {exact}");
        }
        let tests = tests_beside().unwrap();
        assert_eq!(tests.len(), 3);
        for test in &tests {
            assert_eq!(format!("{:.2}", test.as_published.h), format!("{:.2}", test.printed_h), "{test:?}");
        }
        let text = page(&moduli, &tests, "hyperelastic-healthy-03");
        for r in &moduli {
            let row = format!("| {:.0} | {:.1} |", r.printed_pa, r.as_published_pa);
            assert!(text.contains(&row), "{row} in\n{text}");
        }
        assert!(
            text.contains("| 14.59 | 14.59 |")
                && text.contains("| 20.98 | 20.98 |")
                && text.contains("| 15.17 | 15.17 |")
        );
    }
}

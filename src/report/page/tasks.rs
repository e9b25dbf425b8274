//! Samples of every task of the generative model beside each other: a case's, as the paper's Fig. 5 and Table 1 have them, and a
//! cohort's by ranks.

use super::super::chart::{DataPoint, LineChart, Rule, Series};
use super::super::cohort_tasks::TaskRanks;
use super::super::html::{fixed, number};
use super::results::{Row, set_name, table, words};
use crate::experiment::outcome::{ExperimentOutcome, SampleOutcome};
use maud::{Markup, PreEscaped, html};

/// Whether samples of several tasks are there.
pub fn compared(outcome: &ExperimentOutcome) -> bool {
    tasks_of(outcome).len() > 1 && !outcome.rmse_sets().is_empty()
}

/// The tasks, in the order of the samples.
fn tasks_of(outcome: &ExperimentOutcome) -> Vec<&str> {
    let mut tasks: Vec<&str> = outcome.samples.iter().filter_map(|s| s.task.as_deref()).collect();
    tasks.dedup();
    tasks
}

/// `mre-grey` as kind and region.
fn parts(task: &str) -> (&str, &str) {
    task.split_once('-').unwrap_or((task, ""))
}

fn kind_name(kind: &str) -> &str {
    match kind {
        "mre" => "Elastography",
        "linear" => "Linear elasticity",
        "hyperelastic" => "Hyperelastic tests",
        other => other,
    }
}

/// The level a sample stands at: its lesion's where only that is varied.
fn level(sample: &SampleOutcome) -> Option<f64> {
    let abnormal = sample.task.as_deref().is_some_and(|task| parts(task).1 == "abnormal");
    let own = sample.sd_levels.iter().find(|(tissue, _)| !abnormal || tissue.as_str() != "brain");
    own.map(|(_, level)| *level)
}

/// The modulus that the level stands for, Pa.
fn modulus(sample: &SampleOutcome) -> Option<f64> {
    let abnormal = sample.task.as_deref().is_some_and(|task| parts(task).1 == "abnormal");
    let own = sample.shear_modulus_pa.iter().find(|(tissue, _)| !abnormal || tissue.as_str() != "brain");
    own.map(|(_, pa)| *pa)
}

/// A panel for every kind of study and node set, and the table of moduli and errors; nothing where one task alone was tried.
pub fn of_case(outcome: &ExperimentOutcome) -> Markup {
    if !compared(outcome) {
        return html! {};
    }
    let sets = outcome.rmse_sets();
    let tasks = tasks_of(outcome);
    let mut kinds: Vec<&str> = tasks.iter().map(|task| parts(task).0).collect();
    kinds.dedup();
    let panels = |set: &str| {
        html! {
            div class="charts" {
                @for kind in &kinds {
                    figure {
                        (PreEscaped(panel(outcome, kind, set)))
                        figcaption { (kind_name(kind)) ", " (set_name(set)) "." }
                    }
                }
            } "\n"
        }
    };
    let converged = outcome.samples.iter().filter(|s| s.converged);
    let nearest = converged
        .filter_map(|s| Some((s.task.as_deref()?, *s.rmse_mm.get(sets.first()?)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    html! {
        p {
            (tasks.len()) " tasks of the generative model, each at its own levels."
            @if let Some((task, mm)) = nearest {
                " The smallest error, " (set_name(&sets[0])) ": " (number(mm, 3)) " mm by " (task.replace('-', " ")) "."
            }
            @if tasks.iter().any(|task| parts(task).1 == "abnormal") {
                " Tasks of abnormal tissue vary the lesion, in a brain at the mean of the healthy task beside it."
            }
        }
        @for (n, set) in sets.iter().enumerate() {
            @if n == 0 { (panels(set)) } @else { details { summary { "The same, " (set_name(set)) } (panels(set)) } }
        }
        details {
            summary { "Shear moduli and errors, task by task" }
            (grid("Shear modulus (Pa) at each level of its task", outcome, &tasks, &|s| modulus(s).map(|pa| number(pa, 4))))
            @for set in &sets {
                (grid(&format!("RMSE, {} (mm)", set_name(set)), outcome, &tasks, &|s| {
                    s.rmse_mm.get(set).map(|mm| number(*mm, 3))
                }))
            }
        } "\n"
    }
}

/// Error over the level, a line for each region.
fn panel(outcome: &ExperimentOutcome, kind: &str, set: &str) -> String {
    let of = |task: &&str| {
        let own = outcome.samples.iter().filter(|s| s.converged && s.task.as_deref() == Some(*task));
        let point = |s: &SampleOutcome| {
            let (x, y) = (level(s)?, *s.rmse_mm.get(set)?);
            let pa = modulus(s).map_or_else(String::new, |pa| format!(", {} Pa", number(pa, 4)));
            let chosen = outcome.best_sample.as_ref() == Some(&s.id);
            Some(DataPoint { x, y, y_error: None, note: format!("{}: {} mm{pa}", s.id, number(y, 3)), chosen })
        };
        Series { name: parts(task).1.to_owned(), points: own.filter_map(point).collect() }
    };
    let tasks = tasks_of(outcome);
    let rest = outcome.rest_rmse_mm.get(set).map(|mm| Rule { at: *mm, name: "undeformed".to_owned() });
    let floor = outcome.noise_floor.and_then(|floor| floor.combined_mm());
    let chart = LineChart {
        description: format!(
            "{}: RMSE of the samples at the {} over the level of their task",
            kind_name(kind),
            set_name(set)
        ),
        x_label: "level of the task (SD from its mean)".to_owned(),
        y_label: "RMSE (mm)".to_owned(),
        y_from_zero: true,
        series: tasks.iter().filter(|task| parts(task).0 == kind).map(of).collect(),
        y_rules: rest.into_iter().chain(floor.map(|mm| Rule { at: mm, name: "noise floor".to_owned() })).collect(),
        ..LineChart::default()
    };
    chart.to_svg()
}

/// Tasks by levels, in the form of the paper's Table 1.
fn grid(
    caption: &str,
    outcome: &ExperimentOutcome,
    tasks: &[&str],
    cell: &dyn Fn(&SampleOutcome) -> Option<String>,
) -> Markup {
    let mut levels: Vec<f64> = outcome.samples.iter().filter(|s| s.task.is_some()).filter_map(level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut head = vec!["task".to_owned()];
    head.extend(levels.iter().map(|level| format!("{} SD", fixed(*level, 1))));
    let row = |task: &&str| -> Row {
        let at = |wanted: &f64| {
            let own = outcome.samples.iter().find(|s| s.task.as_deref() == Some(*task) && level(s) == Some(*wanted));
            own.and_then(cell).unwrap_or_else(|| "–".to_owned())
        };
        (false, words(std::iter::once(task.replace('-', " ")).chain(levels.iter().map(at))))
    };
    table(caption, &head, &tasks.iter().map(row).collect::<Vec<_>>())
}

/// The tasks of a cohort by their ranks; nothing where they were not compared.
pub fn of_cohort(all: &[TaskRanks]) -> Option<Markup> {
    let one = |ranks: &TaskRanks| {
        let head = ["task", "median RMSE (mm)", "MAD (mm)", "mean rank"].map(str::to_owned);
        let rows: Vec<Row> = ranks
            .tasks
            .iter()
            .map(|t| {
                let numbers = [number(t.median_rmse_mm, 3), number(t.mad_rmse_mm, 2), number(t.mean_rank, 3)];
                (false, words(std::iter::once(t.task.replace('-', " ")).chain(numbers)))
            })
            .collect();
        let freedom = ranks.tasks.len() - 1;
        html! {
            (table(&format!("Best sample of every task, {}", set_name(&ranks.set)), &head, &rows))
            p {
                "Friedman's test within the " (ranks.patients) " patients: chi-square " (number(ranks.friedman.h, 3)) " with "
                (freedom) " degrees of freedom, p " (probability(ranks.friedman.p)) "; agreement of the patients (Kendall's W) "
                (number(ranks.kendall_w, 2)) ". Kruskal and Wallis' test, the paper's, which takes every error as another \
                 patient's: " (number(ranks.kruskal_wallis.h, 3)) ", p " (probability(ranks.kruskal_wallis.p)) "."
            } "\n"
        }
    };
    (!all.is_empty()).then(|| html! { @for ranks in all { (one(ranks)) } })
}

fn probability(p: f64) -> String {
    if p < 0.001 { "< 0.001".to_owned() } else { number(p, 2) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn sample(task: &str, n: usize, tissues: &[(&str, f64, f64)], mm: f64) -> SampleOutcome {
        SampleOutcome {
            id: format!("{task}-{n:02}"),
            task: Some(task.to_owned()),
            sd_levels: tissues.iter().map(|(name, level, _)| ((*name).to_owned(), *level)).collect(),
            shear_modulus_pa: tissues.iter().map(|(name, _, pa)| ((*name).to_owned(), *pa)).collect(),
            rmse_mm: BTreeMap::from([("margin".to_owned(), mm), ("ventricle".to_owned(), 2.0 * mm)]),
            converged: true,
            ..SampleOutcome::default()
        }
    }

    #[test]
    fn every_task_has_a_line_in_its_panel_and_a_row_of_its_own_levels() {
        let samples = vec![
            sample("mre-grey", 0, &[("brain", -1.0, 1111.0)], 2.0),
            sample("mre-grey", 1, &[("brain", 1.0, 2222.0)], 1.5),
            sample("mre-abnormal", 0, &[("brain", 0.0, 500.0), ("tumour", -1.0, 3333.0)], 1.0),
            sample("mre-abnormal", 1, &[("brain", 0.0, 500.0), ("tumour", 1.0, 4444.0)], 1.2),
            sample("linear-grey", 0, &[("brain", -1.0, 5555.0)], 3.0),
        ];
        let outcome = ExperimentOutcome { tissues: vec!["brain".to_owned()], samples, ..ExperimentOutcome::default() };
        let page = of_case(&outcome).into_string();
        assert_eq!(page.matches("<svg").count(), 4, "two kinds of study at two sets");
        for said in ["1111", "3333", "4444", "1.00 mm by mre abnormal", "3 tasks", "vary the lesion"] {
            assert!(page.contains(said), "{said}: {page}");
        }
        // The lesion's own modulus stands at its level, not that of the brain around it.
        assert!(!page.contains(">500<") && !page.contains(">500.0<"), "{page}");
        assert!(of_case(&ExperimentOutcome::default()).into_string().is_empty());
    }
}

//! Which task of the generative model explains a cohort best: every task's best sample in every patient, compared by ranks (the
//! paper's Fig. 5, and its test beside the one that fits).

use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::rmse::median_and_mad;
use crate::material::rank_test::{RankTest, concordance, friedman, kruskal_wallis, ranks};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeSet;

/// Patients from which on tasks are compared: chi-square is no approximation of fewer.
pub const PATIENTS: usize = 5;

/// The tasks at one node set.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TaskRanks {
    /// The node set.
    pub set: String,
    /// Patients that have all of these tasks.
    pub patients: usize,
    /// The tasks, the best one first.
    pub tasks: Vec<TaskRank>,
    /// Friedman's test, which compares within each patient.
    pub friedman: RankTest,
    /// Kendall's coefficient of concordance: 0 where patients agree in nothing, 1 where all have one order of tasks.
    pub kendall_w: f64,
    /// Kruskal and Wallis' test, the paper's, which takes every patient's errors as independent.
    pub kruskal_wallis: RankTest,
}

/// One task over the patients.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TaskRank {
    /// `hyperelastic-white`.
    pub task: String,
    /// Median over the patients of the smallest error of its samples, mm.
    pub median_rmse_mm: f64,
    /// Median absolute deviation from it (not scaled), mm.
    pub mad_rmse_mm: f64,
    /// Mean rank among the tasks of a patient; 1 is the smallest error.
    pub mean_rank: f64,
}

/// The tasks at every node set that [`PATIENTS`] or more have them at.
pub fn compare_tasks(outcomes: &[&ExperimentOutcome]) -> Vec<TaskRanks> {
    let sets: BTreeSet<String> = outcomes.iter().flat_map(|outcome| outcome.rmse_sets()).collect();
    sets.iter().filter_map(|set| at_set(outcomes, set)).collect()
}

/// The smallest error of a task's samples.
fn best(outcome: &ExperimentOutcome, task: &str, set: &str) -> Option<f64> {
    let own = outcome.samples.iter().filter(|s| s.converged && s.task.as_deref() == Some(task));
    own.filter_map(|s| s.rmse_mm.get(set).copied()).min_by(f64::total_cmp)
}

fn at_set(outcomes: &[&ExperimentOutcome], set: &str) -> Option<TaskRanks> {
    let tasks_of = |outcome: &&ExperimentOutcome| -> BTreeSet<String> {
        let named = outcome.samples.iter().filter_map(|s| s.task.clone());
        named.filter(|task| best(outcome, task, set).is_some()).collect()
    };
    let of_patients: Vec<BTreeSet<String>> = outcomes.iter().map(tasks_of).filter(|tasks| !tasks.is_empty()).collect();
    // Tasks of abnormal tissue are only those patients' who have a lesion: they are compared where all have one.
    let common = of_patients.iter().cloned().reduce(|a, b| &a & &b)?;
    let row =
        |outcome: &&ExperimentOutcome| common.iter().map(|task| best(outcome, task, set)).collect::<Option<Vec<f64>>>();
    let rows: Vec<Vec<f64>> = outcomes.iter().filter_map(row).collect();
    if rows.len() < PATIENTS || common.len() < 2 {
        return None;
    }
    let columns: Vec<Vec<f64>> = (0..common.len()).map(|c| rows.iter().map(|row| row[c]).collect()).collect();
    let mut sums = vec![0.0; common.len()];
    for row in &rows {
        for (sum, rank) in sums.iter_mut().zip(ranks(row).0) {
            *sum += rank;
        }
    }
    let (paired, pooled) = (friedman(&rows), kruskal_wallis(&columns));
    let one = |((task, column), sum): ((&String, &Vec<f64>), &f64)| {
        let (median_rmse_mm, mad_rmse_mm) = median_and_mad(column)?;
        Some(TaskRank { task: task.clone(), median_rmse_mm, mad_rmse_mm, mean_rank: sum / rows.len() as f64 })
    };
    let mut tasks: Vec<TaskRank> = common.iter().zip(&columns).zip(&sums).filter_map(one).collect();
    tasks.sort_by(|a, b| a.mean_rank.total_cmp(&b.mean_rank).then_with(|| a.task.cmp(&b.task)));
    Some(TaskRanks {
        set: set.to_owned(),
        patients: rows.len(),
        kendall_w: concordance(&paired, rows.len(), tasks.len()),
        tasks,
        friedman: paired,
        kruskal_wallis: pooled,
    })
}

/// The tasks of all sets as BIDS writes a table; the tests of a set stand in each of its lines.
pub fn to_tsv(all: &[TaskRanks]) -> String {
    let head = "set\ttask\tpatients\tmedian_rmse_mm\tmad_rmse_mm\tmean_rank\tfriedman_chi2\tfriedman_p\tkendall_w\t\
                kruskal_wallis_h\tkruskal_wallis_p\n";
    let lines = all.iter().flat_map(|ranks| {
        ranks.tasks.iter().map(move |task| {
            let numbers = [
                task.median_rmse_mm,
                task.mad_rmse_mm,
                task.mean_rank,
                ranks.friedman.h,
                ranks.friedman.p,
                ranks.kendall_w,
                ranks.kruskal_wallis.h,
                ranks.kruskal_wallis.p,
            ];
            // All patients alike in all tasks: there is nothing to be tested.
            let cell = |v: f64| if v.is_finite() { v.to_string() } else { "n/a".to_owned() };
            let first = [ranks.set.clone(), task.task.clone(), ranks.patients.to_string()];
            first.into_iter().chain(numbers.map(cell)).collect::<Vec<_>>().join("\t") + "\n"
        })
    });
    head.to_owned() + &lines.collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::SampleOutcome;
    use std::collections::BTreeMap;

    /// A patient whose tasks have these smallest errors, each with a worse sample beside it.
    fn patient(errors_mm: &[(&str, f64)]) -> ExperimentOutcome {
        let sample = |task: &str, n: usize, mm: f64| SampleOutcome {
            id: format!("{task}-{n:02}"),
            task: Some(task.to_owned()),
            rmse_mm: BTreeMap::from([("margin".to_owned(), mm)]),
            converged: true,
            ..SampleOutcome::default()
        };
        let samples =
            errors_mm.iter().flat_map(|(task, mm)| [sample(task, 0, mm + 1.0), sample(task, 1, *mm)]).collect();
        ExperimentOutcome { samples, ..ExperimentOutcome::default() }
    }

    #[test]
    fn patients_that_agree_have_one_order_and_a_shift_of_a_whole_patient_changes_nothing() {
        let of = |shift: f64| {
            patient(&[("mre-grey", 2.0 + shift), ("linear-grey", 1.0 + shift), ("mre-white", 3.0 + shift)])
        };
        let patients: Vec<ExperimentOutcome> = (0..6).map(|n| of(10.0 * f64::from(n))).collect();
        let all = compare_tasks(&patients.iter().collect::<Vec<_>>());
        let [ranks] = &all[..] else { panic!("{all:?}") };
        assert_eq!(
            ranks.tasks.iter().map(|t| t.task.as_str()).collect::<Vec<_>>(),
            ["linear-grey", "mre-grey", "mre-white"]
        );
        assert_eq!((ranks.patients, ranks.kendall_w, ranks.friedman.h), (6, 1.0, 12.0));
        assert_eq!(ranks.tasks[0].median_rmse_mm, 26.0);
        // Between patients the errors differ by ten times as much: pooled, nothing is seen.
        assert!(ranks.friedman.p < 0.01 && ranks.kruskal_wallis.p > 0.5, "{ranks:?}");
        let table = to_tsv(&all);
        assert_eq!(table.lines().count(), 4);
        assert!(table.lines().all(|line| line.split('\t').count() == 11), "{table}");
    }

    #[test]
    fn a_task_that_not_all_have_is_left_out_and_too_few_patients_are_not_compared() {
        let with = patient(&[("mre-grey", 2.0), ("linear-grey", 1.0), ("mre-abnormal", 0.5)]);
        let without = patient(&[("mre-grey", 2.5), ("linear-grey", 1.5)]);
        let swept = patient(&[]);
        let five = [&with, &with, &without, &swept, &with, &without];
        let all = compare_tasks(&five);
        assert_eq!((all.len(), all[0].patients, all[0].tasks.len()), (1, 5, 2));
        assert!(compare_tasks(&five[..4]).is_empty());
    }
}

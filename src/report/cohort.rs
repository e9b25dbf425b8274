//! Many patients in one table: a line of figures each, their median and spread, those that stand apart first.

pub use super::cohort_population::{CohortPopulation, Pupil};
pub use super::member::{Member, Status};

use super::cohort_tasks::{TaskRanks, compare_tasks};
use super::look_first::{LookFirst, scan_measures};
use super::median_samples::{MedianSample, median_samples};
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::rmse::median_and_mad;
use crate::experiment::verdict::{Claim, Reason};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

/// A line of the table.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Row {
    /// `sub-01`.
    pub participant_id: String,
    /// How it ended.
    pub status: Status,
    /// Why it did not end well.
    pub message: Option<String>,
    /// Whether its page lies beside that of all.
    #[serde(skip)]
    pub has_page: bool,
    /// The sample that explains it best, or `estimate`.
    pub best_sample: Option<String>,
    /// What it comes down to, in a few words.
    pub verdict: Option<&'static str>,
    /// The same in the sentence of its page.
    pub sentence: Option<String>,
    /// Warnings on its page.
    pub warnings: usize,
    /// Numbers by the name of their column.
    pub figures: BTreeMap<String, f64>,
    /// Columns in which it lies apart from the others.
    pub outlying: Vec<String>,
    /// Its largest distance from a median, in robust standard deviations; 0 where none can be told.
    pub distance: f64,
}

/// The table of a cohort.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Cohort {
    /// `hgm x.y.z`.
    pub program: String,
    /// Columns of numbers, in order; units in the names.
    pub columns: Vec<String>,
    /// Subjects: those that did not end well first, then by their distance from the others.
    pub subjects: Vec<Row>,
    /// Median of every column over the subjects that ended well and have it.
    pub median: BTreeMap<String, f64>,
    /// Median absolute deviation from it (not scaled).
    pub mad: BTreeMap<String, f64>,
    /// Every sample over the subjects, where all were run with the same ones.
    pub median_samples: Vec<MedianSample>,
    /// Tasks of the generative model against each other, where enough subjects were run with every one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tasks: Vec<TaskRanks>,
    /// What a reader must know before comparing the subjects.
    #[schemars(with = "Vec<String>")]
    pub warnings: Vec<CohortWarning>,
    /// Scans to look at first: the subjects by risk.
    pub look_first: LookFirst,
    /// What the subjects say of people, where they were estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub population: Option<CohortPopulation>,
}

/// What a reader must know before comparing subjects.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum CohortWarning {
    #[error("the subjects were run with {different} different settings; compare their settings.toml or run them again")]
    OtherSettings { different: usize },
}

impl Serialize for CohortWarning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Iglewicz and Hoaglin (How to detect and handle outliers, 1993): apart is what lies more than 3.5 robust standard
/// deviations from the median; a Gaussian's standard deviation is its median absolute deviation / 0.6745.
const APART: f64 = 3.5;
const MAD_OF_GAUSSIAN: f64 = 0.6745;

impl Cohort {
    /// The table of these subjects.
    pub fn new(members: &[Member]) -> Self {
        let mut columns: Vec<String> = Vec::new();
        let mut subjects: Vec<Row> = members.iter().map(|member| row(member, &mut columns)).collect();
        let (mut median_of, mut mad_of) = (BTreeMap::new(), BTreeMap::new());
        for name in &columns {
            // What a gate refused is shown, and says nothing of what is usual.
            let well = subjects.iter().filter(|row| row.status == Status::Done);
            let values: Vec<f64> = well.filter_map(|row| row.figures.get(name)).copied().collect();
            let Some((centre, spread)) = median_and_mad(&values) else { continue };
            for row in subjects.iter_mut().filter(|row| row.status == Status::Done) {
                let Some(value) = row.figures.get(name) else { continue };
                let distance = MAD_OF_GAUSSIAN * (value - centre).abs() / spread;
                // Without spread (one subject, equal settings) nobody can be said to lie apart.
                if spread > 0.0 && distance > row.distance {
                    row.distance = distance;
                }
                if spread > 0.0 && distance > APART {
                    row.outlying.push(name.clone());
                }
            }
            median_of.insert(name.clone(), centre);
            mad_of.insert(name.clone(), spread);
        }
        subjects.sort_by(|a, b| {
            let well = |row: &Row| row.status == Status::Done;
            let order = well(a).cmp(&well(b)).then(b.distance.partial_cmp(&a.distance).unwrap_or(Ordering::Equal));
            order.then_with(|| a.participant_id.cmp(&b.participant_id))
        });
        let settings: BTreeSet<&String> = members.iter().filter_map(|m| m.settings_sha256.as_ref()).collect();
        let mut warnings = Vec::new();
        if settings.len() > 1 {
            warnings.push(CohortWarning::OtherSettings { different: settings.len() });
        }
        let well = members.iter().filter(|member| member.status == Status::Done);
        let outcomes: Vec<&ExperimentOutcome> = well.filter_map(|member| member.outcome.as_ref()).collect();
        let (median_samples, tasks) = (median_samples(&outcomes), compare_tasks(&outcomes));
        let program = concat!("hgm ", env!("CARGO_PKG_VERSION")).to_owned();
        Self {
            program,
            columns,
            subjects,
            median: median_of,
            mad: mad_of,
            median_samples,
            tasks,
            warnings,
            look_first: LookFirst::new(members),
            population: None,
        }
    }

    /// The table as BIDS writes one: tabs, `n/a` where there is no value, a line for each subject and no other.
    pub fn to_tsv(&self) -> String {
        let cell = |value: Option<&f64>| value.map_or_else(|| "n/a".to_owned(), f64::to_string);
        let numbers = |from: &BTreeMap<String, f64>| -> Vec<String> {
            self.columns.iter().map(|name| cell(from.get(name))).collect()
        };
        let head = ["participant_id", "status", "best_sample", "verdict", "warnings"].map(str::to_owned);
        let last = ["look_first", "look_because"].map(str::to_owned);
        let measured: Vec<String> = scan_measures().map(|(scan, measure)| measure.column_of(scan)).collect();
        let mut lines = vec![[&head[..], &self.columns, &last, &measured].concat()];
        for row in &self.subjects {
            let text = |text: Option<&str>| text.unwrap_or("n/a").to_owned();
            let first = [
                row.participant_id.clone(),
                row.status.name().to_owned(),
                text(row.best_sample.as_deref()),
                text(row.verdict),
                row.warnings.to_string(),
            ];
            let risk = self.look_first.of(&row.participant_id);
            let place = risk.map(|(place, subject)| [place.to_string(), subject.because()]);
            let place = place.unwrap_or_else(|| ["n/a", "n/a"].map(str::to_owned));
            let measures: Vec<String> =
                measured.iter().map(|column| cell(risk.and_then(|(_, subject)| subject.figures.get(column)))).collect();
            lines.push([&first[..], &numbers(&row.figures), &place, &measures].concat());
        }
        lines.iter().map(|line| line.join("\t") + "\n").collect()
    }
}

/// One subject's line; names of columns that are new are added to the end.
fn row(member: &Member, columns: &mut Vec<String>) -> Row {
    let mut figures = BTreeMap::new();
    let mut add = |name: String, value: Option<f64>| {
        let Some(value) = value else { return };
        if !columns.contains(&name) {
            columns.push(name.clone());
        }
        figures.insert(name, value);
    };
    if let Some(outcome) = &member.outcome {
        let (best, judged) = (outcome.best(), outcome.judged());
        // A stiffness that is not claimed takes no part in a cohort's.
        let claimed = outcome.verdict.finding.has_stiffness();
        for (tissue, _) in outcome.verdict.moduli.iter().filter(|(_, claim)| *claim != Claim::Withheld) {
            let level = best.and_then(|sample| sample.sd_levels.get(tissue).copied());
            add(format!("{tissue}_sd_level"), level.filter(|_| claimed));
        }
        // Where only the levels end, nothing is said of the modulus.
        let open = |of: &String, side: bool| {
            outcome.verdict.reasons.iter().any(|reason| {
                matches!(reason, Reason::EndOfTried { tissue, stiffest, .. } if tissue == of && *stiffest == side)
            })
        };
        for (tissue, claim) in &outcome.verdict.moduli {
            match claim {
                Claim::Interval { mode_pa, .. } => add(format!("{tissue}_shear_modulus_pa"), Some(*mode_pa)),
                Claim::Above { bound_pa } => add(format!("{tissue}_shear_modulus_above_pa"), Some(*bound_pa)),
                Claim::Range { range_pa: [low, high] } if low == high => {
                    add(format!("{tissue}_shear_modulus_pa"), Some(*low));
                }
                Claim::Range { range_pa: [low, high] } => {
                    add(format!("{tissue}_shear_modulus_low_pa"), Some(*low).filter(|_| !open(tissue, false)));
                    add(format!("{tissue}_shear_modulus_high_pa"), Some(*high).filter(|_| !open(tissue, true)));
                }
                Claim::Withheld => {}
            }
        }
        for posterior in outcome.estimate.iter().map(|e| &e.posterior).filter(|_| claimed) {
            for (name, [low, high]) in posterior.names.iter().zip(&posterior.interval_95) {
                let name = name.replace(' ', "_");
                add(format!("{name}_95_low"), Some(*low));
                add(format!("{name}_95_high"), Some(*high));
            }
        }
        for set in outcome.rmse_sets() {
            add(format!("rest_rmse_{set}_mm"), outcome.rest_rmse_mm.get(&set).copied());
            add(format!("rmse_{set}_mm"), judged.and_then(|sample| sample.rmse_mm.get(&set).copied()));
            add(format!("rest_surface_distance_{set}_mm"), outcome.rest_surface_distance_mm.get(&set).copied());
            let distance = judged.and_then(|sample| sample.surface_distance_mm.get(&set).copied());
            add(format!("surface_distance_{set}_mm"), distance);
        }
        let floor = outcome.noise_floor.unwrap_or_default();
        add("noise_floor_mm".to_owned(), floor.combined_mm());
        let volumes = outcome.volumes.unwrap_or_default();
        add("resected_cc".to_owned(), volumes.resected_cc);
        add("cavity_cc".to_owned(), volumes.cavity_cc);
        add("ventricle_before_cc".to_owned(), volumes.ventricle_before_cc);
        add("ventricle_after_cc".to_owned(), volumes.ventricle_after_cc);
        let change = |(before, after): (f64, f64)| 100.0 * (after / before - 1.0);
        let change = volumes.ventricle_before_cc.zip(volumes.ventricle_after_cc).map(change);
        add("ventricle_change_percent".to_owned(), change.filter(|percent| percent.is_finite()));
        add("midline_shift_mm".to_owned(), volumes.midline_shift_mm);
        add("brain_cc".to_owned(), volumes.brain_cc);
        add("displacement_max_mm".to_owned(), judged.and_then(|sample| sample.displacement_max_mm));
    }
    Row {
        participant_id: member.participant_id.clone(),
        status: member.status.clone(),
        message: member.message.clone(),
        has_page: member.has_page,
        best_sample: member.outcome.as_ref().and_then(|o| o.best_sample.clone()),
        verdict: member.outcome.as_ref().map(|o| o.verdict.finding.short()),
        sentence: member.outcome.as_ref().map(|o| o.verdict.sentence.clone()),
        warnings: member.outcome.as_ref().map_or(0, |o| o.warnings.len()),
        figures,
        outlying: Vec::new(),
        distance: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::SampleOutcome;

    fn member(name: &str, status: Status, rmse_mm: Option<f64>) -> Member {
        let sample = |id: &str, pa: f64, rmse: f64| SampleOutcome {
            id: id.to_owned(),
            shear_modulus_pa: BTreeMap::from([("brain".to_owned(), pa)]),
            rmse_mm: BTreeMap::from([("margin".to_owned(), rmse)]),
            converged: true,
            ..SampleOutcome::default()
        };
        let outcome = rmse_mm.map(|rmse| ExperimentOutcome {
            tissues: vec!["brain".to_owned()],
            samples: vec![
                sample("softest", 250.0, rmse + 9.0),
                sample("sample-00", 500.0, rmse),
                sample("stiffest", 1000.0, rmse + 9.0),
            ],
            best_sample: Some("sample-00".to_owned()),
            rest_rmse_mm: BTreeMap::from([("margin".to_owned(), 3.0)]),
            ..ExperimentOutcome::default()
        });
        let outcome = outcome.map(ExperimentOutcome::with_verdict);
        let message = (status == Status::Failed).then(|| "no brain".to_owned());
        Member { participant_id: name.to_owned(), status, message, has_page: true, outcome, settings_sha256: None }
    }

    fn cohort() -> Cohort {
        let mut members: Vec<Member> = [1.0, 1.1, 9.0, 1.2, 0.9]
            .into_iter()
            .enumerate()
            .map(|(n, rmse)| member(&format!("sub-{n}"), Status::Done, Some(rmse)))
            .collect();
        members.push(member("sub-x", Status::Failed, None));
        Cohort::new(&members)
    }

    #[test]
    fn who_failed_comes_first_then_who_lies_apart() {
        let cohort = cohort();
        let order: Vec<&str> = cohort.subjects.iter().map(|row| row.participant_id.as_str()).collect();
        // sub-3 and sub-0 are as far from 1.1 mm: by name.
        assert_eq!(order, ["sub-x", "sub-2", "sub-4", "sub-0", "sub-3", "sub-1"]);
        assert_eq!(cohort.subjects[1].outlying, ["rmse_margin_mm"]);
        assert!(cohort.subjects[2..].iter().all(|row| row.outlying.is_empty()));
    }

    #[test]
    fn median_and_spread_are_of_those_who_have_a_figure() {
        let cohort = cohort();
        assert_eq!(cohort.median["rmse_margin_mm"], 1.1);
        assert!((cohort.mad["rmse_margin_mm"] - 0.1).abs() < 1e-12);
        // Equal values have no spread, and nobody lies apart in them.
        assert_eq!((cohort.median["brain_shear_modulus_pa"], cohort.mad["brain_shear_modulus_pa"]), (500.0, 0.0));
    }

    #[test]
    fn who_was_refused_by_the_gate_is_shown_and_moves_nobody_elses_figures() {
        let well: Vec<Member> = [1.0, 1.1, 1.2, 9.0]
            .into_iter()
            .enumerate()
            .map(|(n, rmse)| member(&format!("sub-{n}"), Status::Done, Some(rmse)))
            .collect();
        let refused = ["sub-x", "sub-y", "sub-z"].map(|name| member(name, Status::QualityGate, Some(50.0)));
        let (alone, all) = (Cohort::new(&well), Cohort::new(&[&refused[..], &well].concat()));
        assert_eq!((&alone.median, &alone.mad), (&all.median, &all.mad));
        assert_eq!((&alone.median_samples, &alone.tasks), (&all.median_samples, &all.tasks));
        let (shown, rest) = all.subjects.split_at(3);
        assert_eq!(rest, alone.subjects);
        for row in shown {
            assert!(row.figures["rmse_margin_mm"] == 50.0 && row.outlying.is_empty() && row.distance == 0.0, "{row:?}");
        }
    }

    #[test]
    fn an_end_of_what_was_tried_is_no_column_of_the_modulus() {
        let columns = |tried: std::ops::Range<usize>| {
            let mut outcome = member("sub-1", Status::Done, Some(1.0)).outcome.unwrap();
            outcome.samples = outcome.samples[tried].to_vec();
            // As good as the best are the two of them that are kept.
            outcome.samples.iter_mut().for_each(|s| _ = s.rmse_mm.insert("margin".to_owned(), 1.0));
            let outcome = Some(outcome.with_verdict());
            let cohort = Cohort::new(&[Member { outcome, ..member("sub-1", Status::Done, None) }]);
            cohort.columns.into_iter().filter(|name| name.starts_with("brain_")).collect::<Vec<_>>()
        };
        assert_eq!(columns(0..2), [""; 0], "softest and stiffest of what was tried");
        assert_eq!(columns(1..2), [""; 0], "of one modulus nothing is claimed");
    }

    #[test]
    fn the_table_has_a_cell_for_every_column_of_every_line() {
        let text = cohort().to_tsv();
        let cells: Vec<usize> = text.lines().map(|line| line.split('\t').count()).collect();
        assert!(cells.len() == 7 && cells.iter().all(|n| *n == cells[0]), "{cells:?}");
        assert!(text.contains("sub-x\tfailed\tn/a"));
    }

    #[test]
    fn every_line_of_the_table_is_a_subject_and_none_has_a_stiffness_that_is_not_claimed() {
        let cohort = cohort();
        let text = cohort.to_tsv();
        assert!(text.lines().skip(1).all(|line| line.starts_with("sub-")), "{text}");
        let worse = cohort.subjects.iter().find(|row| row.participant_id == "sub-2").unwrap();
        assert_eq!(worse.verdict, Some("worse than rest"));
        assert!(!worse.figures.contains_key("brain_shear_modulus_pa"));
    }

    #[test]
    fn different_settings_are_warned_of() {
        let settings = |name: &str, sum: &str| Member {
            settings_sha256: Some(sum.to_owned()),
            ..member(name, Status::Done, Some(1.0))
        };
        assert!(Cohort::new(&[settings("sub-1", "a"), settings("sub-2", "a")]).warnings.is_empty());
        assert!(
            Cohort::new(&[settings("sub-1", "a"), settings("sub-2", "b")]).warnings[0]
                .to_string()
                .contains("2 different")
        );
    }
}

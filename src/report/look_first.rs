//! Scans to look at first: a cohort's subjects by risk.

use super::member::{Member, Status};
use super::scan_measure::{Good, SCAN_MEASURES, ScanMeasure, WhichScan};
use crate::experiment::rmse::median_and_mad;
use schemars::JsonSchema;
use serde::Serialize;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// How the order comes about, in a sentence.
const RULE: &str = "First those that were refused, then those with warnings, then the others; among each of these by the measure \
    that lies farthest on its bad side of the median of those that are done, in robust deviations (1.483 times the median absolute deviation, \
    but never less than the step that matters for that measure).";
/// A Gaussian's standard deviation over its median absolute deviation.
const DEVIATION_OVER_MAD: f64 = 1.482_602_218_505_602;

/// Why a subject stands where it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Risk {
    /// It did not end well.
    Refused,
    /// It ended well, with warnings.
    Warned,
    /// Its measures alone.
    Measured,
}

/// A measure over the cohort.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CohortMeasure {
    /// Name of the column: `pre_contrast_to_noise`.
    pub column: String,
    /// The good side.
    pub good: Good,
    /// Subjects that have it.
    pub subjects: usize,
    /// Their median, in the unit of the column's name.
    pub median: f64,
    /// What distances are told in, in the same unit.
    pub deviation: f64,
}

/// The measure that lies farthest on its bad side.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct WorstMeasure {
    /// Name of the column: `pre_contrast_to_noise`.
    pub column: String,
    /// Its value.
    pub value: f64,
    /// Distance from the median towards the bad side, in robust deviations.
    pub distance: f64,
}

/// A subject's line.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SubjectRisk {
    /// `sub-01`.
    pub participant_id: String,
    /// What comes first.
    pub risk: Risk,
    /// How it ended.
    pub status: Status,
    /// Warnings on its page.
    pub warnings: usize,
    /// The measure that put it here; absent where none lies on its bad side.
    pub worst: Option<WorstMeasure>,
    /// Whether its scans were measured; cases of before that were not.
    pub measured: bool,
    /// Its measures by the name of their column.
    pub figures: BTreeMap<String, f64>,
}

/// The subjects that have been run, by risk.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LookFirst {
    /// How the order comes about.
    pub rule: &'static str,
    /// What was measured, in order of the columns.
    pub measures: Vec<CohortMeasure>,
    /// Those to look at first, first.
    pub subjects: Vec<SubjectRisk>,
}

/// Every measure of either scan.
pub fn scan_measures() -> impl Iterator<Item = (WhichScan, &'static ScanMeasure)> {
    WhichScan::ALL.into_iter().flat_map(|scan| SCAN_MEASURES.iter().map(move |measure| (scan, measure)))
}

impl LookFirst {
    /// The order of these subjects.
    pub fn new(members: &[Member]) -> Self {
        let run = members.iter().filter(|member| member.status != Status::Missing);
        let mut subjects: Vec<SubjectRisk> = run.map(subject).collect();
        let measures: Vec<CohortMeasure> = scan_measures().filter_map(|which| over(which, &subjects)).collect();
        for subject in &mut subjects {
            subject.worst = worst(&subject.figures, &measures);
        }
        let distance = |subject: &SubjectRisk| subject.worst.as_ref().map_or(0.0, |worst| worst.distance);
        subjects.sort_by(|a, b| {
            let order = a.risk.cmp(&b.risk).then_with(|| distance(b).total_cmp(&distance(a)));
            order.then_with(|| a.participant_id.cmp(&b.participant_id))
        });
        Self { rule: RULE, measures, subjects }
    }

    /// A subject's place, from 1, and its line.
    pub fn of(&self, participant_id: &str) -> Option<(usize, &SubjectRisk)> {
        let place = self.subjects.iter().position(|subject| subject.participant_id == participant_id)?;
        Some((place + 1, &self.subjects[place]))
    }
}

impl SubjectRisk {
    /// What put it where it is, in words.
    pub fn because(&self) -> String {
        let first = match (self.risk, self.warnings) {
            (Risk::Refused, _) => Some(self.status.name().to_owned()),
            (Risk::Warned, 1) => Some("1 warning".to_owned()),
            (Risk::Warned, n) => Some(format!("{n} warnings")),
            (Risk::Measured, _) => None,
        };
        let measure = match &self.worst {
            Some(worst) => worst.in_words(),
            None if self.measured => Some("no measure on its bad side".to_owned()),
            None => Some("not measured".to_owned()),
        };
        first.into_iter().chain(measure).collect::<Vec<String>>().join("; ")
    }
}

impl WorstMeasure {
    fn in_words(&self) -> Option<String> {
        let (scan, measure) = scan_measures().find(|(scan, measure)| measure.column_of(*scan) == self.column)?;
        let side = if measure.good == Good::High { "low" } else { "high" };
        let (value, far) = (measure.with_unit(self.value), super::html::fixed(self.distance, 1));
        Some(format!("{} {} is {side} ({value}, {far} deviations)", measure.name, scan.in_words()))
    }
}

fn subject(member: &Member) -> SubjectRisk {
    let outcome = member.outcome.as_ref();
    let scans = outcome.and_then(|outcome| outcome.scans.as_ref());
    let figure = |(scan, measure): (WhichScan, &ScanMeasure)| {
        Some((measure.column_of(scan), (measure.of)(scan.of(scans)?).filter(|value| value.is_finite())?))
    };
    let warnings = outcome.map_or(0, |outcome| outcome.warnings.len());
    let risk = match (&member.status, warnings) {
        (Status::Done, 0) => Risk::Measured,
        (Status::Done, _) => Risk::Warned,
        _ => Risk::Refused,
    };
    SubjectRisk {
        participant_id: member.participant_id.clone(),
        risk,
        status: member.status.clone(),
        warnings,
        worst: None,
        measured: scans.is_some(),
        figures: scan_measures().filter_map(figure).collect(),
    }
}

/// Median and deviation over the subjects that are done and have the measure: what was refused, often for its scans, says
/// nothing of what is usual. Where none is done, over all.
fn over((scan, measure): (WhichScan, &ScanMeasure), subjects: &[SubjectRisk]) -> Option<CohortMeasure> {
    let column = measure.column_of(scan);
    let none_done = subjects.iter().all(|subject| subject.risk == Risk::Refused);
    let usual = subjects.iter().filter(|subject| none_done || subject.risk != Risk::Refused);
    let values: Vec<f64> = usual.filter_map(|subject| subject.figures.get(&column)).copied().collect();
    let (median, mad) = median_and_mad(&values)?;
    let deviation = (DEVIATION_OVER_MAD * mad).max(measure.step);
    Some(CohortMeasure { column, good: measure.good, subjects: values.len(), median, deviation })
}

/// The measure farthest on its bad side; the first of equals.
fn worst(figures: &BTreeMap<String, f64>, measures: &[CohortMeasure]) -> Option<WorstMeasure> {
    let far = |measure: &CohortMeasure| {
        let value = *figures.get(&measure.column)?;
        let above = (value - measure.median) / measure.deviation;
        let distance = if measure.good == Good::High { -above } else { above };
        (distance > 0.0).then(|| WorstMeasure { column: measure.column.clone(), value, distance })
    };
    let all = measures.iter().filter_map(far).enumerate();
    all.max_by(|(n, a), (m, b)| a.distance.total_cmp(&b.distance).then(Reverse(n).cmp(&Reverse(m))))
        .map(|(_, worst)| worst)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::ExperimentOutcome;
    use crate::segment::{Air, ScanQualities, ScanQuality};

    fn scan(contrast_to_noise: f64) -> ScanQuality {
        ScanQuality {
            contrast_to_noise: Some(contrast_to_noise),
            white_signal_to_noise: Some(15.0),
            entropy_focus: None,
            air_artefact_percent: None,
            air: Air::Blank,
            coverage_percent: 100.0,
            gain_times: Some(1.2),
            voxel_mm: [1.0; 3],
            anisotropy: 1.0,
            template_correlation: Some(0.7),
            regions: Vec::new(),
        }
    }

    fn member(name: &str, scans: Option<ScanQualities>) -> Member {
        let outcome = Some(ExperimentOutcome { scans, ..ExperimentOutcome::default() });
        let participant_id = name.to_owned();
        Member { participant_id, status: Status::Done, message: None, has_page: true, outcome, settings_sha256: None }
    }

    fn measured(name: &str, contrast_to_noise: f64) -> Member {
        member(name, Some(ScanQualities { pre: Some(scan(3.0)), post: Some(scan(contrast_to_noise)) }))
    }

    fn order(found: &LookFirst) -> Vec<&str> {
        found.subjects.iter().map(|subject| subject.participant_id.as_str()).collect()
    }

    #[test]
    fn the_noisy_one_of_five_comes_first_and_the_measure_is_named() {
        let members = [("sub-1", 3.1), ("sub-2", 3.0), ("sub-3", 1.2), ("sub-4", 3.2), ("sub-5", 2.9)];
        let found = LookFirst::new(&members.map(|(name, cnr)| measured(name, cnr)));
        assert_eq!(order(&found)[0], "sub-3");
        let worst = found.subjects[0].worst.as_ref().unwrap();
        assert_eq!((worst.column.as_str(), worst.value), ("post_contrast_to_noise", 1.2));
        let said = found.subjects[0].because();
        assert!(said.starts_with("contrast to noise after surgery is low (1.20, "), "{said}");
        // The best of all lies on no bad side.
        let best = found.of("sub-4").unwrap().1;
        assert_eq!((&best.worst, best.because().as_str()), (&None, "no measure on its bad side"));
    }

    #[test]
    fn a_cohort_of_nearly_equal_scans_is_not_ranked_by_rounding() {
        let found = LookFirst::new(&[0.0, 1e-6, 2e-6, 3e-6, 9e-5].map(|x| measured("sub-1", 3.0 - x)));
        let farthest = found.subjects[0].worst.as_ref().unwrap().distance;
        assert!(farthest < 1e-3, "{farthest}");
    }

    #[test]
    fn who_was_refused_comes_before_who_was_warned_of_and_both_before_what_is_measured() {
        let mut refused = measured("sub-9", 3.0);
        refused.status = Status::QualityGate;
        let mut failed = member("sub-8", None);
        (failed.status, failed.outcome) = (Status::Failed, None);
        let mut warned = measured("sub-7", 3.0);
        warned.outcome.as_mut().unwrap().warnings.push("pre: odd".to_owned());
        let mut missing = member("sub-0", None);
        (missing.status, missing.outcome) = (Status::Missing, None);
        let found = LookFirst::new(&[measured("sub-1", 0.5), warned, refused, failed, missing, measured("sub-2", 3.0)]);
        // Nobody has looked at the scans of who was not run.
        assert_eq!(order(&found), ["sub-8", "sub-9", "sub-7", "sub-1", "sub-2"]);
        assert_eq!(found.subjects[0].because(), "failed; not measured");
        assert_eq!(found.subjects[2].because(), "1 warning; no measure on its bad side");
    }

    #[test]
    fn what_was_refused_does_not_say_what_is_usual() {
        let refused = |name| Member { status: Status::QualityGate, ..measured(name, 0.5) };
        let of = |refusals: &[Member]| {
            let done = [("sub-1", 3.0), ("sub-2", 3.2), ("sub-3", 1.8)].map(|(name, cnr)| measured(name, cnr));
            let found = LookFirst::new(&[&done[..], refusals].concat());
            found.measures.into_iter().find(|measure| measure.column == "post_contrast_to_noise").unwrap()
        };
        assert_eq!(of(&["sub-4", "sub-5", "sub-6"].map(refused)), of(&[]));
        // Among refused ones alone they are compared with each other.
        assert_eq!(LookFirst::new(&["sub-4", "sub-5"].map(refused)).measures[0].subjects, 2);
    }

    #[test]
    fn one_two_and_none_measured_are_cohorts_too() {
        let alone = LookFirst::new(&[measured("sub-1", 3.0)]);
        assert_eq!(alone.subjects[0].worst, None);
        let two = LookFirst::new(&[measured("sub-1", 3.0), measured("sub-2", 2.0)]);
        assert_eq!(order(&two), ["sub-2", "sub-1"]);
        let before = LookFirst::new(&[member("sub-1", None), measured("sub-2", 3.0)]);
        assert_eq!(before.of("sub-1").unwrap().1.because(), "not measured");
        assert_eq!(before.measures[0].subjects, 1);
        assert!(LookFirst::new(&[member("sub-1", None)]).measures.is_empty());
    }
}

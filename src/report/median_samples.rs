//! The samples of a sweep over the subjects of a cohort: what each modulus explains in the median patient.

use crate::experiment::outcome::{ExperimentOutcome, SampleOutcome};
use crate::experiment::rmse::median_and_mad;
use crate::experiment::sweep::best_sample;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// A sample of the sweep over the subjects.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MedianSample {
    /// Name of the sample: `sample-05`.
    pub id: String,
    /// Its task, where several are compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// How many standard deviations of the prior each tissue lies from its mean.
    pub sd_levels: BTreeMap<String, f64>,
    /// Shear modulus at rest per tissue, Pa.
    pub shear_modulus_pa: BTreeMap<String, f64>,
    /// Subjects in which it converged.
    pub subjects: usize,
    /// Median over them of the RMSE per node set, mm.
    pub median_rmse_mm: BTreeMap<String, f64>,
    /// Median absolute deviation from it (not scaled), mm.
    pub mad_rmse_mm: BTreeMap<String, f64>,
}

/// The samples that all these subjects have: none where they differ (estimates, other tissues, another prior).
pub fn median_samples(outcomes: &[&ExperimentOutcome]) -> Vec<MedianSample> {
    let Some((first, others)) = outcomes.split_first() else { return Vec::new() };
    let design = |o: &ExperimentOutcome| -> Vec<_> {
        o.samples.iter().map(|s| (s.id.clone(), s.task.clone(), s.shear_modulus_pa.clone())).collect()
    };
    let common = design(first);
    if common.len() < 2 || others.iter().any(|o| design(o) != common) {
        return Vec::new();
    }
    (0..common.len()).map(|n| median_sample(&outcomes.iter().map(|o| &o.samples[n]).collect::<Vec<_>>())).collect()
}

fn median_sample(of_subjects: &[&SampleOutcome]) -> MedianSample {
    let first = of_subjects[0];
    let mut sample = MedianSample {
        id: first.id.clone(),
        task: first.task.clone(),
        sd_levels: first.sd_levels.clone(),
        shear_modulus_pa: first.shear_modulus_pa.clone(),
        subjects: of_subjects.iter().filter(|s| s.converged).count(),
        median_rmse_mm: BTreeMap::new(),
        mad_rmse_mm: BTreeMap::new(),
    };
    let mut by_set: BTreeMap<&String, Vec<f64>> = BTreeMap::new();
    for (set, mm) in of_subjects.iter().flat_map(|s| &s.rmse_mm) {
        by_set.entry(set).or_default().push(*mm);
    }
    for (set, values) in by_set {
        if let Some((median, mad)) = median_and_mad(&values) {
            sample.median_rmse_mm.insert(set.clone(), median);
            sample.mad_rmse_mm.insert(set.clone(), mad);
        }
    }
    sample
}

/// The median patient as an outcome, so that a cohort's curves are drawn as a patient's are.
pub fn as_outcome(samples: &[MedianSample], tissues: &[String]) -> ExperimentOutcome {
    let one = |s: &MedianSample| SampleOutcome {
        id: s.id.clone(),
        task: s.task.clone(),
        sd_levels: s.sd_levels.clone(),
        shear_modulus_pa: s.shear_modulus_pa.clone(),
        rmse_mm: s.median_rmse_mm.clone(),
        converged: s.subjects > 0,
        ..SampleOutcome::default()
    };
    let samples: Vec<SampleOutcome> = samples.iter().map(one).collect();
    let best_sample = best_sample(&samples, "margin").map(|s| s.id.clone());
    ExperimentOutcome { tissues: tissues.to_vec(), samples, best_sample, ..ExperimentOutcome::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(rmse_mm: [f64; 2], modulus_pa: f64) -> ExperimentOutcome {
        let sample = |n: usize| SampleOutcome {
            id: format!("sample-{n:02}"),
            shear_modulus_pa: BTreeMap::from([("brain".to_owned(), modulus_pa * (1.0 + n as f64))]),
            rmse_mm: BTreeMap::from([("margin".to_owned(), rmse_mm[n])]),
            converged: true,
            ..SampleOutcome::default()
        };
        ExperimentOutcome { samples: vec![sample(0), sample(1)], ..ExperimentOutcome::default() }
    }

    #[test]
    fn the_median_is_taken_sample_by_sample() {
        let [a, b, c] = [[1.0, 5.0], [2.0, 4.0], [9.0, 3.0]].map(|rmse| outcome(rmse, 500.0));
        let samples = median_samples(&[&a, &b, &c]);
        assert_eq!(samples.iter().map(|s| s.median_rmse_mm["margin"]).collect::<Vec<_>>(), [2.0, 4.0]);
        assert_eq!(samples.iter().map(|s| s.mad_rmse_mm["margin"]).collect::<Vec<_>>(), [1.0, 1.0]);
        assert!(samples.iter().all(|s| s.subjects == 3));
    }

    #[test]
    fn subjects_with_other_samples_have_no_median_sample() {
        let (a, b) = (outcome([1.0, 2.0], 500.0), outcome([1.0, 2.0], 600.0));
        assert!(median_samples(&[&a, &b]).is_empty());
        assert!(median_samples(&[]).is_empty());
    }
}

//! The verdict of an outcome: its estimate's, else that of its samples against rest.

use super::outcome::{Answer, ExperimentKind, ExperimentOutcome, SampleOutcome};
use super::phantom::REFERENCE;
use super::verdict::{Claim, Finding, Reason, Verdict};

impl ExperimentOutcome {
    /// With its verdict, once all else is there.
    #[must_use]
    pub fn with_verdict(mut self) -> Self {
        self.verdict = self.estimate.as_ref().map_or_else(|| of_samples(&self), |e| e.verdict.clone());
        if self.verdict.finding == Finding::NoShift {
            // Every sample fits noise as well as any other.
            self.best_sample = None;
            // A file of an earlier version has 0 % of nothing.
            self.verdict.explained_share = None;
        }
        self
    }
}

impl Answer {
    /// What two scans say by themselves.
    pub fn verdict(self) -> Verdict {
        let finding = match self {
            Self::NoOperation => Finding::NoOperation,
            Self::NotOnePerson => Finding::NotOnePerson,
        };
        Verdict::new(finding, None, Vec::new(), Vec::new())
    }
}

/// The best sample against rest, and which moduli cannot be told from its own; or why there is none.
fn of_samples(outcome: &ExperimentOutcome) -> Verdict {
    let without = |finding, reasons| Verdict::new(finding, None, Vec::new(), reasons);
    if let Some(answer) = outcome.answer {
        return answer.verdict();
    }
    if outcome.kind == ExperimentKind::Prediction {
        return without(Finding::Predicted, Vec::new());
    }
    let (of, samples) = (outcome.samples.len(), outcome.samples.iter().filter(|s| !s.converged).count());
    let failed = (samples > 0).then_some(Reason::WithoutEquilibrium { samples, of });
    let Some(best) = outcome.best() else {
        let finding = if failed.is_some() { Finding::NoEquilibrium } else { Finding::Nothing };
        return without(finding, failed.into_iter().collect());
    };
    let floor = outcome.noise_floor.unwrap_or_default();
    let set = if best.rmse_mm.contains_key("margin") { "margin" } else { "all" };
    let Some(&deformed_mm) = best.rmse_mm.get(set) else {
        return without(Finding::NoEquilibrium, failed.into_iter().collect());
    };
    let floor_mm = floor.combined_mm().unwrap_or(0.0);
    let moduli = as_good(outcome, set, deformed_mm + floor_mm);
    if let Some(nearest) = nearest_to_reference(outcome).filter(|_| outcome.kind == ExperimentKind::Phantom) {
        let mut reasons = out_of_reach(outcome);
        let found = nearest.id == best.id && reasons.is_empty();
        reasons.push(Reason::Phantom { best: best.id.clone(), nearest: nearest.id.clone() });
        reasons.extend(failed);
        let finding = if found { Finding::Recovered } else { Finding::NotRecovered };
        return Verdict::new(finding, None, moduli, reasons);
    }
    let (moduli, limits) = within_tried(outcome, moduli);
    let Some(&rest_mm) = outcome.rest_rmse_mm.get(set) else {
        // Without rest to be compared with, the samples are compared with each other.
        return Verdict::new(Finding::Better, None, moduli, limits.into_iter().chain(failed).collect());
    };
    let finding = Finding::against_rest(rest_mm, deformed_mm, floor_mm);
    let mut reasons = vec![Reason::Surface { set: set.to_owned(), rest_mm, deformed_mm, floor_mm }];
    for (tissue, answer) in &moduli {
        if let Claim::Range { range_pa } = answer {
            reasons.push(Reason::AsGood { tissue: tissue.clone(), pa: *range_pa });
        }
    }
    // What is no better than rest says nothing of the stiffness.
    reasons.extend(limits.into_iter().filter(|_| finding == Finding::Better));
    reasons.extend(failed);
    let moduli = if finding == Finding::Better { moduli } else { Vec::new() };
    Verdict::new(finding, None, moduli, reasons)
}

/// The sample of the prior whose moduli are nearest to a phantom's own, by the summed squares of the log-ratios.
pub fn nearest_to_reference(outcome: &ExperimentOutcome) -> Option<&SampleOutcome> {
    let distance = |s: &SampleOutcome| -> f64 {
        let truth = outcome.reference_shear_modulus_pa.iter();
        truth.filter_map(|(name, pa)| Some((s.shear_modulus_pa.get(name)? / pa).ln().powi(2))).sum()
    };
    let of_prior =
        outcome.samples.iter().filter(|s| s.id != REFERENCE && !outcome.reference_shear_modulus_pa.is_empty());
    of_prior.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// A phantom's moduli beyond all of its samples': of those the nearest is the best one, and finds nothing again.
fn out_of_reach(outcome: &ExperimentOutcome) -> Vec<Reason> {
    let own = outcome.reference_shear_modulus_pa.iter().map(|(tissue, pa)| (tissue, *pa, tried(outcome, tissue)));
    let beyond = own.filter(|(_, pa, [low, high])| low <= high && !(low..=high).contains(&pa));
    beyond.map(|(tissue, own_pa, tried_pa)| Reason::OutOfReach { tissue: tissue.clone(), own_pa, tried_pa }).collect()
}

/// From the softest to the stiffest modulus of a tissue that was tried, of the samples with an equilibrium.
fn tried(outcome: &ExperimentOutcome, tissue: &str) -> [f64; 2] {
    let samples = outcome.samples.iter().filter(|s| s.id != REFERENCE && s.converged);
    let moduli = samples.filter_map(|s| s.shear_modulus_pa.get(tissue).copied());
    moduli.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], m| [low.min(m), high.max(m)])
}

/// What may be claimed of ranges, and where they end only because nothing beyond was tried: one modulus alone is the prior's,
/// however well it does, and an end of what was tried is no bound that the scans give.
fn within_tried(outcome: &ExperimentOutcome, moduli: Vec<(String, Claim)>) -> (Vec<(String, Claim)>, Vec<Reason>) {
    /// Moduli that differ by less, relative to themselves, are one.
    const SAME: f64 = 1e-9;
    let mut limits = Vec::new();
    let mut claim = |(tissue, claim): (String, Claim)| {
        let Claim::Range { range_pa: [low, high] } = claim else { return (tissue, claim) };
        let [softest, stiffest] = tried(outcome, &tissue);
        if stiffest - softest <= SAME * stiffest {
            limits.push(Reason::OneTried { tissue: tissue.clone(), tried_pa: softest });
            return (tissue, Claim::Withheld);
        }
        if low <= softest * (1.0 + SAME) {
            limits.push(Reason::EndOfTried { tissue: tissue.clone(), tried_pa: softest, stiffest: false });
        }
        if high >= stiffest * (1.0 - SAME) {
            limits.push(Reason::EndOfTried { tissue: tissue.clone(), tried_pa: stiffest, stiffest: true });
        }
        (tissue, claim)
    };
    let moduli = moduli.into_iter().map(&mut claim).collect();
    (moduli, limits)
}

/// The range of moduli of the samples whose error at `set` is not above `limit_mm`, tissue by tissue.
fn as_good(outcome: &ExperimentOutcome, set: &str, limit_mm: f64) -> Vec<(String, Claim)> {
    let near = |s: &&SampleOutcome| s.id != REFERENCE && s.rmse_mm.get(set).is_some_and(|rmse| *rmse <= limit_mm);
    let near: Vec<&SampleOutcome> = outcome.samples.iter().filter(near).collect();
    let range = |tissue: &String| {
        let moduli = near.iter().filter_map(|s| s.shear_modulus_pa.get(tissue).copied());
        let (low, high) = moduli.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), m| (l.min(m), h.max(m)));
        (low <= high).then(|| (tissue.clone(), Claim::Range { range_pa: [low, high] }))
    };
    outcome.tissues.iter().filter_map(range).collect()
}

#[cfg(test)]
mod tests {
    use super::super::outcome::NoiseFloor;
    use super::*;
    use std::collections::BTreeMap;

    fn swept(rest: f64, samples: &[(f64, f64)]) -> ExperimentOutcome {
        let sample = |(n, (modulus, rmse)): (usize, &(f64, f64))| SampleOutcome {
            id: format!("sample-{n:02}"),
            shear_modulus_pa: BTreeMap::from([("brain".to_owned(), *modulus)]),
            rmse_mm: BTreeMap::from([("margin".to_owned(), *rmse)]),
            converged: true,
            ..SampleOutcome::default()
        };
        ExperimentOutcome {
            tissues: vec!["brain".to_owned()],
            samples: samples.iter().enumerate().map(sample).collect(),
            best_sample: Some("sample-01".to_owned()),
            rest_rmse_mm: BTreeMap::from([("margin".to_owned(), rest)]),
            noise_floor: Some(NoiseFloor { voxel_mm: Some(0.3), ..NoiseFloor::default() }),
            ..ExperimentOutcome::default()
        }
    }

    #[test]
    fn samples_that_cannot_be_told_apart_give_their_range_and_not_the_best_one() {
        let verdict = of_samples(&swept(3.0, &[(300.0, 1.2), (500.0, 1.0), (900.0, 1.25), (2000.0, 2.0)]));
        assert_eq!(verdict.finding, Finding::Better);
        assert_eq!(verdict.moduli, [("brain".to_owned(), Claim::Range { range_pa: [300.0, 900.0] })]);
        assert!(verdict.sentence.contains("300 to 900 Pa"), "{}", verdict.sentence);
        let still = of_samples(&swept(1.1, &[(300.0, 1.2), (500.0, 1.0)]));
        assert_eq!(still.finding, Finding::NotDistinguishable);
        assert!(still.sentence.contains("No stiffness"), "{}", still.sentence);
        assert_eq!(of_samples(&swept(0.5, &[(300.0, 1.2), (500.0, 1.0)])).finding, Finding::Worse);
    }

    #[test]
    fn an_end_of_what_was_tried_is_told_and_one_modulus_alone_is_no_answer() {
        let reasons = |samples: &[(f64, f64)]| of_samples(&swept(3.0, samples)).reasons;
        let ends = |reasons: &[Reason]| {
            let has = |end: bool| {
                reasons.iter().any(|r| matches!(r, Reason::EndOfTried { stiffest, .. } if *stiffest == end))
            };
            [has(false), has(true)]
        };
        assert_eq!(ends(&reasons(&[(200.0, 2.5), (500.0, 1.0), (900.0, 1.2), (2000.0, 2.5)])), [false, false]);
        assert_eq!(ends(&reasons(&[(200.0, 1.1), (500.0, 1.0), (900.0, 1.2), (2000.0, 2.5)])), [true, false]);
        let all = of_samples(&swept(3.0, &[(525.0, 1.1), (1000.0, 1.0), (2299.0, 1.2)]));
        assert_eq!(ends(&all.reasons), [true, true]);
        assert_eq!(all.moduli, [("brain".to_owned(), Claim::Range { range_pa: [525.0, 2299.0] })]);
        assert!(all.sentence.contains("softer ones were not tried"), "{}", all.sentence);
        assert!(all.sentence.contains("stiffer ones were not tried"), "{}", all.sentence);
        let mut alone = swept(3.0, &[(1100.0, 1.0)]);
        alone.best_sample = Some("sample-00".to_owned());
        let alone = of_samples(&alone);
        assert_eq!(alone.finding, Finding::Better);
        assert_eq!(alone.moduli, [("brain".to_owned(), Claim::Withheld)]);
        assert!(alone.sentence.contains("no modulus but 1,100 Pa was tried"), "{}", alone.sentence);
    }

    #[test]
    fn a_phantom_stiffer_than_all_its_samples_is_not_found_again() {
        let of = |own_pa: f64| {
            let reference_shear_modulus_pa = BTreeMap::from([("brain".to_owned(), own_pa)]);
            let best_sample = Some("sample-02".to_owned());
            let swept = swept(3.0, &[(300.0, 1.2), (500.0, 1.0), (900.0, 0.1)]);
            of_samples(&ExperimentOutcome {
                kind: ExperimentKind::Phantom,
                reference_shear_modulus_pa,
                best_sample,
                ..swept
            })
        };
        assert_eq!(of(880.0).finding, Finding::Recovered);
        let beyond = of(2000.0);
        assert_eq!(beyond.finding, Finding::NotRecovered);
        assert!(beyond.sentence.contains("2,000 Pa") && beyond.sentence.contains("300 to 900 Pa"), "{beyond:?}");
    }
}

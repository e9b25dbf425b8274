//! Several models of one patient beside each other: which of them what was seen speaks for, and the estimate over all.
//!
//! MacKay, "Information Theory, Inference, and Learning Algorithms", chapter 28; averaging: Hoeting, Madigan, Raftery and
//! Volinsky, Statistical Science 14, 1999.

use super::estimate::{EstimateOutcome, Knowledge, weights};
use super::verdict::{Claim, Finding, Reason, STRONG, Verdict};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// One model of the family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Candidate {
    /// What it assumes, in words: `supports sliding, CSF given`.
    pub name: String,
    /// Logarithm of the evidence.
    pub log_evidence: f64,
    /// Probability beside the others, all equal beforehand.
    pub weight: f64,
    /// What its own estimate comes down to.
    pub finding: Finding,
    /// Share of the seen shift it explains; zero where it saw none ([`Candidate::explained`]).
    pub explained_share: f64,
    /// Shear moduli by tissue: most probable and 95 % interval, Pa.
    pub moduli_pa: Vec<(String, [f64; 3])>,
}

impl Candidate {
    /// Share of the seen shift that it explains; `None` where it saw none.
    pub fn explained(&self) -> Option<f64> {
        (self.finding != Finding::NoShift).then_some(self.explained_share)
    }
}

/// The family, the most probable model first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// The models.
    pub candidates: Vec<Candidate>,
    /// Logarithm of the odds between the best two; absent with one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_odds: Option<f64>,
    /// What it comes down to.
    pub verdict: Verdict,
}

/// Models that no correlated errors were given to have no evidence and cannot be compared; `None` when none has one.
///
/// The estimate of the most probable model comes back beside the comparison, with the figures and the verdict of the whole
/// family: averaged over the models of its tissues that cannot be told apart from it, and withheld where one that cannot be claims no
/// stiffness.
pub fn compare(mut models: Vec<(String, EstimateOutcome)>) -> Option<(Comparison, EstimateOutcome)> {
    models.retain(|(_, m)| m.odds.is_some());
    let evidence = |m: &EstimateOutcome| m.odds.map_or(f64::NEG_INFINITY, |o| o.log_evidence);
    // The first of equals stays first: the order of the family is part of its definition.
    models.sort_by(|(_, a), (_, b)| evidence(b).total_cmp(&evidence(a)));
    let logs: Vec<f64> = models.iter().map(|(_, m)| evidence(m)).collect();
    let weight = weights(&logs);
    let candidates = models.iter().zip(&weight).map(|((name, m), &weight)| Candidate {
        name: name.clone(),
        log_evidence: evidence(m),
        weight,
        finding: m.verdict.finding,
        explained_share: m.shift.map_or(0.0, |s| s.explained_share),
        moduli_pa: tissues(m)
            .map(|(tissue, n)| {
                (tissue, [m.posterior.mode[n], m.posterior.interval_95[n][0], m.posterior.interval_95[n][1]])
            })
            .collect(),
    });
    let candidates: Vec<Candidate> = candidates.collect();
    let mut best = models.first()?.1.clone();
    let log_odds = (logs.len() > 1).then(|| logs[0] - logs[1]);
    let near = candidates.iter().filter(|c| !ruled_out(&candidates, c)).count();
    if best.verdict.finding.has_stiffness() {
        best = beside_rivals(best, &models[..near], &candidates[..near]);
    }
    if best.verdict.finding.has_stiffness() {
        // Where a search was not finished the evidence is no more than what it had come to: its model may be better than that.
        let unfinished = models[1..].iter().filter(|(_, m)| m.convergence.is_unfinished());
        best.verdict = best.verdict.beside_unsolved(unfinished.map(|(name, _)| name.clone()));
    }
    best.verdict = with_weakest_bounds(best.verdict, &models.iter().map(|(_, m)| &m.verdict));
    best.limits = best.verdict.because();
    let comparison = Comparison { candidates, log_odds, verdict: best.verdict.clone() };
    Some((comparison, best))
}

/// Whether what was seen speaks strongly for the best model, the first, and against this one.
fn ruled_out(candidates: &[Candidate], of: &Candidate) -> bool {
    candidates.first().is_some_and(|best| best.log_evidence - of.log_evidence > STRONG)
}

/// The places of the models that an average is of: the best one, the first, and those of its tissues that are not ruled out beside it
/// and claim a stiffness.
fn alike(candidates: &[Candidate]) -> impl Iterator<Item = usize> {
    let tissues = |c: &Candidate| c.moduli_pa.iter().map(|(tissue, _)| tissue.clone()).collect::<BTreeSet<_>>();
    let of_best = candidates.first().map(tissues);
    let places = candidates.iter().enumerate();
    let claims = move |c: &Candidate| c.finding.has_stiffness() && Some(tissues(c)) == of_best;
    places.filter(move |(n, c)| *n == 0 || !ruled_out(candidates, c) && claims(c)).map(|(n, _)| n)
}

impl Comparison {
    /// The models that the figures are averages over where the best ones cannot be told apart, the best one first.
    pub fn averaged(&self) -> impl Iterator<Item = &Candidate> {
        alike(&self.candidates).map(|n| &self.candidates[n])
    }
}

/// The estimate of the best model, the first of these, which claims a stiffness, beside the others that are not ruled out: none
/// where one of them claims none, whichever of the two comes first. A search that only was not finished contradicts nothing.
fn beside_rivals(
    mut best: EstimateOutcome,
    models: &[(String, EstimateOutcome)],
    candidates: &[Candidate],
) -> EstimateOutcome {
    let against = |c: &Candidate| candidates[0].log_evidence - c.log_evidence;
    let named = |c: &Candidate| (c.name.clone(), against(c));
    let only_unfinished = |m: &EstimateOutcome| m.verdict.reasons == [Reason::NotConverged];
    let silent = candidates.iter().zip(models).filter(|(c, (_, m))| !c.finding.has_stiffness() && !only_unfinished(m));
    let silent = silent.map(|(c, _)| {
        let (model, log_odds) = named(c);
        Reason::RivalWithholds { model, log_odds, finding: c.finding }
    });
    let silent: Vec<Reason> = silent.collect();
    let (share, own) = (best.verdict.explained_share, best.verdict.reasons.clone());
    if !silent.is_empty() {
        let moduli = tissues(&best).map(|(tissue, _)| (tissue, Claim::Withheld)).collect();
        best.verdict = Verdict::new(Finding::ModelsDisagree, share, moduli, silent);
        best.posterior = best.posterior.withheld();
        best.fluid = None;
        return best;
    }
    let alike: Vec<usize> = alike(candidates).collect();
    let another = alike.iter().skip(1).map(|&n| {
        let (model, log_odds) = named(&candidates[n]);
        Reason::AnotherModel { models: [candidates[0].name.clone(), model], log_odds }
    });
    // The most probable of them.
    let of_others = |n: &usize| !alike.contains(n) && candidates[*n].finding.has_stiffness();
    let other = (0..candidates.len()).find(of_others).map(|n| {
        let (model, log_odds) = named(&candidates[n]);
        Reason::OtherTissues { model, log_odds }
    });
    let reasons = another.chain(other).chain(own).collect();
    let (finding, moduli) = if alike.len() > 1 {
        // Weights among these: what others have does not count here.
        let part = |&n: &usize| (&models[n].1, (-against(&candidates[n])).exp());
        let parts: Vec<(&EstimateOutcome, f64)> = alike.iter().map(part).collect();
        average(&mut best, &parts);
        let answer = |(tissue, n): (String, usize)| {
            let p = &best.posterior;
            (tissue, Claim::Interval { mode_pa: p.mode[n], interval_95_pa: p.interval_95[n] })
        };
        (Finding::CannotTell, tissues(&best).map(answer).collect())
    } else {
        (best.verdict.finding, best.verdict.moduli)
    };
    best.verdict = Verdict::new(finding, share, moduli, reasons);
    best
}

/// Where nothing was seen to move: with the bounds that all these models of the same patient give. One that not every model of
/// its tissue gives is none, and none is one where a model saw a shift.
#[must_use]
pub fn with_weakest_bounds<'a>(verdict: Verdict, models: &(impl Iterator<Item = &'a Verdict> + Clone)) -> Verdict {
    if verdict.finding != Finding::NoShift {
        return verdict;
    }
    let bound = |(tissue, _): &(String, Claim)| {
        // A model of other tissues bounds others.
        let asked = |m: &&Verdict| m.finding != Finding::NoShift || m.moduli.iter().any(|(name, _)| name == tissue);
        let bounds = models.clone().filter(asked).map(|m| above(m, tissue));
        let weakest = bounds.reduce(|a, b| Some(a?.min(b?))).flatten();
        (tissue.clone(), weakest.map_or(Claim::Withheld, |bound_pa| Claim::Above { bound_pa }))
    };
    let moduli: Vec<(String, Claim)> = verdict.moduli.iter().map(bound).collect();
    // What any of these bounds takes as exact the weakest may, and where there is none nothing does.
    let is_exact = |reason: &&Reason| matches!(reason, Reason::ShapeTakenAsExact { .. });
    let exact = models.clone().flat_map(|m| &m.reasons).find(is_exact).cloned();
    let bounded = moduli.iter().any(|(_, claim)| *claim != Claim::Withheld);
    let own = verdict.reasons.into_iter().filter(|reason| !is_exact(&reason));
    let reasons = own.chain(exact.filter(|_| bounded)).collect();
    Verdict::new(Finding::NoShift, verdict.explained_share, moduli, reasons)
}

/// The bound that a verdict gives of a tissue, Pa.
fn above(verdict: &Verdict, tissue: &str) -> Option<f64> {
    verdict.moduli.iter().find(|(name, _)| name == tissue).and_then(|(_, claim)| match claim {
        Claim::Above { bound_pa } => Some(*bound_pa),
        _ => None,
    })
}

/// The tissues of an estimate with their place among its parameters.
fn tissues(outcome: &EstimateOutcome) -> impl Iterator<Item = (String, usize)> {
    let name = |(n, name): (usize, &String)| Some((name.strip_prefix("shear_modulus_pa of ")?.to_owned(), n));
    outcome.posterior.names.iter().enumerate().filter_map(name)
}

/// Moduli over models of the same tissues, each with its weight: quantiles of the mixture of their posteriors.
fn average(best: &mut EstimateOutcome, models: &[(&EstimateOutcome, f64)]) {
    for (tissue, n) in tissues(best).collect::<Vec<_>>() {
        let part = |&(m, weight): &(&EstimateOutcome, f64)| {
            let (_, at) = tissues(m).find(|(name, _)| *name == tissue)?;
            Some([weight, m.posterior.mode[at].ln(), m.posterior.log_sd[at]])
        };
        let parts: Vec<[f64; 3]> = models.iter().filter_map(part).collect();
        let (_, sd) = moments(&parts);
        let p = &mut best.posterior;
        p.mode[n] = quantile(&parts, 0.5).exp();
        p.interval_95[n] = [quantile(&parts, 0.025).exp(), quantile(&parts, 0.975).exp()];
        // Beside the others of the best model, whose correlations are kept: a covariance stays one.
        let times = if p.log_sd[n] > 0.0 && p.log_sd[n].is_finite() { sd / p.log_sd[n] } else { 0.0 };
        for other in (0..p.log_covariance.len()).filter(|other| *other != n) {
            p.log_covariance[n][other] *= times;
            p.log_covariance[other][n] *= times;
        }
        p.log_covariance[n][n] = sd * sd;
        p.log_sd[n] = sd;
        p.identifiability.verdicts[n] = Knowledge::Averaged;
    }
}

/// Mean and standard deviation of a mixture of Gaussians (weight, mean, sd).
fn moments(parts: &[[f64; 3]]) -> (f64, f64) {
    let total: f64 = parts.iter().map(|[w, ..]| w).sum();
    let mean = parts.iter().map(|[w, m, _]| w * m).sum::<f64>() / total;
    let variance = parts.iter().map(|[w, m, s]| w * (s * s + (m - mean).powi(2))).sum::<f64>() / total;
    (mean, variance.sqrt())
}

/// The value below which this share of a mixture of Gaussians lies, by bisection.
fn quantile(parts: &[[f64; 3]], share: f64) -> f64 {
    let total: f64 = parts.iter().map(|[w, ..]| w).sum();
    let below = |x: f64| parts.iter().map(|[w, m, s]| w * normal_below((x - m) / s.max(1e-12))).sum::<f64>() / total;
    let reach = |[_, m, s]: &[f64; 3]| (m - 12.0 * s, m + 12.0 * s);
    let ends = parts.iter().map(reach).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)));
    let (mut low, mut high) = ends;
    for _ in 0..80 {
        let middle = f64::midpoint(low, high);
        if below(middle) < share { low = middle } else { high = middle }
    }
    f64::midpoint(low, high)
}

/// Share of a standard Gaussian below x, to 1e-7 (Abramowitz and Stegun 26.2.17).
fn normal_below(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let series =
        t * (0.319_381_530 + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let above = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt() * series;
    if x > 0.0 { 1.0 - above } else { above }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::{Convergence, Odds, Z_95};

    #[test]
    fn a_bound_is_the_weakest_of_all_models_and_none_where_one_gives_none() {
        let verdict = |bound: Option<f64>| {
            let claim = bound.map_or(Claim::Withheld, |bound_pa| Claim::Above { bound_pa });
            let reason = Reason::WithinNoise { noise_mm: 0.2, would_be_seen_mm: 0.4 };
            Verdict::new(Finding::NoShift, Some(0.0), vec![("grey_matter".to_owned(), claim)], vec![reason])
        };
        let of = |bounds: &[Option<f64>]| {
            let models: Vec<Verdict> = bounds.iter().map(|b| verdict(*b)).collect();
            with_weakest_bounds(models[0].clone(), &models.iter())
        };
        assert_eq!(of(&[Some(4130.0), Some(1850.0), Some(9000.0)]), verdict(Some(1850.0)));
        assert_eq!(of(&[Some(4130.0), None]), verdict(None));
    }

    #[test]
    fn a_bound_of_one_tissue_is_not_asked_of_models_of_two_unless_they_saw_a_shift() {
        let of = |finding, bounds: &[(&str, f64)]| {
            let claim = |(tissue, bound_pa): &(&str, f64)| ((*tissue).to_owned(), Claim::Above { bound_pa: *bound_pa });
            Verdict::new(finding, None, bounds.iter().map(claim).collect(), Vec::new())
        };
        let brain = |bound_pa| of(Finding::NoShift, &[("brain", bound_pa)]);
        let two = |finding| of(finding, &[("grey_matter", 700.0), ("white_matter", 600.0)]);
        let bounded = |models: &[Verdict]| with_weakest_bounds(models[0].clone(), &models.iter());
        assert_eq!(bounded(&[brain(1900.0), two(Finding::NoShift), brain(1500.0)]), brain(1500.0));
        assert_eq!(bounded(&[two(Finding::NoShift), brain(1500.0)]), two(Finding::NoShift));
        let shift_seen = bounded(&[brain(1900.0), two(Finding::Unexplained)]);
        assert_eq!(shift_seen.moduli, [("brain".to_owned(), Claim::Withheld)]);
    }

    /// A model as its own estimate left it: what it comes down to, its evidence, and a modulus of every tissue.
    fn ended(finding: Finding, log_evidence: f64, tissues: &[&str], mode_pa: f64) -> EstimateOutcome {
        let count = tissues.len();
        let mut found = of_two(0.1, 0.0);
        let p = &mut found.posterior;
        p.names = tissues.iter().map(|tissue| format!("shear_modulus_pa of {tissue}")).collect();
        (p.mode, p.log_sd) = (vec![mode_pa; count], vec![0.1; count]);
        p.interval_95 = vec![[0.8 * mode_pa, 1.25 * mode_pa]; count];
        p.log_covariance = (0..count).map(|r| (0..count).map(|c| if r == c { 0.01 } else { 0.0 }).collect()).collect();
        p.identifiability.verdicts = vec![Knowledge::Identified; count];
        let claim = if finding.has_stiffness() {
            Claim::Interval { mode_pa, interval_95_pa: [0.8 * mode_pa, 1.25 * mode_pa] }
        } else {
            Claim::Withheld
        };
        let moduli = tissues.iter().map(|tissue| ((*tissue).to_owned(), claim.clone())).collect();
        found.verdict = Verdict::new(finding, Some(0.9), moduli, Vec::new());
        let (model_to_any_movement, moved_to_still) = (9.0, 99.0);
        let log_evidence_exact = log_evidence;
        found.odds = Some(Odds { log_evidence, log_evidence_exact, model_to_any_movement, moved_to_still });
        found
    }

    /// The verdict over models called a, b, ... in this order.
    fn over(models: &[EstimateOutcome]) -> (Verdict, EstimateOutcome) {
        let called = ('a'..).map(|letter| letter.to_string()).zip(models.iter().cloned());
        let (comparison, best) = compare(called.collect()).unwrap();
        assert_eq!((&comparison.verdict, comparison.verdict.because()), (&best.verdict, best.limits.clone()));
        (comparison.verdict, best)
    }

    const BRAIN: [&str; 1] = ["brain"];
    const TWO: [&str; 2] = ["grey_matter", "white_matter"];

    #[test]
    fn nothing_is_claimed_beside_a_model_as_probable_that_claims_nothing_whichever_comes_first() {
        let sure = |log_evidence| ended(Finding::Identified, log_evidence, &BRAIN, 1000.0);
        for finding in [Finding::Conflict, Finding::Unexplained, Finding::NoShift] {
            for tissues in [&BRAIN[..], &TWO[..]] {
                let silent = |log_evidence| ended(finding, log_evidence, tissues, 6000.0);
                let (first, best) = over(&[sure(-10.0), silent(-11.0)]);
                let (second, _) = over(&[silent(-10.0), sure(-11.0)]);
                for verdict in [&first, &second] {
                    assert!(!verdict.finding.has_stiffness(), "{verdict:?}");
                    assert!(verdict.moduli.iter().all(|(_, claim)| *claim == Claim::Withheld), "{verdict:?}");
                }
                assert_eq!(first.finding, Finding::ModelsDisagree);
                assert!(
                    first.sentence.contains("b is about as probable as the best model (log odds 1.0)"),
                    "{}",
                    first.sentence
                );
                assert!(first.sentence.contains(finding.short()), "{}", first.sentence);
                assert_eq!(best.posterior.identifiability.verdicts, [Knowledge::Withheld]);
                // What the odds rule out does not enter.
                let (alone, _) = over(&[sure(-10.0), silent(-10.1 - STRONG)]);
                assert_eq!(alone, sure(-10.0).verdict);
            }
        }
    }

    #[test]
    fn an_average_is_over_the_models_that_are_not_ruled_out_and_of_the_same_tissues() {
        let sure = |log_evidence, tissues: &[&str], mode_pa| ended(Finding::Identified, log_evidence, tissues, mode_pa);
        let one = |log_evidence, mode_pa| sure(log_evidence, &BRAIN, mode_pa);
        let (both, _) = over(&[one(-10.0, 1000.0), one(-11.0, 1200.0)]);
        assert_eq!(both.finding, Finding::CannotTell);
        let with =
            |others: &[EstimateOutcome]| over(&[&[one(-10.0, 1000.0), one(-11.0, 1200.0)][..], others].concat()).0;
        assert_eq!(with(&[one(-10.1 - STRONG, 9000.0)]), both);
        let third = with(&[one(-11.5, 900.0)]);
        assert!(third.moduli != both.moduli && third.sentence.contains("them and 1 more"), "{}", third.sentence);
        // A model of other tissues is named for itself, and the average is of a and b as before.
        let beside = with(&[sure(-10.5, &TWO, 700.0)]);
        assert_eq!((beside.finding, &beside.moduli), (Finding::CannotTell, &both.moduli));
        assert!(beside.sentence.starts_with("Cannot tell: a and b") && beside.sentence.contains(" C, whose tissues"));
    }

    #[test]
    fn the_best_model_of_its_tissues_is_no_average_beside_one_of_others() {
        let [one, two] =
            [(-10.0, &BRAIN[..]), (-10.5, &TWO[..])].map(|(log, of)| ended(Finding::Identified, log, of, 1000.0));
        let (verdict, best) = over(&[one.clone(), two]);
        assert_eq!((verdict.finding, &verdict.moduli), (Finding::Identified, &one.verdict.moduli));
        assert_eq!(best.posterior, one.posterior);
        assert!(!verdict.sentence.contains("Averaged"), "{}", verdict.sentence);
        assert_eq!(verdict.reasons, [Reason::OtherTissues { model: "b".to_owned(), log_odds: 0.5 }]);
        assert!(
            verdict.sentence.contains("B, whose tissues are others, explains the shift about as well (log odds 0.5).")
        );
    }

    #[test]
    fn a_model_whose_search_was_not_finished_is_not_ruled_out_by_what_it_had_come_to() {
        let sure = ended(Finding::Identified, -10.0, &BRAIN, 1000.0);
        let mut far = ended(Finding::Unexplained, -40.0, &BRAIN, 3000.0);
        far.convergence = Convergence::Stalled;
        let (verdict, _) = over(&[sure.clone(), far.clone()]);
        assert_eq!((verdict.finding, &verdict.moduli), (Finding::Identified, &sure.verdict.moduli));
        assert_eq!(verdict.reasons, [Reason::NotCompared { model: "b".to_owned() }]);
        // Nor does a near one take away what the best one found, for that alone; nor is it of the average.
        let mut near = far.clone();
        near.odds = ended(Finding::Unexplained, -11.0, &BRAIN, 3000.0).odds;
        near.verdict.reasons = vec![Reason::NotConverged];
        let (verdict, _) = over(&[sure.clone(), near.clone()]);
        assert_eq!((verdict.finding, &verdict.moduli), (Finding::Identified, &sure.verdict.moduli));
        assert_eq!(verdict.reasons, [Reason::NotCompared { model: "b".to_owned() }]);
        near.verdict.reasons.push(Reason::Discrepancy { discrepancy_mm: 1.0, noise_mm: 0.1 });
        assert_eq!(over(&[sure.clone(), near]).0.finding, Finding::ModelsDisagree);
        far.convergence = Convergence::NoDescent;
        assert_eq!(over(&[sure, far]).0.reasons, []);
    }

    #[test]
    fn what_a_bound_may_take_as_exact_is_told_beside_it_and_beside_no_other() {
        let of = |bound: Option<f64>, reasons: &[Reason]| {
            let claim = bound.map_or(Claim::Withheld, |bound_pa| Claim::Above { bound_pa });
            Verdict::new(Finding::NoShift, None, vec![("brain".to_owned(), claim)], reasons.to_vec())
        };
        let exact = [Reason::ShapeTakenAsExact { amounts: 2 }];
        let told = |models: &[Verdict]| with_weakest_bounds(models[0].clone(), &models.iter()).reasons;
        assert_eq!(told(&[of(Some(900.0), &[]), of(Some(700.0), &exact)]), exact);
        assert_eq!(told(&[of(Some(900.0), &exact), of(None, &[])]), []);
    }

    /// Of two tissues, with this standard deviation and correlation.
    fn of_two(sd: f64, together: f64) -> EstimateOutcome {
        let names = TWO.map(|tissue| format!("shear_modulus_pa of {tissue}"));
        let (own, off) = (sd * sd, together * sd * sd);
        serde_json::from_value(serde_json::json!({
            "posterior": {
                "names": names, "mode": [1000.0, 700.0], "log_sd": [sd, sd], "interval_95": [[1.0, 2.0], [1.0, 2.0]],
                "log_covariance": [[own, off], [off, own]],
                "identifiability": {
                    "verdicts": ["identified", "identified"], "sensitivity_correlation": [[1.0, 0.0], [0.0, 1.0]],
                    "condition": 1.0, "valley": [1.0, 0.0], "valley_log_sd": 0.1
                }
            },
            "prior": [], "observations": 12, "independent_observations": 12.0, "noise_mm": 0.3, "residual_rms_mm": 0.4,
            "convergence": "step-below-tolerance", "solves": 9, "tangent_solves": 18, "limits": [],
            "verdict": { "finding": "identified", "reasons": [], "sentence": "", "moduli": [] }
        }))
        .unwrap()
    }

    #[test]
    fn an_average_that_is_surer_than_its_best_model_keeps_a_covariance() {
        let models = [of_two(0.5, 0.9), of_two(0.1, 0.9)];
        let mut best = models[0].clone();
        average(&mut best, &[(&models[0], 0.1), (&models[1], 0.9)]);
        let [[a, b], [c, d]] = [0, 1].map(|n| [0, 1].map(|m| best.posterior.log_covariance[n][m]));
        assert!(a < 0.5 * 0.25 && b == c && ((b * c / (a * d)).sqrt() - 0.9).abs() < 1e-9, "{a} {b} {d}");
        assert!((a.sqrt() - best.posterior.log_sd[0]).abs() < 1e-12);
    }

    #[test]
    fn quantiles_of_one_gaussian_are_its_own_and_of_two_lie_between() {
        let one = [[1.0, 7.0, 0.2]];
        assert!((quantile(&one, 0.975) - (7.0 + 0.2 * Z_95)).abs() < 1e-5);
        let two = [[0.5, 6.0, 0.1], [0.5, 8.0, 0.1]];
        assert!((quantile(&two, 0.025) - (6.0 - 0.1 * 1.644_854)).abs() < 1e-4, "a twentieth of the lower one");
        assert!((moments(&two).1 - (0.01f64 + 1.0).sqrt()).abs() < 1e-12);
    }
}

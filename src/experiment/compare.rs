//! Several models of one patient beside each other: which of them what was seen speaks for, and the estimate over all.
//!
//! MacKay, "Information Theory, Inference, and Learning Algorithms", chapter 28; averaging: Hoeting, Madigan, Raftery and
//! Volinsky, Statistical Science 14, 1999.

use super::estimate::{EstimateOutcome, Knowledge, weights};
use super::verdict::{Claim, Finding, Reason, STRONG, Verdict};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
/// family: averaged where the best two cannot be told apart.
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
    let (first, mut best) = models.first().cloned()?;
    let log_odds = (logs.len() > 1).then(|| logs[0] - logs[1]);
    let apart = log_odds.is_none_or(|odds| odds > STRONG);
    if !apart && best.verdict.finding.has_stiffness() {
        let reason = Reason::AnotherModel { models: [first, models[1].0.clone()], log_odds: log_odds.unwrap_or(0.0) };
        average(&mut best, &models, &weight);
        let answer = |(tissue, n): (String, usize)| {
            let p = &best.posterior;
            (tissue, Claim::Interval { mode_pa: p.mode[n], interval_95_pa: p.interval_95[n] })
        };
        let moduli = tissues(&best).map(answer).collect();
        let reasons = std::iter::once(reason).chain(best.verdict.reasons.clone()).collect();
        best.verdict = Verdict::new(Finding::CannotTell, best.verdict.explained_share, moduli, reasons);
        best.limits = best.verdict.because();
    }
    best.verdict = with_weakest_bounds(best.verdict, &models.iter().map(|(_, m)| &m.verdict));
    let comparison = Comparison { candidates, log_odds, verdict: best.verdict.clone() };
    Some((comparison, best))
}

/// Where nothing was seen to move: with the bounds that all these models of the same patient give. One that not every model
/// gives is none.
#[must_use]
pub fn with_weakest_bounds<'a>(verdict: Verdict, models: &(impl Iterator<Item = &'a Verdict> + Clone)) -> Verdict {
    if verdict.finding != Finding::NoShift {
        return verdict;
    }
    let bound = |(tissue, _): &(String, Claim)| {
        let weakest = models.clone().map(|m| above(m, tissue)).reduce(|a, b| Some(a?.min(b?))).flatten();
        (tissue.clone(), weakest.map_or(Claim::Withheld, |bound_pa| Claim::Above { bound_pa }))
    };
    let moduli = verdict.moduli.iter().map(bound).collect();
    Verdict::new(Finding::NoShift, verdict.explained_share, moduli, verdict.reasons)
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

/// Moduli over all models: quantiles of the mixture of their posteriors.
fn average(best: &mut EstimateOutcome, models: &[(String, EstimateOutcome)], weight: &[f64]) {
    for (tissue, n) in tissues(best).collect::<Vec<_>>() {
        // A model with other tissues says nothing of this one.
        let parts: Vec<[f64; 3]> = models
            .iter()
            .zip(weight)
            .filter_map(|((_, m), &weight)| {
                let (_, at) = tissues(m).find(|(name, _)| *name == tissue)?;
                Some([weight, m.posterior.mode[at].ln(), m.posterior.log_sd[at]])
            })
            .collect();
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
    use crate::experiment::estimate::Z_95;

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

    /// Of two tissues, with this standard deviation and correlation.
    fn of_two(sd: f64, together: f64) -> EstimateOutcome {
        let names = ["grey_matter", "white_matter"].map(|tissue| format!("shear_modulus_pa of {tissue}"));
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
        let models = [("best".to_owned(), of_two(0.5, 0.9)), ("other".to_owned(), of_two(0.1, 0.9))];
        let mut best = models[0].1.clone();
        average(&mut best, &models, &[0.1, 0.9]);
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

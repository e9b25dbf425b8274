//! What a fit comes down to: its figures against the measurement, the prior and stillness.

use super::evidence::Unexplained;
use super::findings::Fitted;
use super::{EstimateSettings, Knowledge, LogPrior, Posterior};
use crate::experiment::verdict::{CONTRADICTION_SD, Claim, Finding, Reason, STRONG, Verdict};
use nalgebra::Vector3;

/// How far from the average of the studies, in standard deviations of one more study, a figure may lie that was not drawn towards it
/// (docs/evidence/estimate.md, "A person instead of the average").
const FAR_FROM_AVERAGE_SD: f64 = 4.0;

/// What a verdict needs of its problem.
pub(super) struct Posed<'a> {
    /// What was known before.
    pub prior: &'a [LogPrior],
    /// The tissue whose shear modulus a parameter is.
    pub tissues: &'a [Option<String>],
    /// What is told of the load where a weight that is given pulls at the body.
    pub assumed: Option<Reason>,
    /// What labels, supports and mesh make wrong of the logarithm of each parameter, one standard deviation.
    pub model_error: &'a [f64],
    /// How many amounts by which the body's shape may be off were left out: nobody knows what they do.
    pub shape_as_exact: usize,
    /// Gravity as assumed, m/s2.
    pub gravity_m_per_s2: [f64; 3],
    /// Whether load and supports are known, as a phantom's are: then nothing contradicts them.
    pub body_known: bool,
}

/// What the figures come down to.
pub(super) fn verdict_of_fit(
    fitted: &Fitted,
    settings: &EstimateSettings,
    posterior: &Posterior,
    posed: &Posed<'_>,
) -> Verdict {
    let Posed { prior, tissues, ref assumed, model_error, shape_as_exact, gravity_m_per_s2, body_known } = *posed;
    let mut unexplained = Vec::new();
    let mut still = None;
    let mut share = None;
    let mut wider = None;
    if let Some(found) = &fitted.correlated {
        share = Some(found.shift.explained_share);
        if !found.shift.seen {
            let (log_odds, would_be_seen_mm) = (found.odds.moved_to_still, found.shift.would_be_seen_mm);
            still = Some(if log_odds > STRONG {
                Reason::WithinNoise { noise_mm: found.measured_noise.sd_mm, would_be_seen_mm }
            } else {
                Reason::StillAsProbable { log_odds, would_be_seen_mm }
            });
        }
        // Noise that had to grow is as unexplained as a discrepancy is.
        let (unexplained_by, noise_mm) = (found.unexplained, found.measured_noise.sd_mm);
        let discrepancy_mm = beyond_noise_mm(unexplained_by, fitted.residual_rms_mm, noise_mm);
        let reason = Reason::Discrepancy { discrepancy_mm, noise_mm };
        // What the model leaves is of the shift's own size: the shift is not three standard deviations of it.
        if CONTRADICTION_SD * 3f64.sqrt() * discrepancy_mm > found.shift.seen_rms_mm {
            unexplained.push(reason);
        } else if discrepancy_mm > noise_mm {
            wider = Some(reason);
        }
        if found.odds.model_to_any_movement < STRONG {
            unexplained.push(Reason::NoBetterThanAnyMovement { log_odds: found.odds.model_to_any_movement });
        }
    } else {
        let (rest_mm, deformed_mm, noise_mm) = (fitted.rest_rms_mm, fitted.residual_rms_mm, settings.noise_mm);
        // As of samples.
        if Finding::against_rest(rest_mm, deformed_mm, noise_mm) != Finding::Better {
            let set = "all that is seen".to_owned();
            still = Some(Reason::Surface { set, rest_mm, deformed_mm, floor_mm: noise_mm });
        }
        // A root mean square of n independent ones is known to its 1 / sqrt(2 n).
        if deformed_mm > noise_mm * (1.0 + CONTRADICTION_SD / (2.0 * fitted.independent).sqrt()) {
            unexplained.push(Reason::Discrepancy { discrepancy_mm: deformed_mm, noise_mm });
        }
    }
    // What was not found explains nothing.
    if fitted.descent.convergence.is_unfinished() {
        unexplained.push(Reason::NotConverged);
    }
    let conflict = prior.iter().zip(&fitted.descent.log_parameters).filter_map(|(prior, number)| {
        // Drawn towards what is known by a prior of that, or not drawn by a person's.
        let far = if prior.average.is_some() { FAR_FROM_AVERAGE_SD } else { CONTRADICTION_SD };
        let known = prior.of_average();
        let sd = (number - known.mean) / known.sd?;
        (sd.abs() > far).then_some(Reason::FarFromPrior { name: known.name, sd })
    });
    let conflict: Vec<Reason> = if body_known { Vec::new() } else { conflict.collect() };
    let named = || tissues.iter().enumerate().filter_map(|(n, tissue)| tissue.clone().map(|tissue| (n, tissue)));
    let dominated = named().all(|(n, _)| posterior.identifiability.verdicts[n] != Knowledge::Identified);
    let finding = if still.is_some() {
        Finding::NoShift
    } else if !conflict.is_empty() {
        Finding::Conflict
    } else if !unexplained.is_empty() {
        Finding::Unexplained
    } else if dominated {
        Finding::PriorDominated
    } else if wider.is_some() {
        Finding::Widened
    } else {
        Finding::Identified
    };
    let answer = |n: usize| match (&fitted.correlated, finding) {
        (Some(found), Finding::NoShift) => {
            let softest = found.softest.get(n).copied().flatten();
            softest.map_or(Claim::Withheld, |of| Claim::Above { bound_pa: of.log_bound(model_error[n]).exp() })
        }
        _ if finding.has_stiffness() => {
            Claim::Interval { mode_pa: posterior.mode[n], interval_95_pa: posterior.interval_95[n] }
        }
        _ => Claim::Withheld,
    };
    let moduli: Vec<(String, Claim)> = named().map(|(n, tissue)| (tissue, answer(n))).collect();
    // Of what has not moved there is nothing to be explained, well or badly.
    let mut reasons: Vec<Reason> = match still {
        Some(still) => vec![still],
        None => conflict.into_iter().chain(unexplained).chain(wider).collect(),
    };
    if matches!(finding, Finding::Conflict | Finding::Unexplained) {
        let seen = fitted.correlated.as_ref().map(|found| (found.seen_mean_mm, found.shift.seen_rms_mm));
        reasons.extend(seen.and_then(|(mean_mm, rms_mm)| other_way_down(mean_mm, rms_mm, gravity_m_per_s2)));
    }
    if finding.has_stiffness() {
        let little = named().filter(|(n, _)| posterior.identifiability.verdicts[*n] != Knowledge::Identified);
        reasons.extend(little.map(|(n, _)| Reason::LittleSaid { name: prior[n].name.clone() }));
    }
    if finding.has_stiffness() {
        reasons.extend(assumed.clone());
    }
    // A bound leaves room for the shape as an interval does.
    if shape_as_exact > 0 && moduli.iter().any(|(_, claim)| *claim != Claim::Withheld) {
        reasons.push(Reason::ShapeTakenAsExact { amounts: shape_as_exact });
    }
    Verdict::new(finding, share, moduli, reasons)
}

/// Whether what is seen has moved together, and another way than gravity as assumed would take it. A brain sinks: most of it goes
/// where gravity pulls, whatever its stiffness.
fn other_way_down(seen_mean_mm: [f64; 3], seen_rms_mm: f64, gravity_m_per_s2: [f64; 3]) -> Option<Reason> {
    /// Half of a right angle: nearer to gravity than to any way across it.
    const ASTRAY_DEG: f64 = 45.0;
    /// Less of the shift in common is no direction.
    const TOGETHER: f64 = 0.5;
    let (seen, down) = (Vector3::from(seen_mean_mm), Vector3::from(gravity_m_per_s2));
    let moves_together = seen.norm() > 0.0 && seen.norm() >= TOGETHER * seen_rms_mm;
    let astray = down.norm() > 0.0 && seen.angle(&down) > ASTRAY_DEG.to_radians();
    (moves_together && astray).then_some(Reason::OtherWayDown { seen_mm: seen_mean_mm, gravity_m_per_s2 })
}

/// What the model leaves of one component beyond the measured noise, mm: by the processes that were found, and never less
/// than by the residuals themselves. A process whose values are alike over a length may give residuals larger than its
/// standard deviation; the fit left them all the same.
fn beyond_noise_mm(unexplained: Unexplained, residual_rms_mm: f64, noise_mm: f64) -> f64 {
    let left_mm = unexplained.noise.sd_mm.hypot(unexplained.discrepancy.sd_mm).max(residual_rms_mm);
    (left_mm * left_mm - noise_mm * noise_mm).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::process::Process;
    use proptest::prelude::*;

    #[test]
    fn a_shift_across_gravity_as_assumed_names_the_way_it_went() {
        let (upright, supine) = ([0.0, 0.0, -9.81], [0.0, -9.81, 0.0]);
        let backwards = [0.2, -2.0, -0.6];
        let reason = other_way_down(backwards, 2.4, upright).unwrap();
        let text = reason.sentence();
        assert!(text.contains("2.1 mm on average towards the back of the head, 73 degrees"), "{text}");
        assert!(text.contains("(towards the feet)") && text.contains("gravity_m_per_s2"), "{text}");
        assert_eq!(other_way_down(backwards, 2.4, supine), None, "down");
        assert_eq!(other_way_down(backwards, 5.0, upright), None, "each part its own way");
        assert_eq!(other_way_down(backwards, 2.4, [0.0; 3]), None, "no gravity is assumed");
        assert_eq!(other_way_down([0.0; 3], 0.0, upright), None, "nothing moves");
    }

    proptest! {
        #[test]
        fn a_fit_leaves_no_less_than_its_residuals_nor_than_the_processes_found(
            noise_sd in 0.01..2.0f64, discrepancy_sd in 0.0..2.0f64, residual in 0.0..3.0f64, measured in 0.01..1.0f64,
        ) {
            let found = Unexplained {
                noise: Process { sd_mm: noise_sd, length_mm: 48.0 },
                discrepancy: Process { sd_mm: discrepancy_sd, length_mm: 60.0 },
            };
            let beyond = beyond_noise_mm(found, residual, measured);
            let total = beyond.hypot(measured);
            prop_assert!(total >= residual - 1e-12 && total >= noise_sd.hypot(discrepancy_sd) - 1e-12);
            // What the measured noise makes up for is not the model's.
            let explained = residual <= measured && noise_sd.hypot(discrepancy_sd) <= measured;
            prop_assert_eq!(explained, beyond == 0.0);
        }
    }
}

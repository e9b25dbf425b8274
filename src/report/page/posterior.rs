//! What the scans have added to what was known: prior and posterior of every parameter, and of two moduli at once.

use super::super::chart::{DensityChart, DensityCurve, JointChart, JointGaussian, Rule, Valley};
use super::super::html::number;
use super::results::tissue_name;
use crate::experiment::estimate::{EstimateOutcome, Knowledge, LogPrior, Scale, Z_95, prior_correlation};
use crate::experiment::parameter_name::{in_words, with_unit};
use crate::experiment::verdict::{Claim, pa, range, with_interval};
use maud::{Markup, PreEscaped, html};
use std::collections::BTreeMap;

/// How far a curve is drawn, in standard deviations.
const REACH_SD: f64 = 3.4;
/// A posterior narrower than this share of its prior is shown by itself as well.
const NARROW: f64 = 0.08;
/// Share of the valley's direction that must lie in a plane for a line in it to mean anything.
const IN_PLANE: f64 = 0.9;

fn interval(name: &str, [low, high]: [f64; 2]) -> String {
    match in_words(name).1 {
        "Pa" => range([low, high]),
        unit => format!("{} to {} {unit}", number(low, 3), number(high, 3)).trim_end().to_owned(),
    }
}

/// A Gaussian over a parameter's own number.
#[derive(Clone, Copy)]
struct Known {
    mean: f64,
    sd: f64,
}

/// Whether a parameter's posterior is the Gaussian that its interval was read from: an average over models has several humps.
fn is_gaussian(estimate: &EstimateOutcome, n: usize) -> bool {
    estimate.posterior.identifiability.verdicts.get(n) != Some(&Knowledge::Averaged)
}

/// The posterior of a parameter as the Gaussian that its interval was read from.
fn posterior_of(estimate: &EstimateOutcome, n: usize) -> Known {
    Known { mean: estimate.prior[n].scale.number(estimate.posterior.mode[n]), sd: estimate.posterior.log_sd[n] }
}

fn prior_of(prior: &LogPrior) -> Option<Known> {
    prior.sd.map(|sd| Known { mean: prior.mean, sd })
}

fn curve(what: &str, name: &str, scale: Scale, known: Known, before: bool) -> DensityCurve {
    let steps = 96;
    let at = |z: f64| scale.value(known.mean + z * known.sd);
    let point = |n: i32| {
        let z = REACH_SD * (2.0 * f64::from(n) / f64::from(steps) - 1.0);
        let value = at(z);
        // Shares are drawn as shares: a density over their log odds has a slope to count.
        let slope = if scale == Scale::Share { 1.0 / (value * (1.0 - value)).max(f64::MIN_POSITIVE) } else { 1.0 };
        [value, slope * (-0.5 * z * z).exp()]
    };
    let mut points: Vec<[f64; 2]> = (0..=steps).map(point).collect();
    let highest = points.iter().map(|p| p[1]).fold(f64::MIN_POSITIVE, f64::max);
    for point in &mut points {
        point[1] /= highest;
    }
    let ends = [at(-Z_95), at(Z_95)];
    let said = interval(name, ends);
    let apart = said.contains(" to ");
    DensityCurve {
        // Where rounding leaves no interval its reach is told instead.
        name: if apart { format!("{what}, 95 %: {said}") } else { format!("{what}: {}", with_interval(at(0.0), ends)) },
        points,
        interval: ends,
        before,
    }
}

/// The figures of an estimate; `truth` holds the moduli that went into a reference, Pa per tissue.
pub fn figures(estimate: &EstimateOutcome, truth: &BTreeMap<String, f64>) -> Markup {
    let claimed = estimate.verdict.finding.has_stiffness();
    let charts: Vec<DensityChart> =
        (0..estimate.prior.len()).filter_map(|n| of_one(estimate, n, claimed, truth)).collect();
    let joint = if claimed { of_two(estimate, truth) } else { Vec::new() };
    let bound = estimate.verdict.moduli.iter().any(|(_, claim)| matches!(claim, Claim::Above { .. }));
    html! {
        @if !charts.is_empty() || !joint.is_empty() {
            h3 { "Before and after the scans" }
            p {
                @if claimed {
                    "Dashed: what was known before the scans. Filled: what is known with them. Every curve is scaled to its own \
                     peak; the bars below are the 95 % intervals. Where models were averaged, no curve is drawn: the interval stands \
                     in the table."
                } @else if bound {
                    "What was known before the scans. The scans give a bound and no interval (see the verdict), so no posterior is \
                     drawn."
                } @else {
                    "What was known before the scans. The scans have added nothing that may be read as an answer (see the \
                     verdict), so no posterior is drawn."
                }
            } "\n"
            div class="charts" {
                @for chart in &charts { figure { (PreEscaped(chart.to_svg())) } }
            } "\n"
            @if !joint.is_empty() {
                h3 { "Two moduli at once" }
                p {
                    "Contours hold 50 % and 95 % of the probability. Where they are long along the valley, one tissue stiffer and the \
                     other softer explain the scans as well."
                } "\n"
                div class="charts" { @for chart in &joint { figure { (PreEscaped(chart.to_svg())) } } } "\n"
            }
        }
    }
}

fn tissue_of(name: &str) -> Option<&str> {
    name.strip_prefix("shear_modulus_pa of ")
}

/// What went in, where the parameter is a modulus of a reference that is known.
fn true_value(name: &str, truth: &BTreeMap<String, f64>) -> Option<f64> {
    truth.get(tissue_of(name)?).copied()
}

fn of_one(estimate: &EstimateOutcome, n: usize, claimed: bool, truth: &BTreeMap<String, f64>) -> Option<DensityChart> {
    let (name, prior) = (estimate.posterior.names[n].as_str(), &estimate.prior[n]);
    let scale = prior.scale;
    let mut curves: Vec<DensityCurve> =
        prior_of(prior).map(|known| curve("prior", name, scale, known, true)).into_iter().collect();
    // A direction that nothing holds has a variance that only stands for infinity.
    let posterior = Some(posterior_of(estimate, n))
        .filter(|known| claimed && is_gaussian(estimate, n) && known.sd.is_finite() && known.sd < 100.0);
    curves.extend(posterior.map(|known| curve("posterior", name, scale, known, false)));
    let mut rules: Vec<Rule> = true_value(name, truth)
        .map(|at| Rule { at, name: format!("what went in: {} Pa", pa(at)) })
        .into_iter()
        .collect();
    let of_tissue = estimate.verdict.moduli.iter().find(|(tissue, _)| Some(tissue.as_str()) == tissue_of(name));
    if let Some((_, Claim::Above { bound_pa })) = of_tissue {
        rules.push(Rule { at: *bound_pa, name: format!("with 95 % certainty above {} Pa", pa(*bound_pa)) });
    }
    let said: Vec<String> = curves.iter().map(|c| c.name.clone()).chain(rules.iter().map(|r| r.name.clone())).collect();
    (!curves.is_empty()).then(|| DensityChart {
        description: format!("Densities of {}: {}", with_unit(name), said.join("; ")),
        x_label: with_unit(name),
        x_log: scale == Scale::Logarithm,
        curves,
        rules,
    })
}

/// The first two moduli: over the prior's range and, where that leaves only a dot, by themselves.
fn of_two(estimate: &EstimateOutcome, truth: &BTreeMap<String, f64>) -> Vec<JointChart> {
    let posterior = &estimate.posterior;
    let moduli: Vec<usize> = (0..posterior.names.len()).filter(|n| tissue_of(&posterior.names[*n]).is_some()).collect();
    let [a, b, ..] = moduli[..] else { return Vec::new() };
    let pair = [a, b];
    if !pair.iter().all(|&n| is_gaussian(estimate, n)) {
        return Vec::new();
    }
    let known = pair.map(|n| posterior_of(estimate, n));
    if known.iter().any(|k| !k.sd.is_finite() || k.sd > 100.0) {
        return Vec::new();
    }
    let covariance = pair.map(|r| pair.map(|c| posterior.log_covariance[r][c]));
    let after = JointGaussian {
        name: "posterior: 50 % and 95 %".to_owned(),
        mean: known.map(|k| k.mean),
        covariance,
        before: false,
    };
    let priors = pair.map(|n| prior_of(&estimate.prior[n]));
    let before = if let [Some(x), Some(y)] = priors {
        let both = prior_correlation(&estimate.prior, a, b) * x.sd * y.sd;
        let covariance = [[x.sd * x.sd, both], [both, y.sd * y.sd]];
        Some(JointGaussian {
            name: "prior: 50 % and 95 %".to_owned(),
            mean: [x.mean, y.mean],
            covariance,
            before: true,
        })
    } else {
        None
    };
    let direction = pair.map(|n| posterior.identifiability.valley[n]);
    let in_plane = direction[0].hypot(direction[1]) >= IN_PLANE;
    let valley = in_plane.then_some(Valley { through: after.mean, direction });
    let names = pair.map(|n| tissue_name(tissue_of(&posterior.names[n]).unwrap_or_default()));
    let truth = match pair.map(|n| true_value(&posterior.names[n], truth)) {
        [Some(x), Some(y)] => Some([x, y]),
        _ => None,
    };
    let correlation = covariance[0][1] / (known[0].sd * known[1].sd);
    let [first, second] = names.each_ref().map(String::as_str);
    let said = pair.map(|n| interval(&posterior.names[n], posterior.interval_95[n]));
    let sentence = format!(
        "Contours of the posterior over the shear moduli: {first} {}, {second} {}, correlation {}",
        said[0],
        said[1],
        number(correlation, 2)
    );
    let narrow = priors.iter().zip(&known).all(|(prior, known)| prior.is_some_and(|p| known.sd < NARROW * p.sd));
    let whole = JointChart {
        description: format!("{sentence}; with the prior's, on logarithmic axes"),
        labels: [first, second].map(|name| format!("shear modulus of {name} (Pa)")),
        gaussians: before.into_iter().chain([after.clone()]).collect(),
        valley: valley.clone(),
        truth,
        percent_of: None,
    };
    let modes = pair.map(|n| pa(posterior.mode[n]));
    let near = |share: f64| known.iter().all(|k| (Z_95 * k.sd).exp_m1() < share);
    let alone = JointChart {
        description: format!("{sentence}; in per cent of the most probable moduli"),
        labels: [(first, &modes[0]), (second, &modes[1])].map(|(name, mode)| format!("{name}: % off {mode} Pa")),
        gaussians: vec![after.clone()],
        valley,
        // A truth that is many intervals away would shrink the contours again.
        truth: truth.filter(|t| (0..2).all(|n| (t[n].ln() - known[n].mean).abs() < 4.0 * known[n].sd)),
        percent_of: Some(after.mean),
    };
    if narrow && near(1.0) { vec![whole, alone] } else { vec![whole] }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::experiment::estimate::{Convergence, Identifiability, Knowledge, Posterior};
    use crate::experiment::verdict::{Finding, Verdict};

    /// Two moduli: modes, standard deviations of the logarithms, and their correlation.
    pub(in crate::report) fn estimate(finding: Finding, sd: [f64; 2]) -> EstimateOutcome {
        let names = ["grey_matter", "white_matter"].map(|tissue| format!("shear_modulus_pa of {tissue}"));
        let mode = [1370.0, 990.0];
        let both = -0.8 * sd[0] * sd[1];
        let at = |n: usize, z: f64| mode[n] * (z * sd[n]).exp();
        let prior = |name: &String| LogPrior {
            name: name.clone(),
            mean: 6.5,
            sd: Some(0.9),
            scale: Scale::Logarithm,
            correlation: Vec::new(),
            average: None,
        };
        let claims = (0..2).map(|n| {
            let claim = match finding {
                Finding::NoShift => Claim::Above { bound_pa: 4321.0 },
                _ => Claim::Interval { mode_pa: mode[n], interval_95_pa: [at(n, -Z_95), at(n, Z_95)] },
            };
            (tissue_of(&names[n]).unwrap_or_default().to_owned(), claim)
        });
        EstimateOutcome {
            prior: names.iter().map(prior).collect(),
            posterior: Posterior {
                mode: mode.to_vec(),
                log_sd: sd.to_vec(),
                interval_95: (0..2).map(|n| [at(n, -Z_95), at(n, Z_95)]).collect(),
                log_covariance: vec![vec![sd[0] * sd[0], both], vec![both, sd[1] * sd[1]]],
                identifiability: Identifiability {
                    verdicts: vec![Knowledge::Identified; 2],
                    sensitivity_correlation: vec![vec![1.0, 0.9], vec![0.9, 1.0]],
                    condition: 20.0,
                    valley: vec![0.6, -0.8],
                    valley_log_sd: 0.5,
                },
                names: names.to_vec(),
            },
            taught_by: None,
            fluid: None,
            ventricles: None,
            model_log_sd: 0.0,
            mesh_log_sd: Vec::new(),
            body_log_sd: 0.0,
            observations: 300,
            independent_observations: 100.0,
            noise_mm: 0.1,
            residual_rms_mm: 0.1,
            taken_out_rms_mm: None,
            rigid_taken_up: None,
            convergence: Convergence::StepBelowTolerance,
            solves: 5,
            tangent_solves: 8,
            limits: Vec::new(),
            verdict: Verdict::new(finding, None, claims.collect(), Vec::new()),
            unexplained: None,
            measured_noise: None,
            odds: None,
            shift: None,
            rigid_remainder_mm: None,
            outline_mm: None,
            falx_mm: None,
            falx_edge_mm: None,
            base_edge_mm: None,
        }
    }

    #[test]
    fn an_estimate_shows_both_moduli_before_and_after_and_both_at_once() {
        let truth = BTreeMap::from([("grey_matter".to_owned(), 1370.0), ("white_matter".to_owned(), 990.0)]);
        let html = figures(&estimate(Finding::Identified, [0.3, 0.25]), &truth).into_string();
        assert_eq!(html.matches("<svg").count(), 3, "one for each modulus, one for both");
        // 1370 exp(-1.96 * 0.3) and 1370 exp(1.96 * 0.3).
        assert!(html.contains("posterior, 95 %: 761 to 2,470 Pa") && html.contains("what went in: 1,370 Pa"), "{html}");
        assert!(html.contains("correlation \u{2212}0.80") && html.contains("valley"));
    }

    #[test]
    fn a_posterior_that_is_a_dot_beside_its_prior_is_shown_by_itself_too() {
        let html = figures(&estimate(Finding::Identified, [0.003, 0.004]), &BTreeMap::new()).into_string();
        assert_eq!(html.matches("<svg").count(), 4);
        assert!(html.contains("grey matter: % off 1,370 Pa"));
    }

    #[test]
    fn what_is_withheld_is_not_drawn_and_a_bound_is() {
        let html = figures(&estimate(Finding::NoShift, [0.3, 0.25]), &BTreeMap::new()).into_string();
        assert_eq!(html.matches("<svg").count(), 2);
        assert!(!html.contains("posterior, 95 %") && html.contains("with 95 % certainty above 4,320 Pa"), "{html}");
    }
}

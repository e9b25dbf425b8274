//! The estimate: most probable moduli with their intervals, and what the data can tell apart.

use super::super::html::{fixed, number};
use super::posterior::figures;
use super::results::{Row, table, words};
use crate::experiment::compare::{Candidate, Comparison};
use crate::experiment::estimate::{EstimateOutcome, Knowledge, Scale};
use crate::experiment::parameter_name::{in_words, with_unit};
use crate::experiment::verdict::{Claim, Finding, Verdict};
use maud::{Markup, html};
use std::collections::BTreeMap;

/// The section's body; with the models that were tried, where there were several, with the moduli (Pa) that went into a
/// reference, and with pictures of what is left of what was seen.
pub fn section(
    estimate: &EstimateOutcome,
    models: Option<&Comparison>,
    truth: &BTreeMap<String, f64>,
    residuals: Option<Markup>,
) -> Markup {
    let claimed = estimate.verdict.finding.has_stiffness();
    let still = estimate.verdict.finding == Finding::NoShift;
    let posterior = &estimate.posterior;
    let head = ["Parameter", "Most probable", "95 % interval", "Prior 95 %", "What the data say"].map(str::to_owned);
    let row = |n: usize| -> Row {
        let [low, high] = posterior.interval_95[n];
        let prior = &estimate.prior[n];
        let before = prior.sd.map_or("none".to_owned(), |sd| {
            let at = |z: f64| number(prior.scale.value(prior.mean + z * sd), 4);
            format!("{} to {}", at(-1.96), at(1.96))
        });
        let verdict = match posterior.identifiability.verdicts[n] {
            Knowledge::Identified => "identified",
            Knowledge::PriorDominated => "little: the interval is the prior's",
            Knowledge::NotIdentifiable => "not identifiable",
            Knowledge::Widened => "narrowed, less than the measurement would: the model leaves something unexplained",
            Knowledge::Averaged => "averaged over models that cannot be told apart",
            Knowledge::Withheld => withheld(&estimate.verdict, &posterior.names[n]),
        };
        let cells = [
            with_unit(&posterior.names[n]),
            if claimed { number(posterior.mode[n], 5) } else { "–".to_owned() },
            if claimed { format!("{} to {}", number(low, 5), number(high, 5)) } else { "–".to_owned() },
            before,
            verdict.to_owned(),
        ];
        (false, words(cells))
    };
    let rows: Vec<Row> = (0..posterior.names.len()).map(row).collect();
    let panel = &posterior.identifiability;
    let pair = |(name, along): (&String, &f64)| format!("{} {}", in_words(name).0, number(*along, 2));
    let direction: Vec<String> = posterior.names.iter().zip(&panel.valley).map(pair).collect();
    html! {
        (table("Estimate", &head, &rows))
        @if let Some(fluid) = &estimate.fluid {
            p { "Fluid: " (fluid.sentence()) ". Tissue above its level has its own weight, tissue below it is buoyant." }
        }
        @if let Some(ventricles) = &estimate.ventricles {
            p { "A check on load and pressure: " (ventricles.sentence()) "." }
        }
        (figures(estimate, truth))
        @if let Some(models) = models { (table_of_models(models)) }
        p {
            @if still { "Residual at rest " } @else { "Residual " }
            (number(estimate.residual_rms_mm, 3)) " mm over " (estimate.observations) " observations ("
            (number(estimate.independent_observations, 3)) " of them independent), each known to "
            (number(estimate.noise_mm, 3)) " mm. " (estimate.solves) " equilibria and " (estimate.tangent_solves)
            " tangent solves."
        }
        @if let Some(residuals) = residuals {
            div class="residuals" {
                h3 { "Where the model and what was seen differ" }
                p {
                    "The body seen through. A square for each node that the estimate was held against, in the colour of what the \
                     model leaves of its displacement, paler the farther away; lines lead from some of them along it, ten times \
                     as far. What points one way over a whole region speaks of a load or a support that the model has not."
                }
                (residuals)
            }
        }
        @if let Some(taken_out) = estimate.taken_out_rms_mm {
            p {
                "The registration's own error, " (number(taken_out, 3))
                " mm, was measured on " @if still { "a state of the model" } @else { "the estimate's state" }
                " and taken out of what it saw."
            }
        }
        // Of what has not moved there is no minimum, nor a valley about it.
        @if posterior.names.len() > 1 && !still {
            p {
                "Correlation of the first two sensitivities " (number(panel.sensitivity_correlation[0][1], 3))
                "; condition number " (number(panel.condition, 3)) ". The cost has its valley along ("
                (direction.join(", ")) "), where the data alone leave a standard deviation of "
                (number(panel.valley_log_sd, 2)) (counted_by(estimate)) "."
            }
        }
        @if !estimate.limits.is_empty() {
            h3 { "What limits it" }
            ul { @for limit in &estimate.limits { li { (limit) } } }
        }
    }
}

/// Why no figure of this parameter is an answer.
fn withheld(verdict: &Verdict, name: &str) -> &'static str {
    let tissue = name.strip_prefix("shear_modulus_pa of ");
    let bounded = |(of, claim): &(String, Claim)| tissue == Some(of.as_str()) && matches!(claim, Claim::Above { .. });
    match verdict.finding {
        Finding::NoShift if verdict.moduli.iter().any(bounded) => "no shift seen: a bound alone",
        Finding::NoShift => "no shift seen",
        Finding::ModelsDisagree => "withheld: another model, about as probable, claims no stiffness",
        _ => "withheld: the model does not stand",
    }
}

/// By what the parameters of the valley count: most by their logarithm, some as they are.
fn counted_by(estimate: &EstimateOutcome) -> String {
    let posterior = &estimate.posterior;
    let along = |n: &usize| posterior.identifiability.valley[*n].abs() >= SHOWN;
    let of = |scale: Scale| -> Vec<String> {
        let these = (0..posterior.names.len()).filter(along).filter(|n| estimate.prior[*n].scale == scale);
        these.map(|n| in_words(&posterior.names[n]).0).collect()
    };
    let words =
        [(Scale::Plain, "as it is"), (Scale::Angle, "in radians"), (Scale::Share, "by the logarithm of its odds")];
    let others: Vec<String> =
        words.iter().flat_map(|(scale, how)| of(*scale).into_iter().map(move |name| format!("{name} {how}"))).collect();
    match (of(Scale::Logarithm).is_empty(), others.is_empty()) {
        (_, true) => " in the logarithm".to_owned(),
        (true, false) => format!(", which counts {}", others.join(", ")),
        (false, false) => format!(", which counts {}, the others by their logarithm", others.join(", ")),
    }
}

/// The least share of a valley's direction that two decimals show.
const SHOWN: f64 = 0.005;

/// What was tried, the most probable first.
fn table_of_models(models: &Comparison) -> Markup {
    let head = ["Model", "Log odds", "Weight", "Explained", "What it comes down to"].map(str::to_owned);
    let best = models.candidates.first().map_or(0.0, |c| c.log_evidence);
    let row = |(n, c): (usize, &Candidate)| -> Row {
        let cells = [
            c.name.clone(),
            fixed(c.log_evidence - best, 1),
            fixed(c.weight, 3),
            c.explained().map_or_else(|| "–".to_owned(), |share| format!("{} %", fixed(100.0 * share, 0))),
            c.finding.short().to_owned(),
        ];
        (n == 0, words(cells))
    };
    let rows: Vec<Row> = models.candidates.iter().enumerate().map(row).collect();
    table("Models", &head, &rows)
}

#[cfg(test)]
mod tests {
    use super::super::posterior::tests::estimate;
    use super::*;

    #[test]
    fn what_is_withheld_says_why_and_a_model_that_stands_is_not_said_to_fall() {
        let shown = |finding| {
            let mut found = estimate(finding, [0.3, 0.25]);
            found.posterior = found.posterior.withheld();
            section(&found, None, &BTreeMap::new(), None).into_string()
        };
        let falls = "withheld: the model does not stand";
        for finding in [Finding::Conflict, Finding::Unexplained] {
            assert_eq!(shown(finding).matches(falls).count(), 2);
        }
        let still = shown(Finding::NoShift);
        assert!(still.matches("no shift seen: a bound alone").count() == 2 && !still.contains(falls), "{still}");
        assert!(still.contains("Residual at rest 0.100 mm") && !still.contains("valley along"), "{still}");
        let rival = shown(Finding::ModelsDisagree);
        assert!(rival.contains("about as probable, claims no stiffness") && !rival.contains(falls), "{rival}");
        assert_eq!(
            withheld(&estimate(Finding::NoShift, [0.3; 2]).verdict, "effective density_kg_per_m3"),
            "no shift seen"
        );
    }

    #[test]
    fn a_model_that_saw_no_shift_explains_no_share_of_it() {
        let candidate = |finding, explained_share| Candidate {
            name: "supports sliding".to_owned(),
            log_evidence: -10.0,
            weight: 0.5,
            finding,
            explained_share,
            moduli_pa: Vec::new(),
        };
        let candidates = vec![candidate(Finding::Identified, 0.86), candidate(Finding::NoShift, 0.0)];
        let html =
            table_of_models(&Comparison { candidates, log_odds: None, verdict: Verdict::default() }).into_string();
        assert!(html.contains("<td>86 %</td>") && html.contains("<td>–</td>") && !html.contains("<td>0 %"), "{html}");
    }
}

//! The estimate: most probable moduli with their intervals, and what the data can tell apart.

use super::super::html::{escape, number};
use super::results::table;
use crate::experiment::estimate::{EstimateOutcome, Knowledge};
use std::fmt::Write;

/// The section's body.
pub fn section(estimate: &EstimateOutcome) -> String {
    let posterior = &estimate.posterior;
    let head = ["Parameter", "Most probable", "95 % interval", "Prior 95 %", "What the data say"].map(str::to_owned);
    let row = |n: usize| {
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
            Knowledge::Withheld => "withheld: the model does not stand",
        };
        let cells = vec![
            escape(&posterior.names[n].replace('_', " ")),
            number(posterior.mode[n], 5),
            format!("{} to {}", number(low, 4), number(high, 4)),
            before,
            verdict.to_owned(),
        ];
        (false, cells)
    };
    let rows: Vec<_> = (0..posterior.names.len()).map(row).collect();
    let mut html = table("Estimate", &head, &rows);
    let _ = write!(
        html,
        "<p>Residual {} mm over {} observations ({} of them independent), each known to {} mm. {} equilibria and {} \
         tangent solves.</p>",
        number(estimate.residual_rms_mm, 3),
        estimate.observations,
        number(estimate.independent_observations, 3),
        number(estimate.noise_mm, 3),
        estimate.solves,
        estimate.tangent_solves
    );
    if let Some(taken_out) = estimate.taken_out_rms_mm {
        let _ = write!(
            html,
            "<p>The registration's own error, {} mm, was measured on the estimate's state and taken out of what it saw.</p>",
            number(taken_out, 3)
        );
    }
    let panel = &posterior.identifiability;
    if posterior.names.len() > 1 {
        let direction: Vec<String> = posterior
            .names
            .iter()
            .zip(&panel.valley)
            .map(|(name, v)| format!("{} {}", escape(&name.replace('_', " ")), number(*v, 2)))
            .collect();
        let _ = write!(
            html,
            "<p>Correlation of the first two sensitivities {}; condition number {}. The cost has its valley along \
             ({}), where the data alone leave a standard deviation of {} in the logarithm.</p>",
            number(panel.sensitivity_correlation[0][1], 3),
            number(panel.condition, 3),
            direction.join(", "),
            number(panel.valley_log_sd, 2)
        );
    }
    if !estimate.limits.is_empty() {
        html += "<h3>What limits it</h3><ul>";
        for limit in &estimate.limits {
            let _ = write!(html, "<li>{}</li>", escape(limit));
        }
        html += "</ul>";
    }
    html
}

//! What was found in a few lines of text.

use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::outcome::{ExperimentOutcome, SampleOutcome};
use crate::experiment::resection::improvement;

/// Best sample, errors and verdicts.
pub fn summary(outcome: &ExperimentOutcome) -> String {
    let mut text = format!("{}\n", outcome.verdict.sentence);
    let floor = outcome.noise_floor.unwrap_or_default();
    if let Some(best) = outcome.best().filter(|_| outcome.verdict.finding.has_stiffness()) {
        let moduli: Vec<String> = best.shear_modulus_pa.iter().map(|(t, m)| format!("{t} {m:.0} Pa")).collect();
        text += &format!("best sample {} ({})\n", best.id, moduli.join(", "));
    }
    if let Some(best) = outcome.best() {
        for (set, deformed) in &best.rmse_mm {
            let rest = outcome.rest_rmse_mm.get(set).copied().unwrap_or(f64::NAN);
            let verdict = improvement(rest, *deformed, &floor);
            text += &format!("RMSE at {set}: rest {rest:.3} mm, deformed {deformed:.3} mm: {verdict}\n");
        }
    }
    if let Some(floor_mm) = floor.combined_mm() {
        text += &format!("noise floor {floor_mm:.3} mm\n");
    }
    text
}

/// Parameters with their intervals, and what limits them.
pub fn estimate_table(estimate: &EstimateOutcome) -> String {
    let EstimateOutcome { posterior, noise_mm, residual_rms_mm, taken_out_rms_mm, tangent_solves, limits, .. } =
        estimate;
    let mut text = format!("{}\n", estimate.verdict.sentence);
    let shown = estimate.verdict.finding.has_stiffness();
    if shown {
        text += "parameter                            mode   95 % interval\n";
    }
    for (n, name) in posterior.names.iter().enumerate().filter(|_| shown) {
        let [low, high] = posterior.interval_95[n];
        text += &format!("{name:<32} {:>8.1}   {low:.1} to {high:.1}\n", posterior.mode[n]);
    }
    text += &format!(
        "residual {residual_rms_mm:.4} mm, noise {noise_mm:.3} mm, {tangent_solves} tangent solves, condition {:.1}\n",
        posterior.identifiability.condition
    );
    if let Some(taken_out) = taken_out_rms_mm {
        text += &format!("registration's own error, {taken_out:.3} mm, measured on the estimate and taken out\n");
    }
    for limit in limits {
        text += &format!("limit: {limit}\n");
    }
    text
}

/// Rest against the estimate's state at every set.
pub fn comparison(outcome: &ExperimentOutcome, estimate: &SampleOutcome) -> String {
    let floor = outcome.noise_floor.unwrap_or_default();
    let mut text = String::new();
    for (set, deformed) in &estimate.rmse_mm {
        let rest = outcome.rest_rmse_mm.get(set).copied().unwrap_or(f64::NAN);
        text += &format!(
            "RMSE at {set}: rest {rest:.3} mm, estimate {deformed:.3} mm: {}\n",
            improvement(rest, *deformed, &floor)
        );
    }
    text
}

/// A phantom's samples with their errors; which is best, and which is nearest to what went in.
pub fn phantom_summary(outcome: &ExperimentOutcome, nearest: Option<&str>) -> String {
    let mut text = String::from("sample                  shear modulus (Pa)          RMSE (mm)\n");
    for sample in &outcome.samples {
        let moduli: Vec<String> = sample.shear_modulus_pa.values().map(|m| format!("{m:.1}")).collect();
        let rmse = sample.rmse_mm.get("all").map_or("no equilibrium".to_owned(), |r| format!("{r:.6}"));
        let mark = if outcome.best_sample.as_deref() == Some(&sample.id) { "  best" } else { "" };
        let near = if nearest == Some(sample.id.as_str()) { "  nearest to the reference" } else { "" };
        text += &format!("{:<23} {:<27} {rmse}{mark}{near}\n", sample.id, moduli.join(" / "));
    }
    text
}

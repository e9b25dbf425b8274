//! What was found in a few lines of text.

use super::html::INFINITE;
use super::page::expected_in_a_sentence;
use crate::experiment::compare::Comparison;
use crate::experiment::estimate::{EstimateOutcome, Scale};
use crate::experiment::landmarks::Evaluation;
use crate::experiment::outcome::{ESTIMATE, ExperimentKind, ExperimentOutcome};
use crate::experiment::predict::{Prediction, TargetPlace};
use crate::experiment::resection::improvement;
use crate::experiment::verdict::{Claim, Finding};
use crate::experiment::verdict_of_samples::nearest_to_reference;
use crate::material::law::StabilityRange;
use crate::material::meta_model::Fit;
use std::path::Path;

/// What was carried; `points`: all, in removed tissue, beyond the field.
pub fn warped(output: &Path, kind: &str, state: &str, points: Option<[usize; 3]>) -> String {
    let text = format!("{}: {kind}, carried by {state}", output.display());
    let Some([all, removed, outside]) = points else { return text };
    // A field of the user's own has no rigid part.
    let how = if state == "field" { "not moved" } else { "moved rigidly alone" };
    let rigidly = |count: usize, place: &str| match count {
        0 => String::new(),
        n => format!("; {n} of them {place}: {how}"),
    };
    text + &format!(", {all} points{}{}", rigidly(removed, "in removed tissue"), rigidly(outside, "beyond the field"))
}

/// A row for each way of carrying landmarks, then one for each landmark.
pub fn landmark_table(found: &Evaluation) -> String {
    let mut text = String::from("carried by     landmarks  mean (mm)  median  95 %   inside 95 % sphere\n");
    for s in &found.summary {
        let inside = s.inside_95_share.map_or_else(|| "-".to_owned(), |share| format!("{:.0} %", 100.0 * share));
        text += &format!(
            "{:<14} {:>9}  {:>9.2}  {:>6.2}  {:>5.2}  {inside}\n",
            s.state, s.landmarks, s.mean_mm, s.median_mm, s.percentile_95_mm
        );
    }
    text += "\nlandmark       place      error (mm) of each, in that order\n";
    for l in &found.landmarks {
        let errors: Vec<String> = l.error_mm.iter().map(|e| format!("{e:>7.2}")).collect();
        text += &format!("{:<14} {:<9} {}\n", l.name, l.place, errors.join(" "));
    }
    let counted = found.summary.first().map_or(0, |s| s.landmarks);
    if counted < found.landmarks.len() {
        text += &format!(
            "\n{} of them outside or in removed tissue: not in the summary\n",
            found.landmarks.len() - counted
        );
    }
    if !found.left_out.is_empty() {
        text += &format!("\nin one of the two files alone, not compared: {}\n", found.left_out.join(", "));
    }
    text
}

/// The headline of a prediction, a row for each head, then one for each target.
pub fn prediction_table(found: &Prediction) -> String {
    let mut text = expected_in_a_sentence(found) + "\n";
    text += "head         largest (mm)  median   SD    95 % reach  over the threshold (cc)\n";
    for h in &found.heads {
        text += &format!(
            "{:<12} {:>12.2}  {:>6.2}  {:>5.2}  {:>9.2}  {:>8.1}\n",
            h.head, h.largest_mm, h.median_mm, h.sd_median_mm, h.reach95_largest_mm, h.over_threshold_cc
        );
    }
    for (head, fluid) in found.heads.iter().filter_map(|h| Some((&h.head, h.fluid.as_ref()?))) {
        text += &format!(
            "fluid {} mm below the brain's highest point with the head {head}: {} drained\n",
            fluid.below_top_mm,
            fluid.drained_in_words()
        );
    }
    for h in found.heads.iter().filter(|h| !h.targets.is_empty()) {
        // As wide as the longest name.
        let width = h.targets.iter().map(|t| t.called().chars().count()).max().unwrap_or(0).max(8);
        text += &format!(
            "\ntarget (head {})  expected at (mm)            shift (mm)  SD    P(over {} mm)\n",
            h.head, found.threshold_mm
        );
        for t in &h.targets {
            let [x, y, z] = t.expected_mm;
            text += &match t.place {
                TargetPlace::Removed => format!("{:<width$} {:<8} is to be taken\n", t.called(), t.place.name()),
                _ => format!(
                    "{:<width$} {:<8} {x:>8.1} {y:>8.1} {z:>8.1}  {:>9.2}  {:>5.2}  {:>6.2}\n",
                    t.called(),
                    t.place.name(),
                    t.shift_mm,
                    t.sd_mm,
                    t.over_threshold
                ),
            };
        }
    }
    text
}

/// What a job has found: the verdict, then the figures behind it.
pub fn summary(outcome: &ExperimentOutcome) -> String {
    let mut text = format!("{}\n", outcome.verdict.sentence);
    if outcome.kind == ExperimentKind::Phantom && outcome.estimate.is_none() {
        return text + &phantom_table(outcome);
    }
    let floor = outcome.noise_floor.unwrap_or_default();
    if let Some(estimate) = &outcome.estimate {
        text += &estimate_figures(estimate);
        text += &outcome.comparison.as_ref().map_or_else(String::new, models_table);
    }
    if let Some(judged) = outcome.judged() {
        let state = if judged.id == ESTIMATE { "estimate" } else { "deformed" };
        for (set, deformed) in &judged.rmse_mm {
            let against = outcome.rest_rmse_mm.get(set).map_or_else(String::new, |rest| {
                format!("rest {rest:.3} mm, {state} {deformed:.3} mm: {}", improvement(*rest, *deformed, &floor))
            });
            let alone = || format!("{state} {deformed:.3} mm");
            text += &format!("RMSE at {set}: {}\n", if against.is_empty() { alone() } else { against });
        }
        let claimed = outcome.verdict.moduli.iter().any(|(_, claim)| *claim != Claim::Withheld);
        if outcome.estimate.is_none() && outcome.verdict.finding.has_stiffness() && claimed {
            text += &format!("best sample {}\n", judged.id);
        }
    }
    if let Some(floor_mm) = floor.combined_mm() {
        text += &format!("noise floor {floor_mm:.3} mm\n");
    }
    text
}

/// The models that were tried, the most probable first.
pub fn models_table(comparison: &Comparison) -> String {
    let best = comparison.candidates.first().map_or(0.0, |c| c.log_evidence);
    let mut text =
        String::from("model                                              log odds  weight  explained  finding\n");
    for c in &comparison.candidates {
        let (odds, finding) = (c.log_evidence - best, c.finding.short());
        let share = c.explained().map_or_else(|| "-".to_owned(), |share| format!("{:.0} %", 100.0 * share));
        text += &format!("{:<49} {odds:>9.1} {:>7.3} {share:>10}  {finding}\n", c.name, c.weight);
    }
    text
}

/// Parameters with their intervals, and what limits them.
fn estimate_figures(estimate: &EstimateOutcome) -> String {
    let EstimateOutcome { posterior, noise_mm, residual_rms_mm, taken_out_rms_mm, tangent_solves, limits, .. } =
        estimate;
    let mut text = String::new();
    let shown = estimate.verdict.finding.has_stiffness();
    if shown {
        text += "parameter                            mode   95 % interval\n";
    }
    for (n, name) in posterior.names.iter().enumerate().filter(|_| shown) {
        let [low, high] = posterior.interval_95[n];
        let digits = if estimate.prior[n].scale == Scale::Share { 3 } else { 1 };
        text += &format!("{name:<32} {:>8.digits$}   {low:.digits$} to {high:.digits$}\n", posterior.mode[n]);
    }
    if let Some(fluid) = &estimate.fluid {
        text += &format!("fluid: {}\n", fluid.sentence());
    }
    if let Some(ventricles) = &estimate.ventricles {
        text += &format!("check: {}\n", ventricles.sentence());
    }
    // Of what has not moved the state is rest: no moduli have led there, whose condition there would be to tell.
    let still = estimate.verdict.finding == Finding::NoShift;
    let (at, on) = if still { (" at rest", "a state of the model") } else { ("", "the estimate") };
    let condition = format!(", condition {}", condition_in_words(posterior.identifiability.condition));
    text += &format!(
        "residual{at} {residual_rms_mm:.4} mm, noise {noise_mm:.3} mm, {tangent_solves} tangent solves{}\n",
        if still { "" } else { &condition }
    );
    if let Some(taken_out) = taken_out_rms_mm {
        text += &format!("registration's own error, {taken_out:.3} mm, measured on {on} and taken out\n");
    }
    for limit in limits {
        text += &format!("limit: {limit}\n");
    }
    text
}

/// A condition number for the terminal.
fn condition_in_words(condition: f64) -> String {
    if condition > INFINITE { "infinite".to_owned() } else { format!("{condition:.1}") }
}

/// A phantom's samples with their errors; which is best, and which is nearest to what went in.
fn phantom_table(outcome: &ExperimentOutcome) -> String {
    let nearest = nearest_to_reference(outcome).map(|sample| &sample.id);
    let mut text = String::from("sample                  shear modulus (Pa)          RMSE (mm)\n");
    for sample in &outcome.samples {
        let moduli: Vec<String> = sample.shear_modulus_pa.values().map(|m| format!("{m:.1}")).collect();
        let rmse = sample.rmse_mm.get("all").map_or("no equilibrium".to_owned(), |r| format!("{r:.6}"));
        let mark = if outcome.best_sample.as_ref() == Some(&sample.id) { "  best" } else { "" };
        let near = if nearest == Some(&sample.id) { "  nearest to the reference" } else { "" };
        text += &format!("{:<23} {:<27} {rmse}{mark}{near}\n", sample.id, moduli.join(" / "));
    }
    text
}

/// A law fitted to a curve: its parameters with their standard deviations, how well it fits and where it is stable.
pub fn fit_in_words(fit: &Fit, names: &[&str], sd: &[f64]) -> String {
    let mut text = format!("\n{:<14}", fit.model.name());
    for ((name, value), sd) in names.iter().zip(&fit.parameters).zip(sd) {
        let bound = if fit.at_bound.iter().any(|b| b == name) { " (at its bound)" } else { "" };
        text += &format!("{name} = {value:.4} (sd {sd:.3}){bound}  ");
    }
    let search = if fit.converged { "" } else { ", the search did not converge" };
    let (modulus_pa, r2, cost) = (fit.shear_modulus_pa, fit.r_squared, fit.cost);
    text += &format!("\n{:<14}shear modulus {modulus_pa:.1} Pa, R2 {r2:.4}, cost {cost:.4}{search}\n", "");
    text + &format!("{:<14}{}\n", "", stability_in_words(fit))
}

fn stability_in_words(fit: &Fit) -> String {
    if fit.stability.everywhere() {
        return "stable at every stretch: energy grows, energy is convex, true stress rises".to_owned();
    }
    let where_ = |range: StabilityRange| match range {
        StabilityRange::Everywhere => "at every stretch",
        StabilityRange::Window => "in the window only",
        StabilityRange::Nowhere => "not even in the window",
    };
    format!(
        "energy grows {}, is convex {}, true stress rises {}",
        where_(fit.stability.energy_grows),
        where_(fit.stability.convex),
        where_(fit.stability.true_stress_rises)
    )
}

#[cfg(test)]
mod tests {
    use super::super::page::estimate_of_two;
    use super::*;

    #[test]
    fn without_a_shift_the_figures_are_those_of_rest() {
        let said = |finding| estimate_figures(&estimate_of_two(finding, [0.3, 0.25]));
        let still = said(Finding::NoShift);
        assert!(still.contains("residual at rest 0.1000 mm") && !still.contains("condition"), "{still}");
        let moved = said(Finding::Identified);
        assert!(moved.contains("residual 0.1000 mm") && moved.contains("condition 20.0"), "{moved}");
    }

    #[test]
    fn a_condition_that_is_infinite_is_told_in_a_word() {
        assert_eq!((condition_in_words(5.14), condition_in_words(f64::MAX)), ("5.1".into(), "infinite".into()));
    }
}

//! The first screen: the verdict in a sentence, slices through the cavity, four numbers.

use super::super::chart::colour_bar;
use super::super::glance_figure::GlanceFigure;
use super::super::html::{fixed, number};
use super::brain_shift::left_out;
use super::parts::{legend, quantity, tile, tile_figure};
use super::results::{modulus, set_name};
use crate::experiment::field::BrainShift;
use crate::experiment::outcome::{ExperimentOutcome, ResectionVolumes};
use maud::{Markup, PreEscaped, html};

/// As many numbers as a glance takes in.
const NUMBERS: usize = 4;

/// The block above all sections; the shift's own noise floor is told beside its colours.
pub fn block(outcome: Option<&ExperimentOutcome>, figure: Option<&GlanceFigure>, shift: Option<&BrainShift>) -> Markup {
    let tiles = outcome.map(|outcome| numbers(outcome, shift)).unwrap_or_default();
    html! {
        div class="glance" id="glance" {
            @if let Some(outcome) = outcome {
                p class="verdict" id="verdict" data-finding=(outcome.verdict.finding.short()) {
                    (outcome.verdict.sentence)
                } "\n"
            }
            @if let Some(figure) = figure { (slices(figure)) }
            @if !tiles.is_empty() { dl class="figures" { @for tile in tiles { (tile) } } "\n" }
        } "\n"
    }
}

fn slices(figure: &GlanceFigure) -> Markup {
    let what = figure.scale.as_ref().map_or("before surgery", |scale| scale.title.as_str());
    html! {
        div class="tiles" { @for tile in &figure.tiles { (tile_figure(tile, &["image", "image"], what)) } }
        div class="key" {
            (legend(&figure.structures))
            @if let Some(scale) = &figure.scale { div class="bar-row" { (PreEscaped(colour_bar(scale))) } }
        } "\n"
    }
}

/// The numbers that matter most, the first ones first.
fn numbers(outcome: &ExperimentOutcome, shift: Option<&BrainShift>) -> Vec<Markup> {
    let verdict = &outcome.verdict;
    let mut tiles: Vec<Markup> = verdict.moduli.iter().filter_map(|(tissue, claim)| modulus(tissue, claim)).collect();
    let simulated = !outcome.samples.is_empty();
    if tiles.is_empty() && simulated {
        tiles.push(tile("Shear modulus", &html! { "–" }, "not claimed"));
    }
    if let Some(share) = verdict.explained_share {
        let value = html! { (fixed(100.0 * share, 0)) span class="unit" { " %" } };
        tiles.push(tile("Explained by the model", &value, "of the seen shift, without the registration's own error"));
    }
    tiles.extend(errors(outcome));
    if let Some(state) = shift.and_then(|shift| shift.states.first()) {
        let left_out = left_out(state).map_or_else(String::new, |what| format!("; {what}"));
        let note = format!("{} mm in the median, state {}{left_out}", number(state.median_mm, 2), state.state);
        tiles.push(tile("Largest displacement", &quantity(Some(state.largest_mm), 2, "mm"), &note));
    }
    let floor = outcome.noise_floor.and_then(|floor| floor.combined_mm());
    tiles
        .extend(floor.map(|mm| tile("Noise floor", &quantity(Some(mm), 2, "mm"), "differences below it mean nothing")));
    tiles.extend(outcome.volumes.iter().flat_map(volumes));
    tiles.truncate(NUMBERS);
    tiles
}

/// The error of the judged state at the margin, or over all nodes of a phantom.
fn errors(outcome: &ExperimentOutcome) -> Option<Markup> {
    let judged = outcome.judged()?;
    let set = ["margin", "all"].into_iter().find(|set| judged.rmse_mm.contains_key(*set))?;
    let rest = outcome.rest_rmse_mm.get(set).map(|rest| format!("undeformed: {} mm", number(*rest, 3)));
    let name = format!("RMSE, {}", set_name(set));
    Some(tile(&name, &quantity(judged.rmse_mm.get(set).copied(), 3, "mm"), &rest.unwrap_or_default()))
}

fn volumes(v: &ResectionVolumes) -> Vec<Markup> {
    let all = [
        ("Resected tissue", v.resected_cc, "on the image before surgery"),
        ("Cavity", v.cavity_cc, "on the image after surgery"),
        ("Ventricles before surgery", v.ventricle_before_cc, ""),
        ("Brain before surgery", v.brain_cc, ""),
    ];
    let shown = all.into_iter().filter(|(_, cc, _)| cc.is_some());
    shown.map(|(name, cc, note)| tile(name, &quantity(cc, 3, "cc"), note)).collect()
}

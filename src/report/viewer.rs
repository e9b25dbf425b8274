//! The 3-D view of the page: surfaces as data, drawn by niivue, which is part of the page.

use super::chart;
use super::colour::{ColourScale, NO_VALUE};
use super::decimation::Decimation;
use super::html::script_json;
use super::linked_slices::LinkedSlices;
use super::swept_states::SweptStates;
use crate::mesh::TriMesh;
use base64::Engine;
use maud::{Markup, PreEscaped, html};

/// niivue 0.69.0 (BSD 2-Clause), the published bundle, compressed; see `assets/PROVENANCE.md`.
const NIIVUE: &[u8] = include_bytes!("assets/niivue-0.69.0.umd.js.gz");
const NIIVUE_LICENCE: &str = include_str!("assets/LICENSE-niivue.txt");
const SCRIPT: &str = include_str!("assets/viewer.js");
const SLICES_SCRIPT: &str = include_str!("assets/slices.js");
const STATES_SCRIPT: &str = include_str!("assets/states.js");

/// Triangles a surface may have on the page; a larger one is decimated, for the page only.
const TRIANGLES_MAX: usize = 60_000;

/// What can be cut away beside the cursor: the sign and the axis, and what it is called.
const CUTS: [(&str, &str); 6] = [
    ("+0", "what is right of the cursor"),
    ("-0", "what is left of it"),
    ("+1", "what is in front of it"),
    ("-1", "what is behind it"),
    ("+2", "what is above it"),
    ("-2", "what is below it"),
];

/// One surface of the view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewedSurface {
    /// Name on its button: `undeformed`, `deformed`, `reference`.
    pub name: String,
    /// The surface.
    pub surface: TriMesh,
    /// One value per node, shown in the view's colour scale; empty: one plain colour.
    pub values: Vec<f64>,
}

/// Surfaces and the colours they share.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewer {
    /// The surfaces; the first coloured one is shown first.
    pub surfaces: Vec<ViewedSurface>,
    /// Colours of the values: exactly their range.
    pub scale: Option<ColourScale>,
    /// The simulated states that a slider moves between.
    pub states: Option<SweptStates>,
    /// The scans, for slices that follow the cursor.
    pub slices: Option<LinkedSlices>,
}

impl Viewer {
    /// The section's content; everything it needs beside the scripts.
    pub(super) fn section(&self) -> Markup {
        let sides = [
            ("left", 90, 0),
            ("right", 270, 0),
            ("anterior", 180, 0),
            ("posterior", 0, 0),
            ("superior", 0, 90),
            ("inferior", 180, -90),
        ];
        html! {
            @if let Some(slices) = &self.slices { (slices.section()) }
            p {
                "Drag to turn, scroll to come nearer; or use the buttons, or the arrow keys with the picture in focus. A click on the \
                 surface moves the cursor there."
            }
            @if self.slices.is_none() { p class="where" { output id="picked" {} } }
            div class="controls" role="group" aria-label="Surface" {
                @for (n, s) in self.surfaces.iter().enumerate() {
                    button type="button" data-surface=(n) aria-pressed=(if n == self.first() { "true" } else { "false" }) { (s.name) }
                }
                @if self.states.is_some() {
                    button type="button" data-surface=(self.surfaces.len()) aria-pressed="false" { "any sample" }
                }
            }
            @if let Some(states) = &self.states { (sliders(states)) }
            div class="controls" role="group" aria-label="Side" {
                @for (side, azimuth, elevation) in sides {
                    button type="button" data-azimuth=(azimuth) data-elevation=(elevation) { (side) }
                }
            }
            div class="controls" {
                span {
                    label for="cut" { "Cut away " }
                    select id="cut" {
                        option value="" { "nothing" }
                        @for (value, what) in CUTS { option value=(value) { (what) } }
                    }
                }
                span class="slider" {
                    label for="opacity" { "Opacity" }
                    input type="range" id="opacity" min="0.2" max="1" step="0.05" value="1";
                }
            }
            div class="stage" id="stage" {
                p class="message" id="stage-message" {
                    "The 3-D view needs JavaScript and WebGL 2; the pictures above show the same data without them."
                }
                canvas id="gl" tabindex="0" role="img"
                    aria-label="Surfaces of the brain in three dimensions; arrow keys turn them" {}
            } "\n"
            @if let Some(scale) = &self.scale {
                div class="bar-row" id="view-bar" data-low=(scale.low) data-high=(scale.high) {
                    (PreEscaped(chart::colour_bar(scale)))
                } "\n"
            }
            @if let Some(states) = &self.states {
                div class="bar-row" id="states-bar" hidden { (PreEscaped(chart::colour_bar(&states.scale))) } "\n"
            }
            details {
                summary { "The viewer is niivue 0.69.0 (BSD 2-Clause)" }
                pre tabindex="0" aria-label="Licence of niivue" { (NIIVUE_LICENCE) }
            } "\n"
        }
    }

    fn first(&self) -> usize {
        self.surfaces.iter().position(|s| !s.values.is_empty()).unwrap_or(0)
    }

    /// Data, library and script, to stand at the end of the page.
    pub(super) fn scripts(&self) -> Markup {
        let base64 = base64::engine::general_purpose::STANDARD;
        let surfaces: Vec<serde_json::Value> = self
            .surfaces
            .iter()
            .map(|s| {
                let small = Decimation::of(&s.surface, TRIANGLES_MAX);
                let plain: Vec<[f64; 1]> = s.values.iter().map(|v| [*v]).collect();
                let values: Vec<f64> = if plain.is_empty() { Vec::new() } else { small.means(&plain).concat() };
                let surface = &small.surface;
                let positions: Vec<u8> =
                    surface.nodes_mm.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()).collect();
                let triangles: Vec<u8> = surface.triangles.iter().flatten().flat_map(|n| n.to_le_bytes()).collect();
                serde_json::json!({
                    "name": s.name,
                    "positions": base64.encode(positions),
                    "triangles": base64.encode(triangles),
                    "colours": base64.encode(self.colours(surface, &values)),
                    "range": ColourScale::over(values.iter().copied(), "").map(|r| [r.low, r.high]),
                })
            })
            .collect();
        let data = script_json(&serde_json::json!({"surfaces": surfaces, "first": self.first()}));
        let states = self.states.as_ref().map(|states| script_json(&states.json()));
        let slices = self.slices.as_ref().map(|slices| script_json(&slices.json()));
        html! {
            script type="application/json" id="view-data" { (PreEscaped(data)) } "\n"
            @if let Some(states) = &states {
                script type="application/json" id="states-data" { (PreEscaped(states)) } "\n"
                script { "\n" (PreEscaped(STATES_SCRIPT)) } "\n"
            }
            @if let Some(slices) = &slices {
                script type="application/json" id="slices-data" { (PreEscaped(slices)) } "\n"
                script { "\n" (PreEscaped(SLICES_SCRIPT)) } "\n"
            }
            script type="text/plain" id="niivue" { (base64.encode(NIIVUE)) } "\n"
            script { "\n" (PreEscaped(SCRIPT)) } "\n"
        }
    }

    fn colours(&self, surface: &TriMesh, values: &[f64]) -> Vec<u8> {
        let plain = [200, 196, 190];
        let colour = |n: usize| match (&self.scale, values.get(n)) {
            (Some(scale), Some(v)) if v.is_finite() => scale.colour(*v),
            (Some(_), Some(_)) => NO_VALUE,
            _ => plain,
        };
        (0..surface.nodes_mm.len())
            .flat_map(|n| {
                let [r, g, b] = colour(n);
                [r, g, b, 255]
            })
            .collect()
    }
}

/// One slider for every way the samples differ, standing on the best one.
fn sliders(states: &SweptStates) -> Markup {
    html! {
        div class="controls sliders" {
            @for (axis, stops) in states.grid.stops.iter().enumerate() {
                span class="slider" {
                    label for={ "states-" (axis) } { (states.grid.label(axis)) }
                    input type="range" class="states" id={ "states-" (axis) } min="0" max=(stops - 1) step="0.1"
                        value=(states.grid.best[axis]) aria-valuetext=(states.said(&states.grid.best));
                }
            }
            output id="states-said" { (states.said(&states.grid.best)) }
        } "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles, values = x.
    fn square() -> (TriMesh, Vec<f64>) {
        let nodes_mm = vec![[0.0; 3], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
        let values = nodes_mm.iter().map(|p: &[f64; 3]| p[0]).collect();
        (TriMesh { nodes_mm, triangles: vec![[0, 1, 2], [0, 2, 3]] }, values)
    }

    #[test]
    fn scripts_hold_no_markup_of_names() {
        let (surface, values) = square();
        let name = "</script><b>".to_owned();
        let scale = ColourScale::over(values.iter().copied(), "RMSE (mm)");
        let surfaces = vec![ViewedSurface { name, surface, values }];
        let viewer = Viewer { surfaces, scale, states: None, slices: None };
        let scripts = viewer.scripts().into_string();
        assert_eq!(scripts.matches("</script").count(), 3);
        let section = viewer.section().into_string();
        assert!(!section.contains("<b>"));
        assert!(section.contains("data-low=\"0\" data-high=\"2\""));
    }
}

//! The 3-D view of the page: surfaces as data, drawn by niivue, which is part of the page.

use super::chart;
use super::colour::{ColourScale, NO_VALUE};
use super::html::script_json;
use crate::mesh::TriMesh;
use base64::Engine;
use maud::{Markup, PreEscaped, html};

/// niivue 0.69.0 (BSD 2-Clause), the published bundle, compressed; see `assets/PROVENANCE.md`.
const NIIVUE: &[u8] = include_bytes!("assets/niivue-0.69.0.umd.js.gz");
const NIIVUE_LICENCE: &str = include_str!("assets/LICENSE-niivue.txt");
const SCRIPT: &str = include_str!("assets/viewer.js");

/// Triangles a surface may have on the page; a larger one is decimated, for the page only.
const TRIANGLES_MAX: usize = 60_000;

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
}

impl Viewer {
    /// The section's content; everything it needs beside the scripts.
    pub(super) fn section(&self) -> Markup {
        let sides = [
            ("left", 270, 0),
            ("right", 90, 0),
            ("anterior", 180, 0),
            ("posterior", 0, 0),
            ("superior", 0, 90),
            ("inferior", 180, -90),
        ];
        html! {
            p { "Drag to turn, scroll to come nearer; or use the buttons, or the arrow keys with the picture in focus." }
            div class="controls" role="group" aria-label="Surface" {
                @for (n, s) in self.surfaces.iter().enumerate() {
                    button type="button" data-surface=(n) aria-pressed=(if n == self.first() { "true" } else { "false" }) { (s.name) }
                }
            }
            div class="controls" role="group" aria-label="Side" {
                @for (side, azimuth, elevation) in sides {
                    button type="button" data-azimuth=(azimuth) data-elevation=(elevation) { (side) }
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
                let (surface, values) = decimated(&s.surface, &s.values, TRIANGLES_MAX);
                let positions: Vec<u8> =
                    surface.nodes_mm.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()).collect();
                let triangles: Vec<u8> = surface.triangles.iter().flatten().flat_map(|n| n.to_le_bytes()).collect();
                serde_json::json!({
                    "name": s.name,
                    "positions": base64.encode(positions),
                    "triangles": base64.encode(triangles),
                    "colours": base64.encode(self.colours(&surface, &values)),
                    "range": ColourScale::over(values.iter().copied(), "").map(|r| [r.low, r.high]),
                })
            })
            .collect();
        let data = script_json(&serde_json::json!({"surfaces": surfaces, "first": self.first()}));
        html! {
            script type="application/json" id="view-data" { (PreEscaped(data)) } "\n"
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

/// A surface with at most about `triangles_max` triangles: nodes that share a cube of a lattice become their mean, the
/// cube as small as will do (J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes",
/// 1993). Values become the mean of the finite ones. A surface that is small enough comes back unchanged.
pub fn decimated(surface: &TriMesh, values: &[f64], triangles_max: usize) -> (TriMesh, Vec<f64>) {
    let mut result = (surface.clone(), values.to_vec());
    let area = surface.area_mm2();
    // Two triangles per square of the lattice on a flat surface; then larger until it fits.
    let mut edge_mm = (2.0 * area / triangles_max.max(1) as f64).sqrt();
    while result.0.triangles.len() > triangles_max && edge_mm > 0.0 {
        result = clustered(surface, values, edge_mm);
        edge_mm *= 1.15;
    }
    result
}

fn clustered(surface: &TriMesh, values: &[f64], edge_mm: f64) -> (TriMesh, Vec<f64>) {
    let cube = |p: &[f64; 3]| p.map(|x| (x / edge_mm).floor() as i64);
    let mut cubes: Vec<[i64; 3]> = surface.nodes_mm.iter().map(cube).collect();
    cubes.sort_unstable();
    cubes.dedup();
    let mut nodes_mm = vec![[0.0; 3]; cubes.len()];
    let mut counts = vec![0.0; cubes.len()];
    let (mut sums, mut finite) = (vec![0.0; cubes.len()], vec![0.0; cubes.len()]);
    let mut number = Vec::with_capacity(surface.nodes_mm.len());
    for (n, p) in surface.nodes_mm.iter().enumerate() {
        let new = cubes.binary_search(&cube(p)).unwrap_or(0);
        number.push(new as u32);
        (0..3).for_each(|a| nodes_mm[new][a] += p[a]);
        counts[new] += 1.0;
        if let Some(v) = values.get(n).filter(|v| v.is_finite()) {
            sums[new] += v;
            finite[new] += 1.0;
        }
    }
    for (p, count) in nodes_mm.iter_mut().zip(&counts) {
        *p = p.map(|x| x / count);
    }
    let mut triangles: Vec<[u32; 3]> = surface.triangles.iter().map(|t| t.map(|n| number[n as usize])).collect();
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    let mean = |n: usize| if finite[n] > 0.0 { sums[n] / finite[n] } else { f64::NAN };
    let values = if values.is_empty() { Vec::new() } else { (0..cubes.len()).map(mean).collect() };
    (TriMesh { nodes_mm, triangles }, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of n x n quads in the plane z = 0, values = x.
    fn square(n: usize) -> (TriMesh, Vec<f64>) {
        let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
        let nodes_mm: Vec<[f64; 3]> = (0..=n).flat_map(|i| (0..=n).map(move |j| [i as f64, j as f64, 0.0])).collect();
        let triangles = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let values = nodes_mm.iter().map(|p| p[0]).collect();
        (TriMesh { nodes_mm, triangles }, values)
    }

    #[test]
    fn decimation_keeps_area_values_and_the_bound() {
        let (surface, values) = square(60);
        let (small, means) = decimated(&surface, &values, 2000);
        assert!(small.triangles.len() <= 2000 && small.triangles.len() > 1000, "{}", small.triangles.len());
        assert!((small.area_mm2() / surface.area_mm2() - 1.0).abs() < 0.08);
        assert!(small.nodes_mm.iter().zip(&means).all(|(p, v)| (p[0] - v).abs() < 1e-9));
    }

    #[test]
    fn a_small_surface_is_left_alone() {
        let (surface, values) = square(3);
        assert_eq!(decimated(&surface, &values, 100), (surface, values));
    }

    #[test]
    fn scripts_hold_no_markup_of_names() {
        let (surface, values) = square(2);
        let name = "</script><b>".to_owned();
        let scale = ColourScale::over(values.iter().copied(), "RMSE (mm)");
        let viewer = Viewer { surfaces: vec![ViewedSurface { name, surface, values }], scale };
        let scripts = viewer.scripts().into_string();
        assert_eq!(scripts.matches("</script").count(), 3);
        let section = viewer.section().into_string();
        assert!(!section.contains("<b>"));
        assert!(section.contains("data-low=\"0\" data-high=\"2\""));
    }
}

//! The linear tetrahedron: constant gradient, one point.

use super::assembly::Elements;
use super::definition::{Body, Element, Numbered};
use super::plain::Plain;
use super::point::{Point, barycentric_gradients};
use crate::fem::order::sorted;

/// The element; it locks towards nu = 0.5.
pub(super) struct Tet4;

impl Element for Tet4 {
    fn name(&self) -> &'static str {
        "tet4"
    }

    fn aliases(&self) -> &'static [&'static str] {
        &[]
    }

    fn has_mid_edge_nodes(&self) -> bool {
        false
    }

    fn locks_above(&self) -> Option<f64> {
        Some(0.47)
    }

    fn body(&self, mesh: &Numbered) -> Box<dyn Body> {
        Box::new(Plain { elements: elements(mesh), mass_share })
    }
}

/// Linear elements of a mesh.
pub(super) fn elements(mesh: &Numbered) -> Elements<4, 1> {
    let (tets, portions) = sorted(mesh.tets, mesh.number, mesh.portions);
    let points = tets
        .iter()
        .zip(&portions)
        .map(|(tet, portion)| {
            let (gradients, volume_m3) = barycentric_gradients(tet.map(|n| mesh.nodes_m[n as usize]));
            [Point { weight_m3: portion.share * volume_m3, gradients }]
        })
        .collect();
    Elements::new(tets, points, portions, mesh.row_of, mesh.pattern)
}

/// Integrals of products of shape functions over a tetrahedron of volume 1: (1 + [a = b]) / 20.
pub(super) fn mass_share(a: usize, b: usize) -> f64 {
    if a == b { 0.1 } else { 0.05 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_tetrahedron_sum_to_one() {
        let sum: f64 = (0..4).flat_map(|a| (0..4).map(move |b| mass_share(a, b))).sum();
        assert!((sum - 1.0).abs() < 1e-15);
    }
}

//! The linear tetrahedron: constant gradient, one point.

use super::point::{Point, barycentric_gradients};

/// The single point of every tetrahedron; nodes in m.
pub(in super::super) fn tet4(nodes_m: &[[f64; 3]], tets: &[[u32; 4]]) -> Vec<[Point<4>; 1]> {
    tets.iter()
        .map(|tet| {
            let (gradients, weight_m3) = barycentric_gradients(tet.map(|n| nodes_m[n as usize]));
            [Point { weight_m3, gradients }]
        })
        .collect()
}

//! The quadratic tetrahedron with straight edges: linear gradients, four points of degree 2
//! (Zienkiewicz and Taylor, "The Finite Element Method", vol. 1, table 5.3).

use super::assembly::Elements;
use super::definition::{Body, Element, Numbered};
use super::plain::Plain;
use super::point::{Point, barycentric_gradients};
use crate::fem::order::sorted;

/// The element: the oracle, several times dearer than the linear one.
pub(super) struct Tet10;

impl Element for Tet10 {
    fn name(&self) -> &'static str {
        "tet10"
    }

    fn aliases(&self) -> &'static [&'static str] {
        &[]
    }

    fn has_mid_edge_nodes(&self) -> bool {
        true
    }

    fn locks_above(&self) -> Option<f64> {
        None
    }

    fn body(&self, mesh: &Numbered) -> Box<dyn Body> {
        let (tets, portions) = sorted(mesh.with_mid_edge_nodes, mesh.number, mesh.portions);
        let mut points = points(mesh.nodes_m, &tets);
        for (of, portion) in points.iter_mut().zip(&portions) {
            for point in of {
                point.weight_m3 *= portion.share;
            }
        }
        let elements = Elements::new(tets, points, portions, mesh.row_of, mesh.pattern);
        Box::new(Plain { elements, mass_share })
    }
}

/// Corner pairs of the six mid-edge nodes, in VTK order.
const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

/// Quadratic connectivity over linear tets: corners keep their numbers, mid-edge nodes follow in order of first use.
/// Also returns the two ends of every mid-edge node.
pub(in super::super) fn with_mid_edge_nodes(nodes: usize, tets: &[[u32; 4]]) -> (Vec<[u32; 10]>, Vec<[u32; 2]>) {
    let edge_of = |tet: &[u32; 4], e: [usize; 2]| {
        let (a, b) = (tet[e[0]], tet[e[1]]);
        [a.min(b), a.max(b)]
    };
    let mut edges: Vec<[u32; 2]> = tets.iter().flat_map(|tet| EDGES.map(|e| edge_of(tet, e))).collect();
    edges.sort_unstable();
    edges.dedup();
    let number = |edge: [u32; 2]| (nodes + edges.binary_search(&edge).unwrap_or(0)) as u32;
    let quadratic = tets
        .iter()
        .map(|tet| {
            let middle = EDGES.map(|e| number(edge_of(tet, e)));
            std::array::from_fn(|n| if n < 4 { tet[n] } else { middle[n - 4] })
        })
        .collect();
    (quadratic, edges)
}

/// The four points of every tetrahedron; corner nodes in m.
fn points(nodes_m: &[[f64; 3]], tets: &[[u32; 10]]) -> Vec<[Point<10>; 4]> {
    let (near, far) = (0.585_410_196_624_968_5, 0.138_196_601_125_010_5);
    tets.iter()
        .map(|tet| {
            let (g, volume) = barycentric_gradients(std::array::from_fn(|c| nodes_m[tet[c] as usize]));
            std::array::from_fn(|q| {
                let l: [f64; 4] = std::array::from_fn(|c| if c == q { near } else { far });
                let gradients = std::array::from_fn(|n| {
                    if n < 4 {
                        // N = l (2 l - 1)
                        g[n].map(|v| (4.0 * l[n] - 1.0) * v)
                    } else {
                        // N = 4 l_a l_b
                        let [a, b] = EDGES[n - 4];
                        std::array::from_fn(|i| 4.0 * (l[a] * g[b][i] + l[b] * g[a][i]))
                    }
                });
                Point { weight_m3: volume / 4.0, gradients }
            })
        })
        .collect()
}

/// Integrals of products of shape functions over a tetrahedron of volume 1 (Zienkiewicz and Taylor, vol. 1).
fn mass_share(a: usize, b: usize) -> f64 {
    let at_edge = |corner: usize, edge: usize| EDGES[edge - 4].contains(&corner);
    let entry = match (a < 4, b < 4) {
        (true, true) => [1.0, 6.0][usize::from(a == b)],
        (true, false) => [-6.0, -4.0][usize::from(at_edge(a, b))],
        (false, true) => [-6.0, -4.0][usize::from(at_edge(b, a))],
        (false, false) => {
            let shared = EDGES[a - 4].iter().filter(|c| EDGES[b - 4].contains(c)).count();
            [8.0, 16.0, 32.0][shared]
        }
    };
    entry / 420.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_tetrahedron_sum_to_one() {
        let row = |a: usize| (0..10).map(|b| mass_share(a, b)).sum::<f64>();
        assert!(((0..10).map(row).sum::<f64>() - 1.0).abs() < 1e-15);
        // Rows integrate single shape functions: -1/20 at corners, 1/5 at mid-edges.
        assert!((0..4).all(|a| (row(a) + 0.05).abs() < 1e-15) && (4..10).all(|a| (row(a) - 0.2).abs() < 1e-15));
    }
}

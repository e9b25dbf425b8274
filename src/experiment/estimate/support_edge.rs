//! The edge of what holds a body, moved along the surface that it lies in.

use super::outline::REACH_MM;
use crate::mesh::TetMesh;
use crate::tag::{BASE, FALX};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// How far along the edge a direction is smoothed, mm: the edge of a set of facets is a zigzag.
const SMOOTHED_MM: f64 = 5.0;

/// One side of a facet that ends a held surface.
struct Side {
    /// Where it starts, mm.
    start: Vector3<f64>,
    /// From there to where it ends, mm.
    along: Vector3<f64>,
    /// In the facet's plane, away from it; as long as the side, mm.
    outward: Vector3<f64>,
}

impl Side {
    fn squared_distance_mm2(&self, x: Vector3<f64>) -> f64 {
        let from = x - self.start;
        let share = (from.dot(&self.along) / self.along.norm_squared()).clamp(0.0, 1.0);
        (from - self.along * share).norm_squared()
    }
}

/// Where a held surface ends in tissue that is free.
pub(super) struct SupportEdge {
    sides: Vec<Side>,
}

impl SupportEdge {
    /// The edge of the base: where held facets of the outside border on free ones. `None` for a body without one.
    pub fn of_base(mesh: &TetMesh) -> Option<Self> {
        Self::new(mesh, mesh.facet_sets.get(BASE)?, |_| true)
    }

    /// The free edge of the falx: where its sheet ends inside the brain. `None` for a body without a sheet.
    pub fn of_falx(mesh: &TetMesh) -> Option<Self> {
        let mut outer: Vec<u32> = mesh.boundary_facets(|_| true).into_iter().flatten().collect();
        outer.sort_unstable();
        outer.dedup();
        let inside = |n: u32| outer.binary_search(&n).is_err();
        Self::new(mesh, mesh.facet_sets.get(FALX)?, |[a, b]| inside(a) || inside(b))
    }

    /// Ends of these facets that are asked for; `None` where there are none.
    fn new(mesh: &TetMesh, facets: &[[u32; 3]], wanted: impl Fn([u32; 2]) -> bool) -> Option<Self> {
        // How many facets share a side, and the corner opposite to it.
        let mut sides: BTreeMap<[u32; 2], (usize, u32)> = BTreeMap::new();
        for facet in facets {
            for k in 0..3 {
                let [a, b, opposite] = [0, 1, 2].map(|n| facet[(k + n) % 3]);
                sides.entry([a.min(b), a.max(b)]).or_insert((0, opposite)).0 += 1;
            }
        }
        let at = |n: u32| Vector3::from(mesh.nodes_mm()[n as usize]);
        let sides: Vec<Side> = sides
            .into_iter()
            .filter(|(ends, (count, _))| *count == 1 && wanted(*ends))
            .map(|([a, b], (_, opposite))| {
                let (along, inward) = (at(b) - at(a), at(opposite) - at(a));
                let across = inward - along * (inward.dot(&along) / along.norm_squared());
                Side { start: at(a), along, outward: -across.normalize() * along.norm() }
            })
            .collect();
        (!sides.is_empty()).then_some(Self { sides })
    }

    /// The mesh with the held surface reaching so many mm farther, what lies about its edge moved along by less the farther off
    /// it is; `None` where that turns a tetrahedron inside out.
    pub fn moved(&self, mesh: &TetMesh, by_mm: impl Fn(Vector3<f64>) -> f64) -> Option<TetMesh> {
        let to = |x: [f64; 3]| -> [f64; 3] {
            let x = Vector3::from(x);
            let (mut nearest, mut way) = (f64::INFINITY, Vector3::zeros());
            for side in &self.sides {
                let squared = side.squared_distance_mm2(x);
                nearest = nearest.min(squared);
                way += side.outward * (-0.5 * squared / (SMOOTHED_MM * SMOOTHED_MM)).exp();
            }
            let share = 1.0 - nearest.sqrt() / REACH_MM;
            let Some(way) = way.try_normalize(1e-12).filter(|_| share > 0.0) else { return x.into() };
            (x + way * (share * by_mm(x))).into()
        };
        mesh.clone().moved(to).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    /// A cube of 80 mm in cells of 10, with the facets whose corners all lie there in a set.
    fn with_set(name: &str, inside: impl Fn([f64; 3]) -> bool) -> TetMesh {
        let mut mesh = block(8);
        let corners = |facet: &[u32; 3]| facet.iter().all(|&n| inside(mesh.nodes_mm()[n as usize]));
        let facets = mesh.facets().into_iter().map(|(facet, ..)| facet).filter(corners).collect();
        mesh.facet_sets.insert(name.to_owned(), facets);
        mesh
    }

    /// Every node's place, and how far it goes.
    fn ways(mesh: &TetMesh, edge: Option<SupportEdge>) -> Vec<([f64; 3], [f64; 3])> {
        let moved = edge.unwrap().moved(mesh, |_| 1.0).unwrap();
        let both = mesh.nodes_mm().iter().zip(moved.nodes_mm());
        both.map(|(a, b)| (*a, [0, 1, 2].map(|k| b[k] - a[k]))).collect()
    }

    fn near(a: [f64; 3], b: [f64; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.02)
    }

    #[test]
    fn a_base_that_reaches_farther_takes_its_edge_along_and_leaves_the_rest() {
        let mesh = with_set(BASE, |x| x[2] < 1e-9 && x[0] < 40.0 + 1e-9);
        let ways = ways(&mesh, SupportEdge::of_base(&mesh));
        let of = |wanted: [f64; 3]| ways.iter().find(|(x, _)| near(*x, wanted)).unwrap().1;
        for back in [30.0, 40.0, 50.0] {
            assert!(near(of([40.0, back, 0.0]), [1.0, 0.0, 0.0]), "{:?}", of([40.0, back, 0.0]));
            for [right, up] in [[20.0, 0.0], [30.0, 0.0], [50.0, 0.0], [60.0, 0.0], [40.0, 10.0], [40.0, 40.0]] {
                assert_eq!(of([right, back, up]), [0.0; 3], "{right} {up}");
            }
        }
    }

    #[test]
    fn only_the_free_edge_of_a_falx_goes_deeper() {
        let mesh = with_set(FALX, |x| (x[0] - 40.0).abs() < 1e-9 && x[2] > 40.0 - 1e-9);
        let ways = ways(&mesh, SupportEdge::of_falx(&mesh));
        let of = |wanted: [f64; 3]| ways.iter().find(|(x, _)| near(*x, wanted)).unwrap().1;
        for back in [20.0, 40.0, 60.0] {
            assert!(near(of([40.0, back, 40.0]), [0.0, 0.0, -1.0]), "{:?}", of([40.0, back, 40.0]));
            // Above it ends at the skull.
            for up in [60.0, 80.0] {
                assert_eq!(of([40.0, back, up]), [0.0; 3]);
            }
        }
    }

    #[test]
    fn a_falx_of_nodes_alone_and_a_body_without_supports_have_no_edge() {
        let mut mesh = block(4);
        let middle =
            (0..mesh.nodes_mm().len() as u32).filter(|&n| (mesh.nodes_mm()[n as usize][0] - 20.0).abs() < 1e-9);
        let slab = middle.collect();
        mesh.node_sets.insert(FALX.to_owned(), slab);
        assert!(SupportEdge::of_base(&mesh).is_none() && SupportEdge::of_falx(&mesh).is_none());
    }
}

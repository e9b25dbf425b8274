//! The falx of a body, moved sideways with the tissue beside it.

use super::outline::REACH_MM;
use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use crate::tag::FALX;
use nalgebra::Vector3;

/// The facets of a mesh that lie in its falx.
pub(super) struct Sheet {
    tree: ClosestPoint,
}

impl Sheet {
    /// `None` for a mesh without a falx.
    pub fn new(mesh: &TetMesh) -> Option<Self> {
        let held = mesh.node_sets.get(FALX)?;
        let in_falx = |n: u32| held.binary_search(&n).is_ok();
        let facets = mesh.facets().into_iter().map(|(facet, ..)| facet);
        let facets: Vec<[u32; 3]> = facets.filter(|facet| facet.iter().all(|&n| in_falx(n))).collect();
        let (sheet, _) = TriMesh::from_facets(mesh.nodes_mm(), &facets);
        Some(Self { tree: ClosestPoint::new(&sheet)? })
    }

    /// The mesh with the sheet moved to the right by so many mm, what lies beside it by less the farther off it is; `None` where
    /// that turns a tetrahedron inside out.
    pub fn moved(&self, mesh: &TetMesh, by_mm: impl Fn(Vector3<f64>) -> f64) -> Option<TetMesh> {
        let to = |x: [f64; 3]| -> [f64; 3] {
            let hit = self.tree.find(x);
            let share = (1.0 - hit.distance_mm / REACH_MM).max(0.0);
            [x[0] + share * by_mm(hit.point_mm.coords), x[1], x[2]]
        };
        mesh.clone().moved(to).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    #[test]
    fn a_falx_moved_aside_takes_what_is_beside_it_along_and_leaves_the_rest() {
        let mut mesh = block(8);
        let at = |mesh: &TetMesh, n: u32| mesh.nodes_mm()[n as usize];
        let middle = (0..mesh.nodes_mm().len() as u32).filter(|&n| (at(&mesh, n)[0] - 20.0).abs() < 1e-9);
        mesh.node_sets.insert(FALX.to_owned(), middle.collect());
        let moved = Sheet::new(&mesh).unwrap().moved(&mesh, |_| 0.8).unwrap();
        for n in 0..mesh.nodes_mm().len() as u32 {
            let (before, after) = (at(&mesh, n), at(&moved, n));
            let wanted = 0.8 * (1.0 - (before[0] - 20.0).abs() / REACH_MM).max(0.0);
            assert!((after[0] - before[0] - wanted).abs() < 1e-9, "{before:?} {after:?}");
            assert_eq!(after[1..], before[1..]);
        }
        assert!(Sheet::new(&block(4)).is_none());
    }
}

//! How deep in the brain a node lies.

use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use rayon::prelude::*;

/// Distance of every node to the brain's outside or to the margin, mm. The ventricles' wall is seen well and moves with the
/// tissue: it does not count.
pub fn depth_mm(mesh: &TetMesh) -> Vec<f64> {
    let sorted = |mut facet: [u32; 3]| {
        facet.sort_unstable();
        facet
    };
    let wall = mesh.facet_sets.get(crate::tag::VENTRICLE).map_or(&[][..], Vec::as_slice);
    let mut wall: Vec<[u32; 3]> = wall.iter().copied().map(sorted).collect();
    wall.sort_unstable();
    let mut outside = mesh.boundary_facets(|_| true);
    outside.retain(|&facet| wall.binary_search(&sorted(facet)).is_err());
    let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &outside);
    let Some(tree) = ClosestPoint::new(&surface) else { return vec![0.0; mesh.nodes_mm().len()] };
    mesh.nodes_mm().par_iter().map(|x| tree.find(*x).distance_mm).collect()
}

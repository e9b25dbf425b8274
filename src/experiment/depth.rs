//! How deep in the brain a node lies.

use crate::mesh::{ClosestPoint, TetMesh, TriMesh};
use crate::tag::VENTRICLE;
use rayon::prelude::*;

/// Distance of every node to the brain's outside or to the margin, mm. The ventricles' wall is seen well and moves with the
/// tissue: it does not count.
pub fn depth_mm(mesh: &TetMesh) -> Vec<f64> {
    let (surface, _) = TriMesh::from_facets(mesh.nodes_mm(), &mesh.outside_without(&[VENTRICLE]));
    let Some(tree) = ClosestPoint::new(&surface) else { return vec![0.0; mesh.nodes_mm().len()] };
    mesh.nodes_mm().par_iter().map(|x| tree.find(*x).distance_mm).collect()
}

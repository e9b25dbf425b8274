//! Holes within the tissue, whose walls lie against no skull.

use crate::mesh::TetMesh;
use nalgebra::Vector3;

/// A hole is one from this volume on, mm3: smaller ones are gaps of the label map.
const SMALLEST_MM3: f64 = 500.0;

/// Facets of the outside of `mesh` without those that close around a hole: they see a volume below zero. A cyst's roof looks down
/// as the base of the brain does, and rests on nothing.
pub(crate) fn without_voids(mesh: &TetMesh, facets: &[[u32; 3]]) -> Vec<[u32; 3]> {
    // Of every label: the wall of a hole beside the ventricle or the resected tissue is closed only with their facets.
    let outside = mesh.boundary_facets(|_| true);
    let mut root: Vec<u32> = (0..mesh.nodes_mm().len() as u32).collect();
    for &[a, b, c] in &outside {
        for other in [b, c] {
            let (one, other) = (root_of(&mut root, a), root_of(&mut root, other));
            root[one.max(other) as usize] = one.min(other);
        }
    }
    let mut volume_mm3 = vec![0.0; root.len()];
    for &facet in &outside {
        let (middle, area) = (Vector3::from(mesh.facet_centroid_mm(facet)), mesh.area_vector_mm2(facet));
        volume_mm3[root_of(&mut root, facet[0]) as usize] += area.dot(&middle) / 3.0;
    }
    let mut in_void = |facet: &[u32; 3]| volume_mm3[root_of(&mut root, facet[0]) as usize] <= -SMALLEST_MM3;
    facets.iter().copied().filter(|facet| !in_void(facet)).collect()
}

/// The first node of what has been joined with `n`.
fn root_of(root: &mut [u32], mut n: u32) -> u32 {
    while root[n as usize] != n {
        root[n as usize] = root[root[n as usize] as usize];
        n = root[n as usize];
    }
    n
}

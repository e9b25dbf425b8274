//! Holes within the tissue, whose walls lie against no skull.

use crate::mesh::TetMesh;
use nalgebra::Vector3;

/// A hole is one from this volume on, mm3: smaller ones are gaps of the label map.
const SMALLEST_MM3: f64 = 500.0;

/// Outward facets without those that close around a hole: they see a volume below zero. A cyst's roof looks down as the base
/// of the brain does, and rests on nothing.
pub(super) fn without_voids(mesh: &TetMesh, facets: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut root: Vec<u32> = (0..mesh.nodes_mm().len() as u32).collect();
    for &[a, b, c] in facets {
        for other in [b, c] {
            let (one, other) = (root_of(&mut root, a), root_of(&mut root, other));
            root[one.max(other) as usize] = one.min(other);
        }
    }
    let mut around = vec![(0.0, 0.0, Vector3::zeros()); root.len()];
    for &facet in facets {
        let (middle, area) = (Vector3::from(mesh.facet_centroid_mm(facet)), mesh.area_vector_mm2(facet));
        let (volume_mm3, area_mm2, sum) = &mut around[root_of(&mut root, facet[0]) as usize];
        *volume_mm3 += area.dot(&middle) / 3.0;
        *area_mm2 += area.norm();
        *sum += area;
    }
    // A surface with a rim, as beside the resected tissue, encloses no volume.
    let is_void = |&(volume_mm3, area_mm2, sum): &(f64, f64, Vector3<f64>)| {
        volume_mm3 <= -SMALLEST_MM3 && sum.norm() < 1e-6 * area_mm2
    };
    facets.iter().copied().filter(|facet| !is_void(&around[root_of(&mut root, facet[0]) as usize])).collect()
}

/// The first node of what has been joined with `n`.
fn root_of(root: &mut [u32], mut n: u32) -> u32 {
    while root[n as usize] != n {
        root[n as usize] = root[root[n as usize] as usize];
        n = root[n as usize];
    }
    n
}

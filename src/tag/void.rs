//! Holes within the tissue, whose walls lie against no skull.

use crate::mesh::TetMesh;
use nalgebra::Vector3;

/// A hole is one from this volume on, mm3: smaller ones are gaps of the label map.
const SMALLEST_MM3: f64 = 500.0;

/// Facets of the outside of `mesh` without those that close around a hole: they see a volume below zero. A cyst's roof looks down
/// as the base of the brain does, and rests on nothing.
pub(crate) fn without_voids(mesh: &TetMesh, facets: &[[u32; 3]]) -> Vec<[u32; 3]> {
    // Of every label: the wall of a hole beside the ventricle or the resected tissue is closed only with their facets.
    let mut outside = mesh.boundary_facets(|_| true);
    outside.sort_unstable_by_key(|facet| in_order(*facet));
    // Surfaces hang together by edges: a hole may touch the outside in a node.
    let edges = |(n, &[a, b, c]): (usize, &[u32; 3])| [[a, b], [b, c], [c, a]].map(|[a, b]| (a.min(b), a.max(b), n));
    let mut edges: Vec<(u32, u32, usize)> = outside.iter().enumerate().flat_map(edges).collect();
    edges.sort_unstable();
    let mut root: Vec<usize> = (0..outside.len()).collect();
    for pair in edges.windows(2).filter(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1)) {
        let (one, other) = (root_of(&mut root, pair[0].2), root_of(&mut root, pair[1].2));
        root[one.max(other)] = one.min(other);
    }
    let mut volume_mm3 = vec![0.0; outside.len()];
    for (n, &facet) in outside.iter().enumerate() {
        let (middle, area) = (Vector3::from(mesh.facet_centroid_mm(facet)), mesh.area_vector_mm2(facet));
        volume_mm3[root_of(&mut root, n)] += area.dot(&middle) / 3.0;
    }
    let mut in_void = |facet: &[u32; 3]| {
        let place = outside.binary_search_by_key(&in_order(*facet), |other| in_order(*other));
        place.is_ok_and(|n| volume_mm3[root_of(&mut root, n)] <= -SMALLEST_MM3)
    };
    facets.iter().copied().filter(|facet| !in_void(facet)).collect()
}

/// A facet's nodes, whichever way it looks.
fn in_order(mut facet: [u32; 3]) -> [u32; 3] {
    facet.sort_unstable();
    facet
}

/// The first of what has been joined with `n`.
fn root_of(root: &mut [usize], mut n: usize) -> usize {
    while root[n] != n {
        root[n] = root[root[n]];
        n = root[n];
    }
    n
}

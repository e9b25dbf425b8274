//! Places where a surface passes through itself.

use crate::mesh::TriMesh;
use nalgebra::Vector3;
use rayon::prelude::*;

type Point = Vector3<f64>;

/// Pairs of triangles of a surface that pass through each other, by their numbers, ascending. Triangles that share an edge do
/// not count, nor those that touch in one plane.
///
/// ```
/// use hgm::mesh::{TriMesh, quality::crossings};
/// let nodes_mm = vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.5, 0.5, -1.0], [0.5, 0.5, 1.0], [3.0, 3.0, 0.0]];
/// let surface = TriMesh { nodes_mm, triangles: vec![[0, 1, 2], [3, 4, 5]] };
/// assert_eq!(crossings(&surface), [[0, 1]]);
/// ```
pub fn crossings(surface: &TriMesh) -> Vec<[u32; 2]> {
    let facets = &surface.triangles;
    let x = |v: u32| Point::from(surface.nodes_mm[v as usize]);
    let boxes: Vec<(Point, Point)> = facets
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(x);
            (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
        })
        .collect();
    // A grid as coarse as the facets: each lies in a few cells.
    let mean = boxes.iter().map(|(low, high)| (high - low).max()).sum::<f64>() / boxes.len().max(1) as f64;
    let cell = |p: &Point| -> [i64; 3] { std::array::from_fn(|a| (p[a] / mean.max(f64::MIN_POSITIVE)).floor() as i64) };
    let mut entries: Vec<([i64; 3], u32)> = Vec::with_capacity(6 * facets.len());
    for (n, (low, high)) in boxes.iter().enumerate() {
        let (low, high) = (cell(low), cell(high));
        for k in low[2]..=high[2] {
            for j in low[1]..=high[1] {
                entries.extend((low[0]..=high[0]).map(|i| ([i, j, k], n as u32)));
            }
        }
    }
    entries.par_sort_unstable();
    let cells: Vec<&[([i64; 3], u32)]> = entries.chunk_by(|a, b| a.0 == b.0).collect();
    let mut pairs: Vec<[u32; 2]> = cells
        .par_iter()
        .flat_map_iter(|same| {
            let mut found = Vec::new();
            for (n, (_, f)) in same.iter().enumerate() {
                for (_, g) in &same[n + 1..] {
                    let ((low, high), (other_low, other_high)) = (&boxes[*f as usize], &boxes[*g as usize]);
                    let apart = (0..3).any(|a| low[a] > other_high[a] || other_low[a] > high[a]);
                    if !apart && cross(facets[*f as usize], facets[*g as usize], x) {
                        found.push([*f, *g]);
                    }
                }
            }
            found
        })
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Whether an edge of one facet that shares no corner with the other passes through the other.
fn cross(f: [u32; 3], g: [u32; 3], x: impl Fn(u32) -> Point) -> bool {
    let pierces = |edges: [u32; 3], by: [u32; 3]| {
        let [a, b, c] = by.map(&x);
        (0..3).any(|n| {
            let (p, q) = (edges[n], edges[(n + 1) % 3]);
            !by.contains(&p) && !by.contains(&q) && segment_meets_triangle(&x(p), &x(q), [&a, &b, &c])
        })
    };
    let shared = f.iter().filter(|v| g.contains(v)).count();
    shared < 2 && (pierces(f, g) || pierces(g, f))
}

fn segment_meets_triangle(p: &Point, q: &Point, [a, b, c]: [&Point; 3]) -> bool {
    let volume = |u: &Point, v: &Point, w: &Point, z: &Point| (v - u).cross(&(w - u)).dot(&(z - u));
    let (from, to) = (volume(a, b, c, p), volume(a, b, c, q));
    // In the plane of the triangle: beside it, or gliding along it, but not through.
    let flat = 1e-12 * (b - a).norm() * (c - a).norm() * (q - p).norm();
    if from * to > 0.0 || (from.abs() <= flat && to.abs() <= flat) {
        return false;
    }
    let sides = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The surfaces of two unit cubes, the second `shift` to the right of the first.
    fn cubes(shift: f64) -> TriMesh {
        let corner = |n: u32| [f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2)];
        let second = |n: u32| [corner(n)[0] + shift, corner(n)[1] + 0.03, corner(n)[2] + 0.05];
        let one = [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]];
        let other = [[2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]];
        let cube: Vec<[u32; 3]> = one.into_iter().chain(other).collect();
        TriMesh {
            nodes_mm: (0..8).map(corner).chain((0..8).map(second)).collect(),
            triangles: cube.iter().copied().chain(cube.iter().map(|t| t.map(|v| v + 8))).collect(),
        }
    }

    #[test]
    fn cubes_cross_when_they_overlap_only() {
        assert_eq!(crossings(&cubes(1.1)).len(), 0);
        assert!(crossings(&cubes(0.9)).len() > 4);
        assert_eq!(crossings(&TriMesh::default()).len(), 0);
    }
}

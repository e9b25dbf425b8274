//! Shape of tets: dihedral angles, radius ratio, scaled Jacobian.

use super::crossing::crossings;
use crate::mesh::{TET_FACES, TetMesh, TriMesh};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The shape of a mesh's tets in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeQuality {
    /// Smallest of all dihedral angles, degrees.
    pub dihedral_min_deg: f64,
    /// First percentile over tets of the smallest dihedral angle of each, degrees.
    pub dihedral_percentile_1_deg: f64,
    /// Tets with a dihedral angle below 10 degrees, percent.
    pub dihedral_below_10_percent: f64,
    /// Largest of all dihedral angles, degrees.
    pub dihedral_max_deg: f64,
    /// All dihedral angles (six per tet) in 18 parts of 10 degrees.
    pub dihedral_counts: Vec<usize>,
    /// Smallest radius ratio: three times inscribed over circumscribed radius, 1 for a regular tet.
    pub radius_ratio_min: f64,
    /// Mean radius ratio.
    pub radius_ratio_mean: f64,
    /// Smallest scaled Jacobian: root two times six volumes over the largest product of the edges at a corner, 1 for a
    /// regular tet (Knupp, "Algebraic mesh quality metrics", 2001, as the library Verdict has it).
    pub scaled_jacobian_min: f64,
    /// Edges of the outer surface without exactly two outer facets.
    pub non_manifold_outer_edges: usize,
    /// Pairs of outer facets that pass through each other: places where the mesh overlaps itself.
    pub crossing_facets: usize,
}

/// Figures of one tet.
struct TetShape {
    dihedral_deg: [f64; 6],
    radius_ratio: f64,
    scaled_jacobian: f64,
}

fn tet_shape(p: [Vector3<f64>; 4]) -> TetShape {
    // Twice the area vector of every face, outward; face n is opposite corner n.
    let normal = TET_FACES.map(|[a, b, c]| (p[b] - p[a]).cross(&(p[c] - p[a])));
    let six_volumes = (p[1] - p[0]).cross(&(p[2] - p[0])).dot(&(p[3] - p[0]));
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let dihedral_deg = pairs.map(|[a, b]| {
        // atan2 keeps the digits of angles near 0 and 180 degrees, where acos loses them.
        let (m, n) = (&normal[a], &normal[b]);
        m.cross(n).norm().atan2(-m.dot(n)).to_degrees()
    });
    let area: f64 = normal.iter().map(|n| 0.5 * n.norm()).sum();
    let (u, v, w) = (p[1] - p[0], p[2] - p[0], p[3] - p[0]);
    let to_centre = v.cross(&w) * u.norm_squared() + w.cross(&u) * v.norm_squared() + u.cross(&v) * w.norm_squared();
    // Inscribed radius 3 V / A, circumscribed |to_centre| / (12 V).
    let radius_ratio = 3.0 * (0.5 * six_volumes / area) * (2.0 * six_volumes / to_centre.norm());
    let length = |a: usize, b: usize| (p[a] - p[b]).norm();
    let at_corner = |n: usize| (0..4).filter(|&m| m != n).map(|m| length(n, m)).product::<f64>();
    let largest = (0..4).map(at_corner).fold(0.0, f64::max);
    TetShape { dihedral_deg, radius_ratio, scaled_jacobian: std::f64::consts::SQRT_2 * six_volumes / largest }
}

/// The shape of all tets of a mesh.
pub fn shape_quality(mesh: &TetMesh) -> ShapeQuality {
    let mut counts = vec![0usize; 18];
    let mut smallest = Vec::with_capacity(mesh.tets().len());
    let (mut largest, mut ratio_min, mut ratio_sum, mut jacobian) = (0.0f64, f64::MAX, 0.0, f64::MAX);
    for tet in mesh.tets() {
        let shape = tet_shape(tet.map(|n| Vector3::from(mesh.nodes_mm()[n as usize])));
        for angle in shape.dihedral_deg {
            counts[((angle / 10.0) as usize).min(17)] += 1;
            largest = largest.max(angle);
        }
        smallest.push(shape.dihedral_deg.into_iter().fold(f64::MAX, f64::min));
        ratio_min = ratio_min.min(shape.radius_ratio);
        ratio_sum += shape.radius_ratio;
        jacobian = jacobian.min(shape.scaled_jacobian);
    }
    smallest.sort_unstable_by(f64::total_cmp);
    let count = smallest.len();
    ShapeQuality {
        dihedral_min_deg: smallest[0],
        dihedral_percentile_1_deg: smallest[count / 100],
        dihedral_below_10_percent: 100.0 * smallest.partition_point(|&a| a < 10.0) as f64 / count as f64,
        dihedral_max_deg: largest,
        dihedral_counts: counts,
        radius_ratio_min: ratio_min,
        radius_ratio_mean: ratio_sum / count as f64,
        scaled_jacobian_min: jacobian,
        non_manifold_outer_edges: non_manifold_outer_edges(mesh),
        crossing_facets: crossings(&TriMesh::from_facets(mesh.nodes_mm(), &mesh.boundary_facets(|_| true)).0).len(),
    }
}

fn non_manifold_outer_edges(mesh: &TetMesh) -> usize {
    let mut edges: Vec<[u32; 2]> = mesh
        .boundary_facets(|_| true)
        .into_iter()
        .flat_map(|[a, b, c]| [[a.min(b), a.max(b)], [b.min(c), b.max(c)], [a.min(c), a.max(c)]])
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() != 2).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(nodes: &[[f64; 3]], tets: &[[u32; 4]]) -> TetMesh {
        TetMesh::new(nodes.to_vec(), tets.to_vec(), vec![2; tets.len()]).unwrap()
    }

    #[test]
    fn a_regular_tet_is_perfect_at_any_size() {
        for size in [1e-3, 1.0, 40.0] {
            let nodes = [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
            let quality = shape_quality(&mesh(&nodes.map(|p| p.map(|x| x * size)), &[[0, 1, 2, 3]]));
            assert!((quality.radius_ratio_min - 1.0).abs() < 1e-12);
            assert!((quality.scaled_jacobian_min - 1.0).abs() < 1e-12);
            let angle = (1.0f64 / 3.0).acos().to_degrees();
            assert!(
                (quality.dihedral_min_deg - angle).abs() < 1e-10 && (quality.dihedral_max_deg - angle).abs() < 1e-10
            );
            assert_eq!(quality.dihedral_counts[7], 6);
        }
    }

    #[test]
    fn the_corner_of_a_cube_has_the_figures_of_the_books() {
        let nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let quality = shape_quality(&mesh(&nodes, &[[0, 1, 2, 3]]));
        // Inscribed radius 1/(3 + root 3), circumscribed root 3 / 2; edges at a far corner 1, root 2, root 2.
        let root3 = 3f64.sqrt();
        assert!((quality.radius_ratio_min - 6.0 / (root3 * (3.0 + root3))).abs() < 1e-12);
        assert!((quality.scaled_jacobian_min - 1.0 / 2f64.sqrt()).abs() < 1e-12);
        assert!((quality.dihedral_min_deg - (1.0 / root3).acos().to_degrees()).abs() < 1e-10);
        assert!((quality.dihedral_max_deg - 90.0).abs() < 1e-10);
    }

    #[test]
    fn slivers_are_counted_though_all_their_edges_are_fair() {
        // Four points near a square: no short edge, no volume.
        let h = 0.02;
        let nodes = [[0.0, 0.0, h], [1.0, 0.0, -h], [1.0, 1.0, h], [0.0, 1.0, -h]];
        let tet =
            if TetMesh::new(nodes.to_vec(), vec![[0, 1, 2, 3]], vec![2]).is_ok() { [0, 1, 2, 3] } else { [0, 2, 1, 3] };
        let quality = shape_quality(&mesh(&nodes, &[tet]));
        assert!(quality.dihedral_min_deg < 10.0 && quality.dihedral_below_10_percent == 100.0);
        assert!(quality.radius_ratio_min < 0.1 && quality.scaled_jacobian_min < 0.1);
    }

    #[test]
    fn two_tets_that_share_an_edge_alone_are_not_manifold() {
        let nodes =
            [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0]];
        let quality = shape_quality(&mesh(&nodes, &[[0, 2, 3, 1], [0, 4, 5, 1]]));
        assert_eq!(quality.non_manifold_outer_edges, 1);
    }
}

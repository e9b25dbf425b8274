//! How far a deformed mesh is from what was observed, per node and in one number.

use crate::mesh::{ClosestPoint, TriMesh};
use rayon::prelude::*;

/// Root of the mean square, the paper's RMSE = sqrt(sum |e|^2 / S) over S nodes (the published program took |e|
/// without the square). `None` for no nodes.
///
/// ```
/// assert_eq!(hgm::experiment::rmse::root_mean_square(&[3.0, 4.0, 0.0, 0.0]), Some(2.5));
/// ```
pub fn root_mean_square(errors_mm: &[f64]) -> Option<f64> {
    let sum: f64 = errors_mm.iter().map(|e| e * e).sum();
    (!errors_mm.is_empty()).then(|| (sum / errors_mm.len() as f64).sqrt())
}

/// |u - u_ref| at every node, mm: for a phantom, whose reference has the same nodes.
pub fn node_errors_mm(displacement_mm: &[[f64; 3]], reference_mm: &[[f64; 3]]) -> Vec<f64> {
    let error = |(u, r): (&[f64; 3], &[f64; 3])| (0..3).map(|a| (u[a] - r[a]).powi(2)).sum::<f64>().sqrt();
    displacement_mm.iter().zip(reference_mm).map(error).collect()
}

/// Distance of every point to its closest point on the surface, mm: the published correspondence.
pub fn closest_distances_mm(points_mm: &[[f64; 3]], surface: &ClosestPoint) -> Vec<f64> {
    points_mm.par_iter().with_min_len(256).map(|&p| surface.find(p).distance_mm).collect()
}

/// Two surfaces against each other, sampled at their nodes: closest distances one way and the other.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SurfaceDistance {
    /// Root mean square over the nodes of both surfaces, mm.
    pub rms_mm: f64,
    /// Mean over the nodes of both surfaces, mm.
    pub mean_mm: f64,
    /// The larger of the two 95th percentiles, mm.
    pub percentile_95_mm: f64,
}

/// The symmetric distance of two surfaces: what one-sided closest points hide (a node set may lie on a part of the
/// reference and leave the rest unexplained). `None` when one of them is empty.
pub fn symmetric_distance(a: &TriMesh, b: &TriMesh) -> Option<SurfaceDistance> {
    let (tree_a, tree_b) = (ClosestPoint::new(a)?, ClosestPoint::new(b)?);
    let to_b = closest_distances_mm(&a.nodes_mm, &tree_b);
    let to_a = closest_distances_mm(&b.nodes_mm, &tree_a);
    let both: Vec<f64> = to_b.iter().chain(&to_a).copied().collect();
    Some(SurfaceDistance {
        rms_mm: root_mean_square(&both)?,
        mean_mm: both.iter().sum::<f64>() / both.len() as f64,
        percentile_95_mm: percentile(to_b, 0.95).max(percentile(to_a, 0.95)),
    })
}

fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}

/// Median and median absolute deviation, the paper's summary over cases. `None` for no values.
///
/// ```
/// assert_eq!(hgm::experiment::rmse::median_and_mad(&[1.0, 2.0, 9.0]), Some((2.0, 1.0)));
/// ```
pub fn median_and_mad(values: &[f64]) -> Option<(f64, f64)> {
    let median = |mut v: Vec<f64>| {
        v.sort_unstable_by(f64::total_cmp);
        let n = v.len();
        (n > 0).then(|| f64::midpoint(v[(n - 1) / 2], v[n / 2]))
    };
    let centre = median(values.to_vec())?;
    Some((centre, median(values.iter().map(|v| (v - centre).abs()).collect())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64, size: f64) -> TriMesh {
        let n = 11u32;
        let step = size / f64::from(n - 1);
        let nodes = (0..n * n).map(|i| [f64::from(i % n) * step, f64::from(i / n) * step, z]).collect();
        let cells = (0..(n - 1) * (n - 1)).map(|c| c % (n - 1) + c / (n - 1) * n);
        let triangles = cells.flat_map(|o| [[o, o + 1, o + 12], [o, o + 12, o + 11]]).collect();
        TriMesh { nodes_mm: nodes, triangles }
    }

    #[test]
    fn parallel_planes_are_their_gap_apart_both_ways() {
        let d = symmetric_distance(&square(0.0, 10.0), &square(2.0, 10.0)).unwrap();
        assert!((d.rms_mm - 2.0).abs() < 1e-12 && (d.percentile_95_mm - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_symmetric_distance_sees_what_one_side_hides() {
        let (small, large) = (square(0.0, 2.0), square(0.0, 10.0));
        let one_sided = closest_distances_mm(&small.nodes_mm, &ClosestPoint::new(&large).unwrap());
        assert!(root_mean_square(&one_sided).unwrap() < 1e-12);
        assert!(symmetric_distance(&small, &large).unwrap().rms_mm > 2.0);
    }

    #[test]
    fn a_translation_gives_its_length_as_rmse() {
        let errors = node_errors_mm(&[[1.0, 2.0, 2.0]; 5], &[[0.0; 3]; 5]);
        assert_eq!(root_mean_square(&errors), Some(3.0));
        assert_eq!(root_mean_square(&[]), None);
    }
}

//! The cut of a mesh by the midsagittal plane.

use nalgebra::Vector3;

/// Area and centroid of the cut of one tetrahedron by the plane x = 0; `None` when the plane misses it. Corners on
/// the plane count as right of it, so that a facet in the plane is counted once, by its tetrahedron on the left.
pub(super) fn midsagittal_cut(corners: [Vector3<f64>; 4]) -> Option<(f64, Vector3<f64>)> {
    let left = |p: &Vector3<f64>| p.x < 0.0;
    let (lefts, rights): (Vec<_>, Vec<_>) = corners.iter().partition(|p| left(p));
    let cross = |a: &Vector3<f64>, b: &Vector3<f64>| a + (b - a) * (a.x / (a.x - b.x));
    let polygon: Vec<Vector3<f64>> = match (lefts.as_slice(), rights.as_slice()) {
        ([a], [b, c, d]) | ([b, c, d], [a]) => vec![cross(a, b), cross(a, c), cross(a, d)],
        // Around the quadrilateral each step changes one end of the edge that is cut.
        ([a, b], [c, d]) => vec![cross(a, c), cross(a, d), cross(b, d), cross(b, c)],
        _ => return None,
    };
    let (mut area, mut moment) = (0.0, Vector3::zeros());
    for n in 1..polygon.len() - 1 {
        let triangle = (polygon[n] - polygon[0]).cross(&(polygon[n + 1] - polygon[0])).norm() / 2.0;
        area += triangle;
        moment += (polygon[0] + polygon[n] + polygon[n + 1]) * (triangle / 3.0);
    }
    (area > 0.0).then(|| (area, moment / area))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(x: [[f64; 3]; 4]) -> [Vector3<f64>; 4] {
        x.map(Vector3::from)
    }

    #[test]
    fn the_cut_of_a_known_tetrahedron_is_known() {
        // One corner left: a triangle half way down, a quarter of the opposite facet (area 2).
        let one = corners([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [1.0, 0.0, 2.0]]);
        let (area, centroid) = midsagittal_cut(one).unwrap();
        assert!((area - 0.5).abs() < 1e-12 && (centroid - Vector3::new(0.0, 1.0 / 3.0, 1.0 / 3.0)).norm() < 1e-12);
        // Two and two: the unit square between edges along y and along z.
        let two = corners([[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0]]);
        let (area, centroid) = midsagittal_cut(two).unwrap();
        assert!((area - 1.0).abs() < 1e-12 && centroid.norm() < 1e-12);
    }

    #[test]
    fn a_facet_in_the_plane_is_counted_once() {
        let base = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let on = |apex: [f64; 3]| midsagittal_cut(corners([base[0], base[1], base[2], apex]));
        assert!((on([-1.0, 0.0, 0.0]).unwrap().0 - 0.5).abs() < 1e-12);
        assert_eq!(on([1.0, 0.0, 0.0]), None);
    }
}

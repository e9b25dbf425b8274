//! Integration points of tetrahedra.

/// An integration point.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Point<const K: usize> {
    /// Volume it stands for, m3.
    pub weight_m3: f64,
    /// Gradients of the shape functions, 1/m.
    pub gradients: [[f64; 3]; K],
}

/// Gradients of the barycentric coordinates of a tetrahedron and its volume.
pub(super) fn barycentric_gradients(x: [[f64; 3]; 4]) -> ([[f64; 3]; 4], f64) {
    let edge = |a: usize| [x[a][0] - x[0][0], x[a][1] - x[0][1], x[a][2] - x[0][2]];
    let (e1, e2, e3) = (edge(1), edge(2), edge(3));
    let (c1, c2, c3) = (cross(e2, e3), cross(e3, e1), cross(e1, e2));
    let six_volumes = e1[0] * c1[0] + e1[1] * c1[1] + e1[2] * c1[2];
    let g = |c: [f64; 3]| c.map(|v| v / six_volumes);
    let (g1, g2, g3) = (g(c1), g(c2), g(c3));
    let g0 = [0, 1, 2].map(|i| -g1[i] - g2[i] - g3[i]);
    ([g0, g1, g2, g3], six_volumes / 6.0)
}

pub(in super::super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

//! Elements as nodes, integration points and what is evaluated there; one file per element.
//!
//! At a point with weight V, shape-function gradients G_a and displacement gradient H = sum_a u_a (x) G_a the force on
//! node a is V P(H) G_a and the stiffness between nodes a and b is V G_a . dP/dF . G_b (Bonet and Wood, "Nonlinear
//! Continuum Mechanics for Finite Element Analysis", ch. 9).

mod assembly;
mod kernel;
mod nodal;
mod tet10;
mod tet4;

pub(super) use assembly::{At, Elements, Partition};
pub(super) use kernel::Kernel;
pub(super) use nodal::{NODAL_SHARE, NodalGradient, NodalTangent, Rings};
pub(super) use tet4::tet4;
pub(super) use tet10::{EDGES, tet10, with_mid_edge_nodes};

use serde::{Deserialize, Serialize};

/// Which element carries the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ElementKind {
    /// Linear tetrahedron, one point; locks towards nu = 0.5.
    #[default]
    Tet4,
    /// Linear tetrahedron with deformation averaged over the elements of a tissue around each node: no locking.
    #[serde(alias = "tet4-nodal-pressure")]
    Tet4Nodal,
    /// Quadratic tetrahedron with straight edges, four points: the oracle, several times dearer.
    Tet10,
}

/// An integration point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point<const K: usize> {
    /// Volume it stands for, m3.
    pub weight_m3: f64,
    /// Gradients of the shape functions, 1/m.
    pub gradients: [[f64; 3]; K],
}

/// Gradients of the barycentric coordinates of a tetrahedron and its volume.
fn barycentric_gradients(x: [[f64; 3]; 4]) -> ([[f64; 3]; 4], f64) {
    let edge = |a: usize| [x[a][0] - x[0][0], x[a][1] - x[0][1], x[a][2] - x[0][2]];
    let (e1, e2, e3) = (edge(1), edge(2), edge(3));
    let (c1, c2, c3) = (cross(e2, e3), cross(e3, e1), cross(e1, e2));
    let six_volumes = e1[0] * c1[0] + e1[1] * c1[1] + e1[2] * c1[2];
    let g = |c: [f64; 3]| c.map(|v| v / six_volumes);
    let (g1, g2, g3) = (g(c1), g(c2), g(c3));
    let g0 = [0, 1, 2].map(|i| -g1[i] - g2[i] - g3[i]);
    ([g0, g1, g2, g3], six_volumes / 6.0)
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

//! Elements as nodes, integration points and what is evaluated there; one file per element.
//!
//! At a point with weight V, shape-function gradients G_a and displacement gradient H = sum_a u_a (x) G_a the force on
//! node a is V P(H) G_a and the stiffness between nodes a and b is V G_a . dP/dF . G_b (Bonet and Wood, "Nonlinear
//! Continuum Mechanics for Finite Element Analysis", ch. 9).

mod assembly;
mod kernel;
mod nodal;
mod point;
mod tet10;
mod tet4;

pub(super) use assembly::{At, Elements, Partition};
pub(super) use kernel::Kernel;
pub(super) use nodal::{NODAL_SHARE, NodalGradient, NodalTangent, Rings};
pub(super) use point::cross;
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

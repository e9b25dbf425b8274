//! Elements as nodes, integration points and what is evaluated there; one file per element.
//!
//! At a point with weight V, shape-function gradients G_a and displacement gradient H = sum_a u_a (x) G_a the force on
//! node a is V P(H) G_a and the stiffness between nodes a and b is V G_a . dP/dF . G_b (Bonet and Wood, "Nonlinear
//! Continuum Mechanics for Finite Element Analysis", ch. 9).
//!
//! To add an element, write its file after the manner of `tet4.rs` and name it below: its `mod` line and its line in
//! [`ELEMENTS`]. Scenario files and the tests read that list.

mod assembly;
mod definition;
mod kernel;
mod kind;
mod nodal;
mod plain;
mod point;
mod tet10;
mod tet4;
mod tet4_nodal;

pub(super) use assembly::Partition;
pub(super) use definition::{Body, Laws, Numbered};
pub use kind::ElementKind;
pub(super) use nodal::{NodalTangent, Rings};
pub(super) use point::cross;
pub(super) use tet10::with_mid_edge_nodes;
#[cfg(test)]
pub(super) use {assembly::Elements, plain::Plain};

use definition::Element;

/// The elements, in the order in which they are shown.
static ELEMENTS: [&dyn Element; 3] = [&tet4::Tet4, &tet4_nodal::Tet4Nodal, &tet10::Tet10];

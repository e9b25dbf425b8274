//! What an element is: how a mesh of tetrahedra becomes a body, and what the body can do.

use super::assembly::Partition;
use super::kernel::Kernel;
use super::nodal::{NodalTangent, Rings};
use crate::fem::portion::Portion;
use crate::fem::sparse::{BlockMatrix, BlockPattern};
use crate::material::Hyperelastic;
use crate::material::law::Material;
use std::sync::Arc;

/// A kind of element.
pub(in super::super) trait Element: Sync {
    /// The word in files: `element = "tet4"`.
    fn name(&self) -> &'static str;
    /// Older words for it.
    fn aliases(&self) -> &'static [&'static str];
    /// Whether it has nodes in the middle of its edges.
    fn has_mid_edge_nodes(&self) -> bool;
    /// Poisson's ratio above which its displacements come out too small; `None`: it does not lock.
    fn locks_above(&self) -> Option<f64>;
    /// A mesh as a body of this element.
    fn body(&self, mesh: &Numbered) -> Box<dyn Body>;
}

/// A mesh in the solver's numbering.
pub(in super::super) struct Numbered<'a> {
    /// Solver number of every node, mid-edge nodes behind the mesh's own.
    pub number: &'a [u32],
    /// Nodes in solver numbering, m.
    pub nodes_m: &'a [[f64; 3]],
    /// What fills the cells; every portion is an element.
    pub portions: &'a [Portion],
    pub tets: &'a [[u32; 4]],
    /// The same with mid-edge nodes, where the element has them.
    pub with_mid_edge_nodes: &'a [[u32; 10]],
    pub row_of: &'a [u32],
    pub pattern: &'a BlockPattern,
}

/// Materials made ready for the elements of a model.
pub(in super::super) struct Laws {
    pub kernels: Vec<Kernel>,
    /// What the nodes evaluate, for elements with averaged deformation.
    pub nodal: Vec<Box<dyn Hyperelastic>>,
    /// How many times softer and thicker walls are than they will be: 1 but on the way from rest.
    pub walls_softer: f64,
    /// The stretches that each material was measured at; none where it makes no claim.
    pub measured: Vec<Option<[f64; 2]>>,
}

/// Energy, forces, stiffness and state of a whole body.
pub(in super::super) trait Body: Send + Sync {
    /// Who owns which nodes.
    fn partition(&self, row_of: &[u32], pattern: &BlockPattern) -> Partition;

    /// Materials, in the order the elements count them, made ready.
    fn laws(&self, materials: &[Material]) -> Laws;

    /// Stored energy, J.
    fn energy(&self, u: &[[f64; 3]], laws: &Laws) -> f64;

    /// Internal forces of all nodes and, when a matrix is given, the stiffness of the free ones.
    fn assemble(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        partition: &Partition,
        forces: &mut [[f64; 3]],
        matrix: Option<&mut BlockMatrix>,
        project: bool,
    );

    /// The part of the tangent that is not in the matrix.
    fn nodal_tangent(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        held: Option<Arc<Vec<[bool; 3]>>>,
        project: bool,
    ) -> Option<NodalTangent>;

    /// The pattern of that part.
    fn rings(&self) -> Option<&Rings>;

    /// Per cell of the mesh: mean and least volume ratio, mean energy density (Pa).
    fn state(&self, u: &[[f64; 3]], laws: &Laws) -> Vec<[f64; 3]>;

    /// Per element of a material: the principal stretch that is farthest from rest, the least and the largest of its points.
    fn farthest_stretches(&self, u: &[[f64; 3]], material: u16) -> Vec<[f64; 2]>;

    /// Nodes and volume (m3) of every element.
    fn each_element(&self, with: &mut dyn FnMut(&[u32], f64));

    /// Integral of the product of two shape functions over an element of volume 1.
    fn mass_share(&self, a: usize, b: usize) -> f64;

    /// The elements themselves, for tests that integrate over them.
    #[cfg(test)]
    fn as_any(&self) -> &dyn std::any::Any;
}

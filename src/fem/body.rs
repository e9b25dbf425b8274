//! Elements of one kind and the laws they evaluate: energy, forces, stiffness and state of a whole body.

use super::element::{At, Elements, Kernel, NodalGradient, NodalTangent, Partition};
use super::sparse::BlockMatrix;
use crate::material::Hyperelastic;
use std::sync::Arc;

/// Elements of one kind.
pub(super) enum Body {
    Tet4(Elements<4, 1>),
    Tet4Nodal(Elements<4, 1>, Box<NodalGradient>),
    Tet10(Elements<10, 4>),
}

/// Materials made ready for the elements of a model.
pub(super) struct Laws {
    pub kernels: Vec<Kernel>,
    /// What the nodes evaluate, for elements with averaged deformation.
    pub nodal: Vec<Box<dyn Hyperelastic>>,
}

impl Body {
    pub(super) fn energy(&self, u: &[[f64; 3]], laws: &Laws) -> f64 {
        match self {
            Self::Tet4(elements) => elements.energy(u, &laws.kernels),
            Self::Tet10(elements) => elements.energy(u, &laws.kernels),
            Self::Tet4Nodal(elements, nodal) => elements.energy(u, &laws.kernels) + nodal.energy(u, &laws.nodal),
        }
    }

    /// Internal forces of all nodes and, when a matrix is given, the stiffness of the free ones.
    pub(super) fn assemble(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        partition: &Partition,
        forces: &mut [[f64; 3]],
        matrix: Option<&mut BlockMatrix>,
        project: bool,
    ) {
        let at = At { u, kernels: &laws.kernels, more_stress_pa: None, project };
        match self {
            Self::Tet4(elements) => elements.assemble(at, partition, forces, matrix),
            Self::Tet10(elements) => elements.assemble(at, partition, forces, matrix),
            Self::Tet4Nodal(elements, nodal) => {
                let stresses = nodal.stresses(u, &laws.nodal);
                elements.assemble(At { more_stress_pa: Some(&stresses), ..at }, partition, forces, matrix);
            }
        }
    }

    /// The part of the tangent that is not in the matrix.
    pub(super) fn nodal_tangent(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        held: Option<Arc<Vec<[bool; 3]>>>,
        project: bool,
    ) -> Option<NodalTangent> {
        match self {
            Self::Tet4Nodal(_, nodal) => Some(nodal.tangent(u, &laws.nodal, held, project)),
            _ => None,
        }
    }

    /// Per cell of the mesh: mean and least volume ratio, mean energy density.
    pub(super) fn state(&self, u: &[[f64; 3]], laws: &Laws) -> Vec<[f64; 3]> {
        let (cells, state) = match self {
            Self::Tet4(elements) | Self::Tet4Nodal(elements, _) => (&elements.cell, elements.state(u, &laws.kernels)),
            Self::Tet10(elements) => (&elements.cell, elements.state(u, &laws.kernels)),
        };
        let mut by_cell = vec![[0.0; 3]; state.len()];
        for (cell, state) in cells.iter().zip(state) {
            by_cell[*cell as usize] = state;
        }
        by_cell
    }
}

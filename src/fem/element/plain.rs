//! A body whose elements evaluate the law point by point, each for itself.

use super::assembly::{At, Elements, Partition};
use super::definition::{Body, Laws};
use super::kernel::Kernel;
use super::nodal::{NodalTangent, Rings};
use crate::fem::portion::Portion;
use crate::fem::sparse::{BlockMatrix, BlockPattern};
use crate::material::law::Material;
use std::sync::Arc;

/// Elements, and the integrals of products of their shape functions.
pub(in super::super) struct Plain<const K: usize, const Q: usize> {
    pub elements: Elements<K, Q>,
    pub mass_share: fn(usize, usize) -> f64,
}

/// By cells of the mesh what is known by elements: the portions of a cell deform alike and share its energy.
pub(super) fn by_cell(portions: &[Portion], of_elements: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let cells = portions.iter().map(|p| p.cell as usize + 1).max().unwrap_or(0);
    let mut by_cell = vec![[0.0; 3]; cells];
    for (portion, [mean_j, least_j, energy]) in portions.iter().zip(of_elements) {
        let before = by_cell[portion.cell as usize][2];
        let energy = if portion.share == 1.0 { energy } else { before + portion.share * energy };
        by_cell[portion.cell as usize] = [mean_j, least_j, energy];
    }
    by_cell
}

impl<const K: usize, const Q: usize> Body for Plain<K, Q> {
    fn partition(&self, row_of: &[u32], pattern: &BlockPattern) -> Partition {
        self.elements.partition(row_of, pattern)
    }

    fn laws(&self, materials: &[Material]) -> Laws {
        let kernels = materials.iter().map(|m| Kernel::new(m, m.lame_lambda_pa())).collect();
        Laws { kernels, nodal: Vec::new(), walls_softer: 1.0, measured: Vec::new() }
    }

    fn energy(&self, u: &[[f64; 3]], laws: &Laws) -> f64 {
        self.elements.energy(u, &laws.kernels)
    }

    fn assemble(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        partition: &Partition,
        forces: &mut [[f64; 3]],
        matrix: Option<&mut BlockMatrix>,
        project: bool,
    ) {
        let at = At { u, kernels: &laws.kernels, more_stress_pa: None, project };
        self.elements.assemble(at, partition, forces, matrix);
    }

    fn nodal_tangent(
        &self,
        _u: &[[f64; 3]],
        _laws: &Laws,
        _held: Option<Arc<Vec<[bool; 3]>>>,
        _project: bool,
    ) -> Option<NodalTangent> {
        None
    }

    fn rings(&self) -> Option<&Rings> {
        None
    }

    fn state(&self, u: &[[f64; 3]], laws: &Laws) -> Vec<[f64; 3]> {
        by_cell(&self.elements.portions, self.elements.state(u, &laws.kernels))
    }

    fn farthest_stretches(&self, u: &[[f64; 3]], material: u16) -> Vec<[f64; 2]> {
        self.elements.farthest_stretches(u, material)
    }

    fn each_element(&self, with: &mut dyn FnMut(&[u32], f64)) {
        for (nodes, points) in self.elements.nodes.iter().zip(&self.elements.points) {
            with(nodes, points.iter().map(|p| p.weight_m3).sum());
        }
    }

    fn mass_share(&self, a: usize, b: usize) -> f64 {
        (self.mass_share)(a, b)
    }

    #[cfg(test)]
    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}

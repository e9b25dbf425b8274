//! The linear tetrahedron with deformation averaged over the elements of a tissue around each node; see
//! [`nodal`](super::nodal).

use super::assembly::{At, Elements, Partition};
use super::definition::{Body, Element, Laws, Numbered};
use super::kernel::Kernel;
use super::nodal::{NODAL_SHARE, NodalGradient, NodalTangent, Rings};
use super::plain::by_cell;
use super::tet4;
use crate::fem::sparse::{BlockMatrix, BlockPattern};
use crate::material::law::{Material, Parameter};
use std::sync::Arc;

/// The element; it does not lock.
pub(super) struct Tet4Nodal;

impl Element for Tet4Nodal {
    fn name(&self) -> &'static str {
        "tet4-nodal"
    }

    fn aliases(&self) -> &'static [&'static str] {
        &["tet4-nodal-pressure"]
    }

    fn has_mid_edge_nodes(&self) -> bool {
        false
    }

    fn locks_above(&self) -> Option<f64> {
        None
    }

    fn body(&self, mesh: &Numbered) -> Box<dyn Body> {
        let elements = tet4::elements(mesh);
        let nodal = NodalGradient::new(&elements, mesh.row_of);
        Box::new(Averaged { elements, nodal })
    }
}

struct Averaged {
    elements: Elements<4, 1>,
    nodal: NodalGradient,
}

impl Body for Averaged {
    fn partition(&self, row_of: &[u32], pattern: &BlockPattern) -> Partition {
        self.elements.partition(row_of, pattern)
    }

    fn laws(&self, materials: &[Material]) -> Laws {
        // Every law has a stiffness.
        let part = |m: &Material, part: f64| m.scaled(Parameter::Stiffness, part).unwrap_or_else(|| m.clone());
        Laws {
            kernels: materials.iter().map(|m| Kernel::new(&part(m, 1.0 - NODAL_SHARE), 0.0)).collect(),
            nodal: materials.iter().map(|m| part(m, NODAL_SHARE).law_with_lambda(m.lame_lambda_pa())).collect(),
            walls_softer: 1.0,
            measured: Vec::new(),
        }
    }

    fn energy(&self, u: &[[f64; 3]], laws: &Laws) -> f64 {
        self.elements.energy(u, &laws.kernels) + self.nodal.energy(u, &laws.nodal)
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
        let stresses = self.nodal.stresses(u, &laws.nodal);
        let at = At { u, kernels: &laws.kernels, more_stress_pa: Some(&stresses), project };
        self.elements.assemble(at, partition, forces, matrix);
    }

    fn nodal_tangent(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        held: Option<Arc<Vec<[bool; 3]>>>,
        project: bool,
    ) -> Option<NodalTangent> {
        Some(self.nodal.tangent(u, &laws.nodal, held, project))
    }

    fn rings(&self) -> Option<&Rings> {
        Some(self.nodal.rings())
    }

    fn state(&self, u: &[[f64; 3]], laws: &Laws) -> Vec<[f64; 3]> {
        let mut state = self.elements.state(u, &laws.kernels);
        let averaged = self.nodal.energy_density(u, &laws.nodal);
        state.iter_mut().zip(averaged).for_each(|(state, extra)| state[2] += extra);
        by_cell(&self.elements.portions, state)
    }

    fn farthest_stretches(&self, u: &[[f64; 3]], material: u16) -> Vec<[f64; 2]> {
        self.elements.farthest_stretches(u, material)
    }

    fn each_element(&self, with: &mut dyn FnMut(&[u32], f64)) {
        for (nodes, [point]) in self.elements.nodes.iter().zip(&self.elements.points) {
            with(nodes, point.weight_m3);
        }
    }

    fn mass_share(&self, a: usize, b: usize) -> f64 {
        tet4::mass_share(a, b)
    }

    #[cfg(test)]
    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}

//! Other loads on a model that stays as it is: gravity, fluid, pressures change; numbering, pattern and supports do not.

use super::super::buoyancy::Buoyancy;
use super::super::check::check_settings;
use super::super::element::with_mid_edge_nodes;
use super::super::load::{NodalForces, nodal_forces_n};
use super::super::model::Model;
use super::super::scenario::{Loads, MassKind, Method, Scenario};
use super::super::sharing::Sharing;
use super::super::{FemError, load::Load};
use crate::mesh::TetMesh;

impl Model {
    /// Puts other loads in the place of the scenario's, on the mesh that the model was made of (cut open, as
    /// [`Scenario::body`] leaves it).
    ///
    /// # Errors
    /// As [`Model::new`] for the loads.
    pub fn set_loads(&mut self, mesh: &TetMesh, loads: &Loads) -> Result<(), FemError> {
        let scenario = Scenario { loads: loads.clone(), ..self.scenario.clone() };
        check_settings(&scenario)?;
        let quadratic = (!self.edges.is_empty()).then(|| with_mid_edge_nodes(self.corners, mesh.tets()));
        let ends = quadratic.as_ref().map(|(tets, edges)| (&tets[..], &edges[..]));
        let moving = scenario.solver.method == Method::BackwardEuler;
        let lumped = moving && scenario.dynamics.mass == MassKind::Lumped;
        let sharing = Sharing { mesh, quadratic: ends, lumped };
        let buoyancy = Buoyancy::new(&sharing, loads);
        let parts = nodal_forces_n(&sharing, loads, buoyancy.as_ref())?;
        let mut order = vec![0u32; self.number.len()];
        self.number.iter().enumerate().for_each(|(old, &new)| order[new as usize] = old as u32);
        let ordered = |(load, forces): (Load, Vec<[f64; 3]>)| -> NodalForces {
            (load, order.iter().map(|&old| forces[old as usize]).collect())
        };
        self.load_parts = parts.into_iter().map(ordered).collect();
        self.load_n = vec![[0.0; 3]; self.nodes_m.len()];
        for (_, forces) in &self.load_parts {
            for (sum, force) in self.load_n.iter_mut().zip(forces) {
                (0..3).for_each(|i| sum[i] += force[i]);
            }
        }
        self.buoyancy = buoyancy.map(|b| b.ordered(&order));
        self.scenario.loads = scenario.loads;
        Ok(())
    }
}

//! Forces and stiffness of a body at a state.

use super::linear::Tangent;
use super::model::{Model, Projected};
use super::scenario::Materials;
use super::{FemError, State};

/// Internal forces and tangent stiffness at a state: what a solver, an integrator or an eigenvalue iteration of one's
/// own needs. Vectors have one entry per node of the mesh, which mid-edge nodes follow; held components are zero.
pub struct Stiffness<'a> {
    model: &'a Model,
    tangent: Tangent,
    /// Solver numbering, N.
    forces: Vec<[f64; 3]>,
}

impl Model {
    /// Internal forces and tangent stiffness at a state, the tangent as it is: indefinite where the body is unstable.
    ///
    /// # Errors
    /// As [`Model::solve`] for the materials.
    pub fn stiffness(&self, materials: &Materials, state: &State) -> Result<Stiffness<'_>, FemError> {
        let laws = self.laws(materials)?;
        let mut forces = vec![[0.0; 3]; self.nodes_m.len()];
        let tangent = self.tangent(&state.u, &laws, &mut forces, Projected::Nothing, None);
        Ok(Stiffness { model: self, tangent, forces })
    }
}

impl Stiffness<'_> {
    /// Derivative of the stored energy by the displacement of every free node, N.
    pub fn internal_force_n(&self) -> Vec<[f64; 3]> {
        self.on_nodes(&self.model.free_part(&self.forces))
    }

    /// Change of the internal forces (N, to first order) with a displacement of the free nodes (mm).
    ///
    /// # Errors
    /// As [`Model::state`].
    pub fn times(&self, displacement_mm: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, FemError> {
        let along = self.model.free_part(&self.model.state(displacement_mm)?.u);
        let mut change = vec![[0.0; 3]; along.len()];
        self.tangent.product(&along, &mut change);
        Ok(self.on_nodes(&change))
    }

    /// Free rows on the nodes of the mesh.
    fn on_nodes(&self, rows: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut nodes = vec![[0.0; 3]; self.forces.len()];
        self.model.add_free(&mut nodes, 1.0, rows);
        let model = self.model;
        let mut of_mesh: Vec<[f64; 3]> = model.number[..model.corners].iter().map(|&n| nodes[n as usize]).collect();
        // A mid-edge node moves half as its either end does.
        for (ends, &middle) in model.edges.iter().zip(&model.number[model.corners..]) {
            for &end in ends {
                let row = model.row_of[model.number[end as usize] as usize];
                let held = model.held_of_row(row);
                for i in (0..3).filter(|&i| !held[i]) {
                    of_mesh[end as usize][i] += 0.5 * nodes[middle as usize][i];
                }
            }
        }
        of_mesh
    }
}

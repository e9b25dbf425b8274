//! A cortex stuck to the skull where it faces down: no supports that an estimate believes in, but a brain may have had them all the
//! same. Where nothing is seen to move stiffness is not the only reason for it, and a bound on it has to hold under these as well.

use super::skull::SkullSettings;
use super::supports::{PIAL, with_sliding_sets};
use crate::fem::Scenario;
use crate::mesh::TetMesh;
use nalgebra::Vector3;

/// Node set of the cortex that sticks to the bone below it.
pub const STUCK: &str = "stuck";

/// Cortex counts as pressed onto the bone where its outward normal is within 60 degrees of gravity: half or more of the weight
/// above presses it there.
const PRESSED_COSINE: f64 = 0.5;

/// A scenario of held sets whose cortex sticks to the skull as well, where it faces down: for a mesh of [`with_stuck_set`].
#[must_use]
pub fn with_stuck_cortex(held: &Scenario) -> Scenario {
    let mut scenario = held.clone();
    scenario.fixed.push(STUCK.to_owned());
    scenario
}

/// The mesh with [`STUCK`]: nodes of the cortex ([`PIAL`]) whose outward normal is within 60 degrees of gravity.
#[must_use]
pub fn with_stuck_set(mut mesh: TetMesh, skull: &SkullSettings, gravity_m_per_s2: [f64; 3]) -> TetMesh {
    let tagged = with_sliding_sets(&mesh, skull);
    let normals = mesh.node_normals_mm2(tagged.facet_sets.get(PIAL).map_or(&[][..], Vec::as_slice));
    let down = Vector3::from(gravity_m_per_s2).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    let pressed = |n: &u32| {
        let normal = normals[*n as usize];
        normal.dot(&down) > PRESSED_COSINE * normal.norm()
    };
    let stuck = (0..normals.len() as u32).filter(pressed).collect();
    mesh.node_sets.insert(STUCK.to_owned(), stuck);
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;

    #[test]
    fn what_lies_on_the_skull_faces_down_whichever_way_that_is() {
        let mesh = block(4);
        let skull = SkullSettings { brainstem_cut_mm: -1.0, ..SkullSettings::default() };
        for (axis, sign) in [(0, 1.0), (1, -1.0), (2, 1.0)] {
            let mut gravity = [0.0; 3];
            gravity[axis] = 9.81 * sign;
            let stuck = with_stuck_set(mesh.clone(), &skull, gravity).node_sets[STUCK].clone();
            let end = |n: u32| sign * mesh.nodes_mm()[n as usize][axis];
            let farthest = (0..mesh.nodes_mm().len() as u32).map(end).fold(f64::NEG_INFINITY, f64::max);
            assert!(!stuck.is_empty() && stuck.iter().all(|&n| (end(n) - farthest).abs() < 1e-9));
        }
    }
}

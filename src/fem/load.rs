//! Loads as forces on nodes (N). All are dead loads: found on the undeformed shape, constant in size and direction.

use super::buoyancy::Buoyancy;
use super::scenario::Loads;
use super::sharing::Sharing;
use super::units::{METRES_PER_MM, metres};
use super::{FemError, element::cross};
use crate::mesh::TetMesh;
use serde::{Deserialize, Serialize};

/// Weight of each tetrahedron shared by its nodes (equally by the four corners of a linear one).
fn add_weight_n(sharing: &Sharing, loads: &Loads, forces: &mut [[f64; 3]]) {
    let g = loads.gravity_m_per_s2;
    let cubic = METRES_PER_MM.powi(3);
    for tet in 0..sharing.mesh.tets().len() {
        let volume = sharing.mesh.volume_mm3(tet) * cubic;
        for (n, share) in sharing.of_tet(tet) {
            let mass = share * volume * loads.density_kg_per_m3;
            (0..3).for_each(|i| forces[n as usize][i] += mass * g[i]);
        }
    }
}

/// The facets of a set: the facet set of that name, else the boundary facets with all three nodes in the node set.
/// Outward facets of the boundary keep their orientation.
pub(super) fn facets_of(mesh: &TetMesh, set: &str) -> Result<Vec<[u32; 3]>, FemError> {
    let facets = match (mesh.facet_sets.get(set), mesh.node_sets.get(set)) {
        (Some(facets), _) => facets.clone(),
        (None, Some(nodes)) => {
            let inside = |n: &u32| nodes.binary_search(n).is_ok();
            mesh.boundary_facets(|_| true).into_iter().filter(|f| f.iter().all(inside)).collect()
        }
        (None, None) => return Err(FemError::unknown_set(mesh, set)),
    };
    if facets.is_empty() {
        return Err(FemError::NoFacets { set: set.to_owned() });
    }
    Ok(facets)
}

/// Area vector of a facet, m2, along its normal.
pub(super) fn area_m2(mesh: &TetMesh, facet: [u32; 3]) -> [f64; 3] {
    let [a, b, c] = facet.map(|n| metres(mesh.nodes_mm()[n as usize]));
    let d = |x: [f64; 3]| [x[0] - a[0], x[1] - a[1], x[2] - a[2]];
    cross(d(b), d(c)).map(|v| 0.5 * v)
}

fn size(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// One of a scenario's loads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Load {
    /// The weight, less what the fluid carries.
    Weight,
    /// `loads.patch[n]`.
    Patch(usize),
    /// `loads.pressure[n]`.
    Pressure(usize),
}

/// A load with its forces on the nodes, N.
pub(super) type NodalForces = (Load, Vec<[f64; 3]>);

/// Every load as forces on the nodes; a fluid's part of the weight is given.
pub(super) fn nodal_forces_n(
    sharing: &Sharing,
    loads: &Loads,
    buoyancy: Option<&Buoyancy>,
) -> Result<Vec<NodalForces>, FemError> {
    let mesh = sharing.mesh;
    let none = || vec![[0.0; 3]; sharing.nodes()];
    let mut parts = Vec::new();
    if loads.gravity_m_per_s2 != [0.0; 3] {
        let mut forces = none();
        add_weight_n(sharing, loads, &mut forces);
        for (force, lift) in forces.iter_mut().zip(buoyancy.iter().flat_map(|b| &b.lift_n)) {
            (0..3).for_each(|i| force[i] += lift[i]);
        }
        parts.push((Load::Weight, forces));
    }
    for (n, patch) in loads.patch.iter().enumerate() {
        let mut forces = none();
        let facets = facets_of(mesh, &patch.set)?;
        let areas: Vec<f64> = facets.iter().map(|&f| size(area_m2(mesh, f))).collect();
        let whole: f64 = areas.iter().sum();
        for (facet, area) in facets.iter().zip(&areas) {
            for n in sharing.of_facet(*facet) {
                (0..3).for_each(|i| forces[n as usize][i] += patch.force_n[i] * area / (3.0 * whole));
            }
        }
        parts.push((Load::Patch(n), forces));
    }
    for (n, pressure) in loads.pressure.iter().enumerate() {
        let mut forces = none();
        for facet in facets_of(mesh, &pressure.set)? {
            let area = area_m2(mesh, facet);
            for n in sharing.of_facet(facet) {
                (0..3).for_each(|i| forces[n as usize][i] -= pressure.pressure_pa * area[i] / 3.0);
            }
        }
        parts.push((Load::Pressure(n), forces));
    }
    Ok(parts)
}

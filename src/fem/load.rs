//! Loads as forces on nodes (N). All are dead loads: found on the undeformed shape, constant in size and direction.

use super::buoyancy::Buoyancy;
use super::scenario::Loads;
use super::sharing::Sharing;
use super::units::{METRES_PER_MM, metres};
use super::{FemError, element::cross};
use crate::mesh::TetMesh;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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

/// The facets of loaded facet sets that a tetrahedron has, by their sorted nodes, and whether they lie between two.
struct Bearing(BTreeMap<[u32; 3], bool>);

impl Bearing {
    /// The mesh's facets are only looked at where a facet set is loaded: of a node set only facets of the boundary are taken.
    fn of(mesh: &TetMesh, loads: &Loads) -> Option<Self> {
        let sets = loads.patch.iter().map(|l| &l.set).chain(loads.pressure.iter().map(|l| &l.set));
        let drawn: Vec<&Vec<[u32; 3]>> = sets.filter_map(|set| mesh.facet_sets.get(set)).collect();
        if drawn.is_empty() {
            return None;
        }
        let mut loaded: Vec<[u32; 3]> = drawn.into_iter().flatten().map(|facet| sorted(*facet)).collect();
        loaded.sort_unstable();
        let facets = mesh.facets().into_iter().map(|(facet, _, other)| (sorted(facet), other.is_some()));
        Some(Self(facets.filter(|(facet, _)| loaded.binary_search(facet).is_ok()).collect()))
    }

    /// A facet of no tetrahedron would take its part of the load and hand it to nothing, or to nodes far from the set's area.
    fn check_cells(&self, set: &str, facets: &[[u32; 3]]) -> Result<(), FemError> {
        let stray = facets.iter().filter(|facet| !self.0.contains_key(&sorted(**facet))).count();
        if stray == 0 { Ok(()) } else { Err(FemError::StrayFacets { set: set.to_owned(), stray, of: facets.len() }) }
    }

    /// A facet between two tetrahedra has the side that it is turned to. Where two neighbours go along their edge the same way they
    /// are turned to different sides, and their pressures cancel.
    fn check_sides(&self, set: &str, facets: &[[u32; 3]]) -> Result<(), FemError> {
        let within = facets.iter().filter(|facet| self.0.get(&sorted(**facet)) == Some(&true));
        let mut edges: Vec<[u32; 2]> = within.flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        edges.sort_unstable();
        match edges.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(FemError::NoSide { set: set.to_owned(), ends: pair[0] }),
            None => Ok(()),
        }
    }
}

fn sorted(mut facet: [u32; 3]) -> [u32; 3] {
    facet.sort_unstable();
    facet
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
    let bearing = Bearing::of(mesh, loads);
    let bearing = |set: &String| bearing.as_ref().filter(|_| mesh.facet_sets.contains_key(set));
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
        if let Some(bearing) = bearing(&patch.set) {
            bearing.check_cells(&patch.set, &facets)?;
        }
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
        let facets = facets_of(mesh, &pressure.set)?;
        if let Some(bearing) = bearing(&pressure.set) {
            bearing.check_cells(&pressure.set, &facets)?;
            bearing.check_sides(&pressure.set, &facets)?;
        }
        for facet in facets {
            let area = area_m2(mesh, facet);
            for n in sharing.of_facet(facet) {
                (0..3).for_each(|i| forces[n as usize][i] -= pressure.pressure_pa * area[i] / 3.0);
            }
        }
        parts.push((Load::Pressure(n), forces));
    }
    Ok(parts)
}

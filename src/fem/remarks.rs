//! What of a mesh and a scenario is allowed but hardly meant. A [`super::Model`] is also made to be loaded later, or changed by hand,
//! so only a simulation from beginning to end is told of it.

use super::contact::Wall;
use super::scenario::{DynamicsSettings, Method, Prescribed, Scenario};
use super::{FemWarning, Outcome};
use crate::mesh::TetMesh;

/// An outcome with what should be known of its mesh and scenario.
pub(super) fn with_remarks(mesh: &TetMesh, scenario: &Scenario, mut outcome: Outcome) -> Outcome {
    outcome.warnings.extend(unloaded(scenario));
    outcome.warnings.extend(fluid_without_gravity(scenario));
    outcome.warnings.extend(steps_of_no_motion(scenario));
    outcome.warnings.extend(unglued(mesh, scenario));
    outcome
}

/// Nothing pulls, pushes or moves the body. A plane may: it stands where it stands, be it in the body.
fn unloaded(scenario: &Scenario) -> Option<FemWarning> {
    let loads = &scenario.loads;
    let moves = |p: &Prescribed| (0..3).any(|i| p.components[i] && p.displacement_mm[i] != 0.0);
    let loaded = loads.gravity_m_per_s2 != [0.0; 3]
        || loads.patch.iter().any(|patch| patch.force_n != [0.0; 3])
        || loads.pressure.iter().any(|pressure| pressure.pressure_pa != 0.0)
        || scenario.prescribed.iter().any(moves)
        || scenario.contact.iter().any(|contact| matches!(contact.wall, Wall::Plane { .. }));
    (!loaded).then_some(FemWarning::Unloaded)
}

/// A fluid carries weight, and without gravity there is none.
fn fluid_without_gravity(scenario: &Scenario) -> Option<FemWarning> {
    let loads = &scenario.loads;
    (loads.csf.is_some() && loads.gravity_m_per_s2 == [0.0; 3]).then_some(FemWarning::FluidWithoutGravity)
}

/// Steps in time for an equilibrium, which has none.
fn steps_of_no_motion(scenario: &Scenario) -> Option<FemWarning> {
    let unused = scenario.solver.method == Method::Static && scenario.dynamics != DynamicsSettings::default();
    unused.then_some(FemWarning::StepsOfNoMotion)
}

/// Facets of the outside that lie upon one another without sharing their nodes: regions that were meshed one by one and never glued.
/// Along a set that the scenario holds, moves or has stand before a wall nodes are doubled on purpose, by [`Scenario::body`] too.
fn unglued(mesh: &TetMesh, scenario: &Scenario) -> Option<FemWarning> {
    let named = scenario
        .held()
        .chain(scenario.supports.keys())
        .chain(scenario.contact.iter().map(|contact| &contact.set))
        .chain(scenario.tethers.iter().map(|tether| &tether.set))
        .chain(scenario.prescribed.iter().map(|prescribed| &prescribed.set));
    let members = |set: &String| -> Vec<u32> {
        let of_facets = mesh.facet_sets.get(set).into_iter().flatten().flatten();
        let mut members: Vec<u32> = mesh.node_sets.get(set).into_iter().flatten().chain(of_facets).copied().collect();
        members.sort_unstable();
        members
    };
    let on_purpose: Vec<Vec<u32>> = named.map(members).collect();
    let meant = |facet: &[u32; 3]| on_purpose.iter().any(|set| facet.iter().all(|n| set.binary_search(n).is_ok()));
    let place = |facet: [u32; 3]| {
        // Zero has two signs, which are the same place.
        let mut corners = facet.map(|n| mesh.nodes_mm()[n as usize].map(|x| (x + 0.0).to_bits()));
        corners.sort_unstable();
        corners
    };
    let outside = mesh.boundary_facets(|_| true).into_iter().filter(|facet| !meant(facet));
    let mut places: Vec<([[u64; 3]; 3], [u32; 3])> = outside.map(|facet| (place(facet), facet)).collect();
    places.sort_unstable();
    let mut doubled = places.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1).map(|same| same[0].1).peekable();
    let at_mm = mesh.facet_centroid_mm(*doubled.peek()?);
    Some(FemWarning::Unglued { facets: doubled.count(), at_mm })
}

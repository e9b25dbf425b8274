//! What the page is told of the body: what can be set, and how it stands.

use super::body::LiveBody;
use super::colours::Colours;
use super::session::Session;
use crate::material::law::LAWS;
use std::collections::{BTreeMap, BTreeSet};

/// Boundary sets that are shown by themselves: the walls that a brain shift is seen on inside.
const WALLS: [&str; 2] = ["ventricle", "margin"];

/// What the page needs to know of the body.
pub(super) fn hello(body: &LiveBody, session: &Session, colours: &Colours) -> serde_json::Value {
    let scenario = session.scenario();
    let mesh = session.mesh();
    let tissues: Vec<serde_json::Value> = body
        .tissues
        .iter()
        .filter_map(|tissue| {
            let material = scenario.materials.get(&tissue.name)?;
            Some(serde_json::json!({
                "name": tissue.name,
                "prior": tissue.prior,
                "posterior": tissue.posterior,
                "shear_modulus_pa": material.shear_modulus_pa(),
                "poisson_ratio": material.poisson_ratio(),
                "law": material.name(),
            }))
        })
        .collect();
    let held: Vec<&String> = scenario.held().collect();
    let sets: Vec<&String> = mesh.node_sets.keys().collect();
    // A set may be there as nodes and as facets.
    let pressed: BTreeSet<&String> = mesh.node_sets.keys().chain(mesh.facet_sets.keys()).collect();
    let walls: BTreeMap<&str, &Vec<u32>> =
        WALLS.into_iter().filter_map(|set| Some((set, mesh.node_sets.get(set)?))).collect();
    let laws: Vec<&str> = LAWS.into_iter().map(|law| law.card().name).collect();
    serde_json::json!({
        "name": body.name,
        "notes": body.notes,
        "nodes": mesh.nodes_mm().len(),
        "tets": mesh.tets().len(),
        "tissues": tissues,
        "laws": laws,
        "colours": colours.known(),
        "walls": walls,
        "sets": sets,
        "held": held,
        "pressed": pressed,
        "pressure": scenario.loads.pressure,
        "gravity_m_per_s2": scenario.loads.gravity_m_per_s2,
        // What "as in the scenario" means: a page that comes later has never seen it.
        "scenario_gravity_m_per_s2": body.scenario.loads.gravity_m_per_s2,
        "density_kg_per_m3": scenario.loads.density_kg_per_m3,
        "resection": session.resection(),
        "quasi_static": session.is_quasi_static(),
        "csf_level_mm": scenario.loads.csf.map(|csf| csf.level_mm),
    })
}

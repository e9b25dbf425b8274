//! What must hold of mesh and scenario before anything is solved.

use super::contact::{Support, Wall};
use super::order::Graph;
use super::scenario::{Materials, Prescribed, Scenario};
use super::{FemError, FemWarning};
use crate::mesh::TetMesh;

/// The node set of a name.
pub(super) fn node_set<'a>(mesh: &'a TetMesh, set: &str) -> Result<&'a [u32], FemError> {
    let nodes = mesh.node_sets.get(set).ok_or_else(|| FemError::unknown_nodes(mesh, set))?;
    if nodes.is_empty() { Err(FemError::EmptySet { set: set.to_owned() }) } else { Ok(nodes) }
}

pub(super) fn check_settings(scenario: &Scenario) -> Result<(), FemError> {
    let refuse = |key: &str, value: f64, rule| Err(FemError::Setting { key: key.to_owned(), value, rule });
    let loads = &scenario.loads;
    let mut numbers: Vec<(String, f64)> = vec![("loads.density_kg_per_m3".into(), loads.density_kg_per_m3)];
    numbers.extend(loads.gravity_m_per_s2.iter().map(|&v| ("loads.gravity_m_per_s2".into(), v)));
    for patch in &loads.patch {
        numbers.extend(patch.force_n.iter().map(|&v| (format!("loads.patch.force_n` of set `{}", patch.set), v)));
    }
    for p in &loads.pressure {
        numbers.push((format!("loads.pressure.pressure_pa` of set `{}", p.set), p.pressure_pa));
    }
    if let Some(p) = scenario.prescribed.iter().find(|p| p.components == [false; 3]) {
        return Err(FemError::NothingPrescribed { set: p.set.clone() });
    }
    for p in &scenario.prescribed {
        let key = format!("prescribed.displacement_mm` of set `{}", p.set);
        numbers.extend(p.displacement_mm.iter().map(|&v| (key.clone(), v)));
    }
    if let Some(csf) = loads.csf {
        numbers.push(("loads.csf.density_kg_per_m3".into(), csf.density_kg_per_m3));
        numbers.push(("loads.csf.level_mm".into(), csf.level_mm));
    }
    for contact in &scenario.contact {
        let key = |name: &str| format!("contact.{name}` of set `{}", contact.set);
        numbers.push((key("gap_mm"), contact.gap_mm));
        if let Wall::Plane { point_mm, normal } = &contact.wall {
            numbers.extend(point_mm.iter().map(|&v| (key("wall.point_mm"), v)));
            numbers.extend(normal.iter().map(|&v| (key("wall.normal"), v)));
        }
    }
    if let Some((key, value)) = numbers.into_iter().find(|(_, v)| !v.is_finite()) {
        return refuse(&key, value, "a finite number");
    }
    if loads.density_kg_per_m3 <= 0.0 {
        return refuse("loads.density_kg_per_m3", loads.density_kg_per_m3, "positive");
    }
    if let Some(csf) = loads.csf.filter(|csf| csf.density_kg_per_m3 <= 0.0) {
        return refuse("loads.csf.density_kg_per_m3", csf.density_kg_per_m3, "positive (1007 for cerebrospinal fluid)");
    }
    for contact in &scenario.contact {
        let key = |name: &str| format!("contact.{name}` of set `{}", contact.set);
        for (name, value) in
            [("stiffness_pa_per_mm", contact.stiffness_pa_per_mm), ("softness_mm", contact.softness_mm)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(&key(name), value, "positive");
            }
        }
        if contact.gap_mm < 0.0 {
            return refuse(&key("gap_mm"), contact.gap_mm, "0 or more");
        }
        if let Wall::Plane { normal, .. } = contact.wall {
            if normal == [0.0; 3] {
                return refuse(&key("wall.normal"), 0.0, "a direction, not [0, 0, 0]");
            }
            if contact.gap_mm != 0.0 {
                return refuse(
                    &key("gap_mm"),
                    contact.gap_mm,
                    "left out before a plane, which stands where `wall.point_mm` is",
                );
            }
        }
    }
    for tether in &scenario.tethers {
        if !(tether.stiffness_pa_per_mm >= 0.0 && tether.stiffness_pa_per_mm.is_finite()) {
            let key = format!("tethers.stiffness_pa_per_mm` of set `{}", tether.set);
            return refuse(&key, tether.stiffness_pa_per_mm, "0 or more");
        }
    }
    let solver = &scenario.solver;
    if !(1e-13..1.0).contains(&solver.relative_residual) {
        return refuse("solver.relative_residual", solver.relative_residual, "at least 1e-13 and below 1");
    }
    if !(solver.smallest_load_step > 0.0 && solver.smallest_load_step <= 1.0) {
        return refuse("solver.smallest_load_step", solver.smallest_load_step, "above 0 and at most 1");
    }
    if solver.newton_iterations == 0 {
        return refuse("solver.newton_iterations", 0.0, "at least 1");
    }
    let dynamics = &scenario.dynamics;
    if !(dynamics.time_step_s > 0.0 && dynamics.time_step_s.is_finite()) {
        return refuse("dynamics.time_step_s", dynamics.time_step_s, "positive");
    }
    for (key, value) in [
        ("dynamics.mass_damping_per_s", dynamics.mass_damping_per_s),
        ("dynamics.stiffness_damping_s", dynamics.stiffness_damping_s),
        ("dynamics.rest_speed_mm_per_s", dynamics.rest_speed_mm_per_s),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return refuse(key, value, "0 or more");
        }
    }
    Ok(())
}

/// No set is held in two ways that exclude each other. Not of a model that is changed while it is looked at: there a set that slides
/// may be held for a while.
pub(super) fn check_supports(mesh: &TetMesh, scenario: &Scenario) -> Result<(), FemError> {
    check_movements(mesh, scenario)?;
    let sliding = |set: &String| scenario.supports.get(set) == Some(&Support::Sliding);
    if let Some(set) = scenario.fixed.iter().find(|set| sliding(set)) {
        return Err(FemError::TwoSupports {
            set: set.clone(),
            first: "held in `fixed`",
            second: "sliding in `supports`",
        });
    }
    let moved = scenario.prescribed.iter().filter(|p| p.displacement_mm != [0.0; 3]);
    match moved.map(|p| &p.set).find(|set| scenario.held().any(|held| held == *set)) {
        Some(set) => Err(FemError::TwoSupports { set: set.clone(), first: "held", second: "moved in `prescribed`" }),
        None => Ok(()),
    }
}

/// No node is moved to two places.
fn check_movements(mesh: &TetMesh, scenario: &Scenario) -> Result<(), FemError> {
    let apart = |p: &Prescribed, q: &Prescribed| {
        (0..3).any(|a| p.components[a] && q.components[a] && p.displacement_mm[a] != q.displacement_mm[a])
    };
    for (n, second) in scenario.prescribed.iter().enumerate() {
        for first in scenario.prescribed[..n].iter().filter(|first| apart(first, second)) {
            let (of_first, of_second) = (node_set(mesh, &first.set)?, node_set(mesh, &second.set)?);
            if let Some(&node) = of_first.iter().find(|node| of_second.binary_search(node).is_ok()) {
                let [first, second] = [first, second].map(|p| p.set.clone());
                return Err(FemError::TwoMovements { first, second, node });
            }
        }
    }
    Ok(())
}

/// Nodes of a set that moves which a set that is held keeps where they are: the edge between two faces, or a slip.
pub(super) fn stays_held(mesh: &TetMesh, scenario: &Scenario) -> Result<Vec<FemWarning>, FemError> {
    let held: Vec<&[u32]> = scenario.held().map(|set| node_set(mesh, set)).collect::<Result<_, _>>()?;
    let mut found = Vec::new();
    for moved in scenario.prescribed.iter().filter(|p| p.displacement_mm != [0.0; 3]) {
        let of_set = node_set(mesh, &moved.set)?;
        let nodes = of_set.iter().filter(|node| held.iter().any(|held| held.binary_search(node).is_ok())).count();
        if nodes > 0 {
            found.push(FemWarning::StaysHeld { set: moved.set.clone(), nodes, of: of_set.len() });
        }
    }
    Ok(found)
}

/// Tissue lighter than the fluid around it floats.
pub(super) fn floating(scenario: &Scenario) -> Option<FemWarning> {
    let tissue = scenario.loads.density_kg_per_m3;
    let fluid = scenario.loads.csf?.density_kg_per_m3;
    (tissue < fluid).then_some(FemWarning::LighterThanFluid { tissue, fluid })
}

/// Every material obeys its rules.
pub(super) fn check_materials(materials: &Materials) -> Result<(), FemError> {
    for (name, material) in materials {
        material.check().map_err(|source| FemError::Material { name: name.clone(), source })?;
    }
    Ok(())
}

/// Every piece of the body needs a held node, or it would drift.
pub(super) fn check_held_together(graph: &Graph, held: &[[bool; 3]]) -> Result<(), FemError> {
    let mut reached: Vec<bool> = held.iter().map(|h| *h != [false; 3]).collect();
    let mut front: Vec<u32> = (0..reached.len() as u32).filter(|&n| reached[n as usize]).collect();
    while let Some(n) = front.pop() {
        for &m in graph.of(n as usize) {
            if !std::mem::replace(&mut reached[m as usize], true) {
                front.push(m);
            }
        }
    }
    let loose = |n: &usize| !reached[*n] && !graph.of(*n).is_empty();
    match (0..reached.len()).find(loose) {
        Some(node) => Err(FemError::Loose { nodes: (0..reached.len()).filter(loose).count(), node }),
        None => Ok(()),
    }
}

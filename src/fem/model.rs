//! A mesh made ready for many solves: numbering, pattern, held nodes and loads are found once, materials come with
//! every solve.

use super::element::{
    At, ElementKind, Elements, Kernel, NODAL_SHARE, NodalGradient, NodalTangent, Partition, tet4, tet10,
    with_mid_edge_nodes,
};
use super::linear::{Symbolic, Tangent};
use super::load::{NodalForces, Sharing, nodal_forces_n};
use super::order::{Graph, reverse_cuthill_mckee};
use super::scenario::{MassKind, Method, Scenario};
use super::sparse::{BlockMatrix, BlockPattern, HELD};
use super::units::{metres, millimetres};
use super::{FemError, Outcome, State};
use crate::material::Hyperelastic;
use crate::material::law::{Material, Parameter};
use crate::mesh::TetMesh;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Materials by label name.
pub type Materials = BTreeMap<String, Material>;

/// A mesh with held nodes and loads, ready to be solved with any materials.
pub struct Model {
    pub(super) scenario: Scenario,
    pub(super) body: Body,
    pub(super) pattern: Arc<BlockPattern>,
    pub(super) partition: Partition,
    /// Row of every node in solver numbering, or [`HELD`].
    pub(super) row_of: Vec<u32>,
    /// Node of every row.
    pub(super) node_of_row: Vec<u32>,
    /// Components held on rows that are otherwise free.
    pub(super) held_components: Option<Arc<Vec<[bool; 3]>>>,
    /// Nodes that are moved: components and displacement, m.
    pub(super) prescribed: Vec<(u32, [bool; 3], [f64; 3])>,
    /// All loads together in solver numbering, N.
    pub(super) load_n: Vec<[f64; 3]>,
    /// Each load on its own in solver numbering, N.
    pub(super) load_parts: Vec<NodalForces>,
    /// Undeformed nodes in solver numbering, m.
    pub(super) nodes_m: Vec<[f64; 3]>,
    /// Material names in the order the elements count them.
    names: Vec<String>,
    /// Solver number of every node of the mesh (mid-edge nodes behind them).
    number: Vec<u32>,
    corners: usize,
    /// Ends of the mid-edge nodes, in mesh numbering.
    edges: Vec<[u32; 2]>,
    warnings: Vec<String>,
    /// Elimination order of the direct solver, found when first needed.
    symbolic: OnceLock<Option<Arc<Symbolic>>>,
}

/// Elements of one kind.
pub(super) enum Body {
    Tet4(Elements<4, 1>),
    Tet4Nodal(Elements<4, 1>, Box<NodalGradient>),
    Tet10(Elements<10, 4>),
}

/// Materials made ready for the elements of a model.
pub(super) struct Laws {
    kernels: Vec<Kernel>,
    /// What the nodes evaluate, for elements with averaged deformation.
    nodal: Vec<Box<dyn Hyperelastic>>,
}

impl Body {
    pub(super) fn energy(&self, u: &[[f64; 3]], laws: &Laws) -> f64 {
        match self {
            Self::Tet4(elements) => elements.energy(u, &laws.kernels),
            Self::Tet10(elements) => elements.energy(u, &laws.kernels),
            Self::Tet4Nodal(elements, nodal) => elements.energy(u, &laws.kernels) + nodal.energy(u, &laws.nodal),
        }
    }

    /// Internal forces of all nodes and, when a matrix is given, the stiffness of the free ones.
    pub(super) fn assemble(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        partition: &Partition,
        forces: &mut [[f64; 3]],
        matrix: Option<&mut BlockMatrix>,
        project: bool,
    ) {
        let at = At { u, kernels: &laws.kernels, more_stress_pa: None, project };
        match self {
            Self::Tet4(elements) => elements.assemble(at, partition, forces, matrix),
            Self::Tet10(elements) => elements.assemble(at, partition, forces, matrix),
            Self::Tet4Nodal(elements, nodal) => {
                let stresses = nodal.stresses(u, &laws.nodal);
                elements.assemble(At { more_stress_pa: Some(&stresses), ..at }, partition, forces, matrix);
            }
        }
    }

    /// The part of the tangent that is not in the matrix.
    fn nodal_tangent(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        held: Option<Arc<Vec<[bool; 3]>>>,
        project: bool,
    ) -> Option<NodalTangent> {
        match self {
            Self::Tet4Nodal(_, nodal) => Some(nodal.tangent(u, &laws.nodal, held, project)),
            _ => None,
        }
    }

    /// Per cell of the mesh: mean and least volume ratio, mean energy density.
    pub(super) fn state(&self, u: &[[f64; 3]], laws: &Laws) -> Vec<[f64; 3]> {
        let (cells, state) = match self {
            Self::Tet4(elements) | Self::Tet4Nodal(elements, _) => (&elements.cell, elements.state(u, &laws.kernels)),
            Self::Tet10(elements) => (&elements.cell, elements.state(u, &laws.kernels)),
        };
        let mut by_cell = vec![[0.0; 3]; state.len()];
        for (cell, state) in cells.iter().zip(state) {
            by_cell[*cell as usize] = state;
        }
        by_cell
    }
}

/// The node set of a name.
fn node_set<'a>(mesh: &'a TetMesh, set: &str) -> Result<&'a [u32], FemError> {
    let nodes = mesh.node_sets.get(set).ok_or_else(|| FemError::unknown_set(mesh, set))?;
    if nodes.is_empty() { Err(FemError::EmptySet { set: set.to_owned() }) } else { Ok(nodes) }
}

/// Which material every tetrahedron has; checks names both ways.
fn materials_of_cells(mesh: &TetMesh, scenario: &Scenario) -> Result<(Vec<u16>, Vec<String>), FemError> {
    for (first, number) in &scenario.labels {
        let same = scenario.labels.iter().find(|(other, n)| *other > first && *n == number);
        if let Some((second, _)) = same {
            let (first, second) = (first.clone(), second.clone());
            return Err(FemError::SameLabel { first, second, number: *number });
        }
    }
    let names: Vec<String> = scenario.materials.keys().cloned().collect();
    for name in &names {
        if scenario.label_number(name).is_none() {
            return Err(FemError::UnknownLabel { name: name.clone() });
        }
    }
    let mut index_of_label = [None; 256];
    let mut materials = Vec::with_capacity(mesh.tets().len());
    for (cell, &label) in mesh.labels().iter().enumerate() {
        let index = if let Some(index) = index_of_label[usize::from(label)] {
            index
        } else {
            let name = scenario.label_name(label).ok_or(FemError::UnnamedLabel { cell, label })?;
            let index = names.iter().position(|n| n == name);
            let index = index.ok_or_else(|| FemError::NoMaterial { cell, label, name: name.to_owned() })? as u16;
            index_of_label[usize::from(label)] = Some(index);
            index
        };
        materials.push(index);
    }
    Ok((materials, names))
}

fn check_settings(scenario: &Scenario) -> Result<(), FemError> {
    let refuse = |key: &str, value: f64, rule| Err(FemError::Setting { key: key.to_owned(), value, rule });
    let loads = &scenario.loads;
    let mut numbers: Vec<(String, f64)> = vec![("loads.density_kg_per_m3".into(), loads.density_kg_per_m3)];
    numbers.extend(loads.gravity_m_per_s2.iter().map(|&v| ("loads.gravity_m_per_s2".into(), v)));
    for patch in &loads.patch {
        numbers.extend(patch.force_n.iter().map(|&v| (format!("force_n of patch `{}`", patch.set), v)));
    }
    for p in &loads.pressure {
        numbers.push((format!("pressure_pa of set `{}`", p.set), p.pressure_pa));
    }
    for p in &scenario.prescribed {
        numbers.extend(p.displacement_mm.iter().map(|&v| (format!("displacement_mm of set `{}`", p.set), v)));
    }
    if let Some(csf) = loads.csf {
        numbers.push(("loads.csf.density_kg_per_m3".into(), csf.density_kg_per_m3));
        numbers.push(("loads.csf.level_mm".into(), csf.level_mm));
    }
    if let Some((key, value)) = numbers.into_iter().find(|(_, v)| !v.is_finite()) {
        return refuse(&key, value, "a finite number");
    }
    if loads.density_kg_per_m3 <= 0.0 {
        return refuse("loads.density_kg_per_m3", loads.density_kg_per_m3, "positive");
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

impl Model {
    /// Finds numbering, pattern, held nodes and loads; checks every name and number of the scenario.
    ///
    /// # Errors
    /// [`FemError`] names the set, label, key or cell that is wrong.
    pub fn new(mesh: &TetMesh, scenario: &Scenario) -> Result<Self, FemError> {
        check_settings(scenario)?;
        check_materials(&scenario.materials)?;
        let (material_of_cell, names) = materials_of_cells(mesh, scenario)?;
        let corners = mesh.nodes_mm().len();
        let quadratic =
            (scenario.solver.element == ElementKind::Tet10).then(|| with_mid_edge_nodes(corners, mesh.tets()));
        let edges: &[[u32; 2]] = quadratic.as_ref().map_or(&[], |(_, edges)| edges);
        let nodes = corners + edges.len();

        // Held and moved components, in mesh numbering; a mid-edge node follows its two ends.
        let mut held = vec![[false; 3]; nodes];
        let mut moved = vec![[0.0; 3]; nodes];
        let mut hold = |set: &str, components: [bool; 3], to_m: [f64; 3]| -> Result<(), FemError> {
            let members = node_set(mesh, set)?;
            let inside = |n: u32| members.binary_search(&n).is_ok();
            let middle = edges.iter().enumerate().filter(|(_, e)| inside(e[0]) && inside(e[1]));
            for n in members.iter().map(|&n| n as usize).chain(middle.map(|(k, _)| corners + k)) {
                for i in (0..3).filter(|&i| components[i]) {
                    held[n][i] = true;
                    moved[n][i] = to_m[i];
                }
            }
            Ok(())
        };
        for p in &scenario.prescribed {
            hold(&p.set, p.components, metres(p.displacement_mm))?;
        }
        for set in &scenario.fixed {
            hold(set, [true; 3], [0.0; 3])?;
        }
        // A body in motion has its mass to hold on to.
        let moving = scenario.solver.method == Method::BackwardEuler;

        let lumped = moving && scenario.dynamics.mass == MassKind::Lumped;
        let ends = quadratic.as_ref().map(|(tets, edges)| (&tets[..], &edges[..]));
        let sharing = Sharing { mesh, quadratic: ends, lumped };
        let loads = nodal_forces_n(&sharing, &scenario.loads)?;

        let any_held = held.iter().any(|h| *h != [false; 3]);
        let graph = match &quadratic {
            Some((tets, _)) => Graph::of_elements(nodes, tets),
            None => Graph::of_elements(nodes, mesh.tets()),
        };
        if !moving && !any_held {
            return Err(FemError::NothingHeld);
        }
        if !moving {
            check_held_together(&graph, &held)?;
        }
        // A node of no element has nothing to answer to.
        (0..nodes).filter(|&n| graph.of(n).is_empty()).for_each(|n| held[n] = [true; 3]);
        let order = reverse_cuthill_mckee(&graph);
        let mut number = vec![0u32; nodes];
        order.iter().enumerate().for_each(|(new, &old)| number[old as usize] = new as u32);
        let mut row_of = vec![HELD; nodes];
        let mut node_of_row = Vec::new();
        for (new, &old) in order.iter().enumerate() {
            if held[old as usize] != [true; 3] {
                row_of[new] = node_of_row.len() as u32;
                node_of_row.push(new as u32);
            }
        }
        if node_of_row.is_empty() {
            return Err(FemError::AllHeld);
        }
        let held_components = {
            let of_rows: Vec<[bool; 3]> = node_of_row.iter().map(|&n| held[order[n as usize] as usize]).collect();
            of_rows.iter().any(|h| *h != [false; 3]).then(|| Arc::new(of_rows))
        };
        let prescribed = order
            .iter()
            .enumerate()
            .filter(|(_, old)| moved[**old as usize] != [0.0; 3])
            .map(|(new, &old)| (new as u32, held[old as usize], moved[old as usize]))
            .collect();
        let position = |old: u32| {
            let x = mesh.nodes_mm();
            if (old as usize) < corners {
                metres(x[old as usize])
            } else {
                let [a, b] = edges[old as usize - corners].map(|n| metres(x[n as usize]));
                [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]))
            }
        };
        let nodes_m: Vec<[f64; 3]> = order.iter().map(|&old| position(old)).collect();
        let mut load_n = vec![[0.0; 3]; nodes];
        let load_parts: Vec<NodalForces> = loads
            .into_iter()
            .map(|(load, forces)| (load, order.iter().map(|&old| forces[old as usize]).collect()))
            .collect();
        for (_, forces) in &load_parts {
            for (sum, force) in load_n.iter_mut().zip(forces) {
                (0..3).for_each(|i| sum[i] += force[i]);
            }
        }
        let pattern = Arc::new(BlockPattern::new(&renumbered(&graph, &order, &number), &row_of));

        let body = if let Some((tets, _)) = &quadratic {
            let (tets, materials, cells) = sorted(tets, &number, &material_of_cell);
            let points = tet10(&nodes_m, &tets);
            Body::Tet10(Elements::new(tets, points, materials, cells, &row_of, &pattern))
        } else {
            let (tets, materials, cells) = sorted(mesh.tets(), &number, &material_of_cell);
            let points = tet4(&nodes_m, &tets);
            let elements = Elements::new(tets, points, materials, cells, &row_of, &pattern);
            if scenario.solver.element == ElementKind::Tet4Nodal {
                let nodal = Box::new(NodalGradient::new(&elements, &row_of));
                Body::Tet4Nodal(elements, nodal)
            } else {
                Body::Tet4(elements)
            }
        };
        let partition = match &body {
            Body::Tet4(e) | Body::Tet4Nodal(e, _) => e.partition(&row_of, &pattern),
            Body::Tet10(e) => e.partition(&row_of, &pattern),
        };
        let mut warnings = Vec::new();
        if scenario.solver.element == ElementKind::Tet4 {
            let stiffest = scenario.materials.values().map(Material::poisson_ratio).fold(0.0, f64::max);
            if stiffest > 0.47 {
                warnings.push(format!(
                    "tet4 locks at Poisson's ratio {stiffest}: displacements come out too small; \
                     `element = \"tet4-nodal\"` does not"
                ));
            }
        }
        Ok(Self {
            scenario: scenario.clone(),
            body,
            pattern,
            partition,
            row_of,
            node_of_row,
            held_components,
            prescribed,
            load_n,
            load_parts,
            edges: edges.to_vec(),
            nodes_m,
            names,
            number,
            corners,
            warnings,
            symbolic: OnceLock::new(),
        })
    }

    /// Number of free nodes (three unknowns each).
    pub fn free_nodes(&self) -> usize {
        self.node_of_row.len()
    }

    /// Where the nodes of the rows lie, m.
    pub(super) fn positions_of_rows(&self) -> Vec<[f64; 3]> {
        self.node_of_row.iter().map(|&n| self.nodes_m[n as usize]).collect()
    }

    /// Elimination order of the direct solver; `None` when there is not enough memory.
    pub(super) fn symbolic(&self) -> Option<Arc<Symbolic>> {
        let new = || {
            let rings = match &self.body {
                Body::Tet4Nodal(_, nodal) => Some(nodal.rings()),
                _ => None,
            };
            Symbolic::new(&self.pattern, rings, &self.positions_of_rows()).map(Arc::new)
        };
        self.symbolic.get_or_init(new).clone()
    }

    /// A displacement of the mesh's nodes (mm) as a state to start from.
    ///
    /// # Errors
    /// [`FemError::StartLength`] and [`FemError::StartNotFinite`].
    pub fn state(&self, displacement_mm: &[[f64; 3]]) -> Result<State, FemError> {
        let (found, nodes) = (displacement_mm.len(), self.corners);
        if found != nodes {
            return Err(FemError::StartLength { found, nodes });
        }
        if let Some(node) = displacement_mm.iter().position(|u| u.iter().any(|v| !v.is_finite())) {
            return Err(FemError::StartNotFinite { node });
        }
        let mut u = vec![[0.0; 3]; self.nodes_m.len()];
        for (mm, &new) in displacement_mm.iter().zip(&self.number) {
            u[new as usize] = metres(*mm);
        }
        for (&[a, b], &new) in self.edges.iter().zip(&self.number[self.corners..]) {
            let [a, b] = [a, b].map(|n| metres(displacement_mm[n as usize]));
            u[new as usize] = [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]));
        }
        Ok(State { u })
    }

    pub(super) fn laws(&self, materials: &Materials) -> Result<Laws, FemError> {
        check_materials(materials)?;
        self.unchecked_laws(materials)
    }

    /// Laws of materials that may break the rules for files, as steps of differences do.
    pub(super) fn unchecked_laws(&self, materials: &Materials) -> Result<Laws, FemError> {
        let missing = |name: &String| {
            let label = self.scenario.label_number(name).unwrap_or(0);
            FemError::NoMaterial { cell: 0, label, name: name.clone() }
        };
        let materials: Vec<Material> = self
            .names
            .iter()
            .map(|name| materials.get(name).cloned().ok_or_else(|| missing(name)))
            .collect::<Result<_, _>>()?;
        let part = |m: &Material, part: f64| m.scaled(Parameter::Stiffness, part).unwrap_or_else(|| m.clone());
        Ok(match self.body {
            Body::Tet4Nodal(..) => Laws {
                kernels: materials.iter().map(|m| Kernel::new(&part(m, 1.0 - NODAL_SHARE), 0.0)).collect(),
                nodal: materials.iter().map(|m| part(m, NODAL_SHARE).law_with_lambda(m.lame_lambda_pa())).collect(),
            },
            _ => Laws {
                kernels: materials.iter().map(|m| Kernel::new(m, m.lame_lambda_pa())).collect(),
                nodal: Vec::new(),
            },
        })
    }

    /// Tangent at u; also fills the internal forces of all nodes.
    pub(super) fn tangent(&self, u: &[[f64; 3]], laws: &Laws, forces: &mut [[f64; 3]], project: bool) -> Tangent {
        let mut matrix = BlockMatrix::zero(Arc::clone(&self.pattern));
        self.body.assemble(u, laws, &self.partition, forces, Some(&mut matrix), project);
        if let Some(held) = &self.held_components {
            matrix.hold_components(held);
        }
        Tangent { matrix, nodal: self.body.nodal_tangent(u, laws, self.held_components.clone(), project) }
    }

    /// Entries of the free rows; held components are zero.
    pub(super) fn free_part(&self, of_nodes: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut rows: Vec<[f64; 3]> = self.node_of_row.iter().map(|&n| of_nodes[n as usize]).collect();
        self.clear_held(&mut rows);
        rows
    }

    /// Held components of free rows become zero.
    pub(super) fn clear_held(&self, rows: &mut [[f64; 3]]) {
        if let Some(held) = &self.held_components {
            for (row, held) in rows.iter_mut().zip(&**held) {
                (0..3).filter(|&i| held[i]).for_each(|i| row[i] = 0.0);
            }
        }
    }

    /// Nodes of the mesh in mm from solver nodes in m.
    pub(super) fn to_mesh_mm(&self, u: &[[f64; 3]]) -> Vec<[f64; 3]> {
        (0..self.corners).map(|n| millimetres(u[self.number[n] as usize])).collect()
    }

    /// Vectors on the mesh's nodes in solver numbering; mid-edge nodes get zero.
    pub(super) fn solver_numbering(&self, of_nodes: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut all = vec![[0.0; 3]; self.nodes_m.len()];
        of_nodes.iter().zip(&self.number).for_each(|(v, &new)| all[new as usize] = *v);
        all
    }

    /// The answer at a state: u in m, internal forces in N.
    pub(super) fn outcome(
        &self,
        u: &[[f64; 3]],
        forces: &[[f64; 3]],
        laws: &Laws,
        convergence: super::ConvergenceRecord,
    ) -> Outcome {
        let state = self.body.state(u, laws);
        let reaction = |n: usize| {
            let new = self.number[n] as usize;
            let row = self.row_of[new];
            let held = if row == HELD {
                [true; 3]
            } else {
                self.held_components.as_ref().map_or([false; 3], |h| h[row as usize])
            };
            [0, 1, 2].map(|i| if held[i] { forces[new][i] - self.load_n[new][i] } else { 0.0 })
        };
        let mut density: Vec<f64> = state.iter().map(|s| s[2]).collect();
        if let Body::Tet4Nodal(elements, nodal) = &self.body {
            let averaged = nodal.energy_density(u, &laws.nodal);
            elements.cell.iter().zip(averaged).for_each(|(&cell, extra)| density[cell as usize] += extra);
        }

        let worst_cell = worst(&state);
        let convergence =
            super::ConvergenceRecord { worst_cell, worst_volume_ratio: state[worst_cell][1], ..convergence };
        let mut warnings = self.warnings.clone();
        let inverted = state.iter().filter(|s| s[1] <= 0.0).count();
        if inverted > 0 {
            warnings.push(format!(
                "{inverted} cells are inside out, among them cell {worst_cell}: lower the load or raise the modulus"
            ));
        }
        let crushed = state.iter().filter(|s| (0.0..0.1).contains(&s[1])).count();
        if crushed > 0 {
            warnings
                .push(format!("{crushed} cells are squeezed below a tenth of their volume: treat stresses with care"));
        }
        Outcome {
            displacement_mm: self.to_mesh_mm(u),
            reaction_n: (0..self.corners).map(reaction).collect(),
            jacobian: state.iter().map(|s| s[0]).collect(),
            strain_energy_density_pa: density,
            convergence,
            motion: None,
            warnings,
        }
    }
}

/// The cell with the smallest volume ratio.
pub(super) fn worst(state: &[[f64; 3]]) -> usize {
    (0..state.len()).min_by(|&a, &b| state[a][1].total_cmp(&state[b][1])).unwrap_or(0)
}

/// Every material obeys its rules.
fn check_materials(materials: &Materials) -> Result<(), FemError> {
    for (name, material) in materials {
        material.check().map_err(|source| FemError::Material { name: name.clone(), source })?;
    }
    Ok(())
}

/// A graph in new numbers.
fn renumbered(graph: &Graph, order: &[u32], number: &[u32]) -> Graph {
    let (mut start, mut neighbours) = (vec![0], Vec::with_capacity(graph.neighbours.len()));
    for &old in order {
        neighbours.extend(graph.of(old as usize).iter().map(|&m| number[m as usize]));
        start.push(neighbours.len());
    }
    Graph { start, neighbours }
}

/// Every piece of the body needs a held node, or it would drift.
fn check_held_together(graph: &Graph, held: &[[bool; 3]]) -> Result<(), FemError> {
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

/// Elements in solver numbers, ordered by their first node so that neighbours in the list share memory.
fn sorted<const K: usize>(
    tets: &[[u32; K]],
    number: &[u32],
    material_of_cell: &[u16],
) -> (Vec<[u32; K]>, Vec<u16>, Vec<u32>) {
    let renumbered = |cell: u32| tets[cell as usize].map(|n| number[n as usize]);
    let mut cells: Vec<u32> = (0..tets.len() as u32).collect();
    cells.sort_by_cached_key(|&cell| (renumbered(cell).iter().copied().min(), cell));
    let nodes = cells.iter().map(|&cell| renumbered(cell)).collect();
    let materials = cells.iter().map(|&cell| material_of_cell[cell as usize]).collect();
    (nodes, materials, cells)
}

//! A mesh made ready for many solves: numbering, pattern, held nodes and loads are found once, materials come with
//! every solve.

use super::buoyancy::Buoyancy;
use super::check::{check_held_together, check_materials, check_settings, floating, node_set, stays_held};
use super::contact::{Numbering, Supports, tethered_nodes};
use super::element::{Body, Laws, Numbered, Partition, with_mid_edge_nodes};
use super::hinge::{Hinged, hinged};
use super::linear::{Symbolic, Tangent};
use super::load::{Load, NodalForces, nodal_forces_n};
use super::mixture::portions;
use super::order::{Graph, renumbered, reverse_cuthill_mckee};
use super::scenario::{MassKind, Materials, Method, Scenario};
use super::sharing::Sharing;
use super::sparse::{BlockMatrix, BlockPattern, HELD};
use super::units::{METRES_PER_MM, metres, millimetres};
use super::{FemError, FemWarning, Idle, State};
use crate::material::law::Material;
use crate::mesh::TetMesh;
use std::sync::{Arc, OnceLock};

/// A mesh with held nodes and loads, ready to be solved with any materials.
pub struct Model {
    pub(super) scenario: Scenario,
    pub(super) body: Box<dyn Body>,
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
    /// What a fluid carries, in solver numbering; part of the weight above.
    pub(super) buoyancy: Option<Buoyancy>,
    /// Walls and springs.
    pub(super) supports: Supports,
    /// Undeformed nodes in solver numbering, m.
    pub(super) nodes_m: Vec<[f64; 3]>,
    /// Material names in the order the elements count them.
    pub(super) names: Vec<String>,
    /// Solver number of every node of the mesh (mid-edge nodes behind them).
    pub(super) number: Vec<u32>,
    pub(super) corners: usize,
    /// Ends of the mid-edge nodes, in mesh numbering.
    pub(super) edges: Vec<[u32; 2]>,
    pub(super) warnings: Vec<FemWarning>,
    /// Elimination order of the direct solver, found when first needed.
    symbolic: OnceLock<Option<Arc<Symbolic>>>,
}

/// What of a tangent is made positive semi-definite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Projected {
    /// Nothing: the derivative of the forces as it is.
    Nothing,
    /// What walls add by their curvature. Far from equilibrium nodes are pressed through walls by pressures that are none;
    /// those times a wall's curvature would make a tangent indefinite that is not so at the solution.
    Walls,
    /// Every element and every wall.
    All,
}

impl Model {
    /// Finds numbering, pattern, held nodes and loads; checks every name and number of the scenario.
    ///
    /// # Errors
    /// [`FemError`] names the set, label, key or cell that is wrong.
    pub fn new(mesh: &TetMesh, scenario: &Scenario) -> Result<Self, FemError> {
        check_settings(scenario)?;
        check_materials(&scenario.materials)?;
        let body = scenario.body(mesh)?;
        let mesh = &*body;
        let (portions, names) = portions(mesh, scenario)?;
        let corners = mesh.nodes_mm().len();
        let element = scenario.solver.element.element();
        let quadratic = element.has_mid_edge_nodes().then(|| with_mid_edge_nodes(corners, mesh.tets()));
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
        for set in scenario.held() {
            hold(set, [true; 3], [0.0; 3])?;
        }
        // A body in motion has its mass to hold on to.
        let moving = scenario.solver.method == Method::BackwardEuler;

        let lumped = moving && scenario.dynamics.mass == MassKind::Lumped;
        let ends = quadratic.as_ref().map(|(tets, edges)| (&tets[..], &edges[..]));
        let sharing = Sharing { mesh, quadratic: ends, lumped };
        let buoyancy = Buoyancy::new(&sharing, &scenario.loads);
        let loads = nodal_forces_n(&sharing, &scenario.loads, buoyancy.as_ref())?;

        // What springs hold is held as well, as far as drifting away goes.
        let mut leaning = held.clone();
        tethered_nodes(&sharing, scenario)?.into_iter().for_each(|n| leaning[n as usize] = [true; 3]);
        let any_held = leaning.iter().any(|h| *h != [false; 3]);
        let graph = match &quadratic {
            Some((tets, _)) => Graph::of_elements(nodes, tets),
            None => Graph::of_elements(nodes, mesh.tets()),
        };
        if !moving && !any_held {
            return Err(FemError::NothingHeld);
        }
        if !moving {
            check_held_together(&graph, &leaning)?;
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
        let numbering = Numbering { number: &number, row_of: &row_of, nodes_m: &nodes_m };
        let supports = Supports::new(&sharing, scenario, &numbering)?;
        let at = |n: u32| nodes_m[number[n as usize] as usize];
        let hinged = if moving { Vec::new() } else { hinged(&sharing, &leaning, at) };
        // A wall may stop what turns.
        let stopped = |piece: &Hinged| piece.nodes.iter().any(|&n| supports.stands_before_a_wall(number[n as usize]));
        if let Some(piece) = hinged.iter().find(|piece| !stopped(piece)) {
            return Err(FemError::Hinged { cells: piece.cells, cell: piece.cell });
        }
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
        // Walls may catch what springs let go.
        let any_held = (0..nodes).any(|n| held[n] != [false; 3] && !graph.of(n).is_empty());
        if !moving && !supports.has_walls() && !any_held {
            check_springs(&supports, &load_n, &nodes_m)?;
        }
        let buoyancy = buoyancy.map(|b| b.ordered(&order));
        let pattern = Arc::new(BlockPattern::new(&renumbered(&graph, &order, &number), &row_of));

        let body = element.body(&Numbered {
            number: &number,
            nodes_m: &nodes_m,
            portions: &portions,
            tets: mesh.tets(),
            with_mid_edge_nodes: quadratic.as_ref().map_or(&[], |(tets, _)| tets),
            row_of: &row_of,
            pattern: &pattern,
        });
        let partition = body.partition(&row_of, &pattern);
        let mut warnings = unstable_laws(&scenario.materials);
        warnings.extend(tiny(&nodes_m));
        warnings.extend(floating(scenario));
        warnings.extend(stays_held(mesh, scenario)?);
        warnings.extend(hinged.iter().map(|piece| FemWarning::Hinged { cells: piece.cells, cell: piece.cell }));
        warnings.extend(supports.idle.iter().cloned());
        warnings.extend(idle_loads(&load_parts, &row_of, scenario));
        if let Some(limit) = element.locks_above() {
            let poisson_ratio = scenario.materials.values().map(Material::poisson_ratio).fold(0.0, f64::max);
            if poisson_ratio > limit {
                warnings.push(FemWarning::Locks { element: scenario.solver.element, poisson_ratio });
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
            supports,
            buoyancy,
            edges: edges.to_vec(),
            nodes_m,
            names,
            number,
            corners,
            warnings,
            symbolic: OnceLock::new(),
        })
    }

    /// Moves the wall of this number (as [`crate::fem::By::Gap`] counts them) to another gap from the body, mm; planes count
    /// it from where they stand. Nothing happens where there is no such wall.
    pub fn set_gap(&mut self, wall: usize, gap_mm: f64) {
        self.supports.set_gap(wall, gap_mm);
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
        let new = || Symbolic::new(&self.pattern, self.body.rings(), &self.positions_of_rows()).map(Arc::new);
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
        let measured = materials.iter().map(|material| material.measured().map(|(window, _)| window)).collect();
        Ok(Laws { measured, ..self.body.laws(&materials) })
    }

    /// Stored energy of body, walls and springs, J.
    pub(super) fn energy(&self, u: &[[f64; 3]], laws: &Laws) -> f64 {
        self.body.energy(u, laws) + self.supports.energy(u, &self.nodes_m, laws.walls_softer)
    }

    /// Its derivative by the displacement of all nodes, N.
    pub(super) fn internal_forces(&self, u: &[[f64; 3]], laws: &Laws, forces: &mut [[f64; 3]]) {
        self.body.assemble(u, laws, &self.partition, forces, None, false);
        self.supports.add_forces(u, &self.nodes_m, laws.walls_softer, forces);
    }

    /// Tangent at u, in the memory of a spare one; also fills the internal forces of all nodes.
    pub(super) fn tangent(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        forces: &mut [[f64; 3]],
        projected: Projected,
        spare: Option<Tangent>,
    ) -> Tangent {
        let mut tangent = self.tangent_of_body(u, laws, forces, projected == Projected::All, spare);
        self.supports.add_forces(u, &self.nodes_m, laws.walls_softer, forces);
        self.add_stiffness_of_supports(u, laws.walls_softer, projected != Projected::Nothing, &mut tangent);
        tangent
    }

    /// Adds what walls and springs are to a tangent of the body.
    pub(super) fn add_stiffness_of_supports(&self, u: &[[f64; 3]], softer: f64, project: bool, tangent: &mut Tangent) {
        let held = self.held_components.as_ref().map(|held| held.as_slice());
        self.supports.add_stiffness(u, &self.nodes_m, softer, held, project, tangent);
    }

    /// Tangent and internal forces of the body without walls and springs.
    pub(super) fn tangent_of_body(
        &self,
        u: &[[f64; 3]],
        laws: &Laws,
        forces: &mut [[f64; 3]],
        project: bool,
        spare: Option<Tangent>,
    ) -> Tangent {
        let mut matrix = spare.map_or_else(|| BlockMatrix::zero(Arc::clone(&self.pattern)), |spare| spare.matrix);
        self.body.assemble(u, laws, &self.partition, forces, Some(&mut matrix), project);
        if let Some(held) = &self.held_components {
            matrix.hold_components(held);
        }
        let nodal = self.body.nodal_tangent(u, laws, self.held_components.clone(), project);
        Tangent { matrix, nodal, walls: Vec::new() }
    }

    /// Entries of the free rows; held components are zero.
    pub(super) fn free_part(&self, of_nodes: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut rows: Vec<[f64; 3]> = self.node_of_row.iter().map(|&n| of_nodes[n as usize]).collect();
        self.clear_held(&mut rows);
        rows
    }

    /// Which components of a row, or of [`HELD`], are held.
    pub(super) fn held_of_row(&self, row: u32) -> [bool; 3] {
        if row == HELD {
            return [true; 3];
        }
        self.held_components.as_ref().map_or([false; 3], |held| held[row as usize])
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
}

/// Diagonal of the box around the body, mm.
fn size_mm(nodes_m: &[[f64; 3]]) -> f64 {
    let reach = |axis: usize| {
        let of = || nodes_m.iter().map(|x| x[axis]);
        of().fold(f64::NEG_INFINITY, f64::max) - of().fold(f64::INFINITY, f64::min)
    };
    (0..3).map(|axis| reach(axis).powi(2)).sum::<f64>().sqrt() / METRES_PER_MM
}

/// A body smaller than any piece of brain that is measured: its mesh was in metres.
fn tiny(nodes_m: &[[f64; 3]]) -> Option<FemWarning> {
    const LEAST_MM: f64 = 1.0;
    Some(size_mm(nodes_m)).filter(|size_mm| *size_mm < LEAST_MM).map(|size_mm| FemWarning::Tiny { size_mm })
}

/// Springs that are all there is to hold the body must hold it somewhere near.
fn check_springs(supports: &Supports, load_n: &[[f64; 3]], nodes_m: &[[f64; 3]]) -> Result<(), FemError> {
    let size_mm = size_mm(nodes_m);
    match supports.give_mm(load_n) {
        Some(give_mm) if give_mm > size_mm => Err(FemError::WeakSprings { give_mm, size_mm }),
        _ => Ok(()),
    }
}

/// Forces and pressures that act on held nodes alone.
fn idle_loads(parts: &[NodalForces], row_of: &[u32], scenario: &Scenario) -> Vec<FemWarning> {
    let idle = |forces: &[[f64; 3]]| {
        let mut pushed = forces.iter().zip(row_of).filter(|(force, _)| **force != [0.0; 3]).peekable();
        pushed.peek().is_some() && pushed.all(|(_, row)| *row == HELD)
    };
    let named = |load: &Load| match load {
        Load::Weight => None,
        Load::Patch(n) => Some((scenario.loads.patch[*n].set.clone(), Idle::Patch)),
        Load::Pressure(n) => Some((scenario.loads.pressure[*n].set.clone(), Idle::Pressure)),
    };
    let without = parts.iter().filter(|(_, forces)| idle(forces)).filter_map(|(load, _)| named(load));
    without.map(|(set, idle)| FemWarning::NoEffect { set, idle }).collect()
}

/// Every law that is unstable where it was measured.
fn unstable_laws(materials: &Materials) -> Vec<FemWarning> {
    let mut warnings = Vec::new();
    for (name, material) in materials {
        let Some(([low, high], stability)) = material.measured() else { continue };
        let broken: Vec<String> = stability.broken().into_iter().map(str::to_owned).collect();
        if !broken.is_empty() {
            warnings.push(FemWarning::Unstable { material: name.clone(), low, high, broken });
        }
    }
    warnings
}

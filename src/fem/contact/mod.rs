//! Walls that push without friction, and springs: what a body leans on besides the nodes that are held.
//!
//! Every node of a surface before a wall stands for the area around it, and stores A phi(g) where g is the gap between the
//! node and the wall and phi a smooth potential. Its force A phi'(g) grad g points along the wall's normal, so nothing
//! holds back what slides; its stiffness A (phi'' grad g (x) grad g + phi' hess g) is one block of the diagonal. Both are
//! continuous, so that Newton's method, its line search, the time steps and the sensitivities treat a wall like any
//! elastic part of the body. On flat facets under even pressure the lumped forces are the consistent ones.

mod potential;
mod settings;
mod sheet;

pub use settings::{Contact, Support, Tether, Wall};
pub(super) use sheet::all_contacts;

use super::linear::Tangent;
use super::load::{area_m2, facets_of};
use super::scenario::Scenario;
use super::sharing::Sharing;
use super::sparse::HELD;
use super::units::{METRES_PER_MM, metres, millimetres};
use super::warning::Idle;
use super::{FemError, FemWarning};
use crate::geometry::SmoothField;
use nalgebra::{Matrix3, Vector3};
use potential::Potential;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a surface does at its wall.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactOutcome {
    /// The set that stands before the wall.
    pub set: String,
    /// Area of the nodes that are pressed, mm2.
    pub area_mm2: f64,
    /// Force of the wall on the body, N.
    pub force_n: [f64; 3],
    /// How deep the deepest node is beyond the wall, mm.
    pub depth_mm: f64,
}

/// What the springs of one `[[tethers]]` entry do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TetherOutcome {
    /// The set that they hold.
    pub set: String,
    /// Force of the springs on the body, N.
    pub force_n: [f64; 3],
    /// How far the longest or shortest of them is from its length at rest, mm.
    pub stretch_mm: f64,
}

/// What a node stands before.
#[derive(Clone, Copy, Debug)]
enum Before {
    /// A plane with this normal towards the free side.
    Plane(Vector3<f64>),
    /// The field of the wall.
    Field,
}

/// One node before one wall.
#[derive(Clone, Copy, Debug)]
struct Standing {
    /// Solver numbering.
    node: u32,
    row: u32,
    wall: u32,
    before: Before,
    area_m2: f64,
    /// What the gap is more than the field, or than the way along the normal, m; the wall's own gap not counted.
    own_m: f64,
    /// The field where the node is at rest, m: with it the body at rest keeps half of the soft layer, whatever the wall's gap.
    /// `None` before a plane, which stands where it stands.
    at_rest_m: Option<f64>,
    /// How much nearer to the wall a step of 1 comes by the field at rest: where a smooth distance bends or two of them
    /// meet it rises by less than it should. Only for even walls, where the field says how the room changes and no more.
    field_slope: f64,
}

/// The least slope of a field that is taken at its word.
const LEAST_SLOPE: f64 = 0.3;

/// One node on a spring.
#[derive(Clone, Copy, Debug)]
struct Tethered {
    node: u32,
    row: u32,
    /// Place of its set among those that are tethered.
    set: u32,
    /// N/m.
    stiffness: f64,
    /// Only along this normal.
    along: Option<Vector3<f64>>,
}

impl Tethered {
    /// How far its end has moved away from where it holds nothing, m.
    fn stretch(&self, u: &[[f64; 3]]) -> Vector3<f64> {
        let moved = Vector3::from(u[self.node as usize]);
        self.along.map_or(moved, |n| n * moved.dot(&n))
    }
}

struct Barrier {
    set: String,
    potential: Potential,
    field: Option<Arc<SmoothField>>,
    /// Room between body and wall, m.
    gap_m: f64,
}

/// All walls and springs of a model.
pub(super) struct Supports {
    standing: Vec<Standing>,
    tethered: Vec<Tethered>,
    /// The sets of the springs, one for every entry of the scenario.
    tethered_sets: Vec<String>,
    walls: Vec<Barrier>,
    /// Walls and springs that nothing free is at.
    pub idle: Vec<FemWarning>,
}

/// Gap (m), its gradient, its second derivatives (1/m).
type Gap = (f64, Vector3<f64>, Matrix3<f64>);

/// Where supports find the nodes: positions in solver numbering, and numbers by the mesh's.
pub(super) struct Numbering<'a> {
    pub number: &'a [u32],
    pub row_of: &'a [u32],
    pub nodes_m: &'a [[f64; 3]],
}

impl Standing {
    /// What the gap is more than the field, or than the way along the normal, before a wall with a gap (m) of its own, and whether
    /// that follows the wall's gap: no node is nearer to the wall at rest than half the soft layer, where nothing is pressed.
    fn room_m(&self, wall: &Barrier) -> (f64, bool) {
        match self.at_rest_m {
            Some(at_rest_m) if self.own_m + at_rest_m + wall.gap_m <= wall.least_m() => {
                (wall.least_m() - at_rest_m, false)
            }
            _ => (self.own_m + wall.gap_m, true),
        }
    }
}

impl Barrier {
    /// The room that is left at rest in any case, m.
    fn least_m(&self) -> f64 {
        0.5 * self.potential.softness_m
    }
}

impl Supports {
    /// The scenario's walls and springs on its mesh (cut open, as [`Scenario::body`] leaves it).
    pub(super) fn new(sharing: &Sharing, scenario: &Scenario, at: &Numbering) -> Result<Self, FemError> {
        let tethered_sets = scenario.tethers.iter().map(|tether| tether.set.clone()).collect();
        let (standing, tethered, walls, idle) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut supports = Self { standing, tethered, tethered_sets, walls, idle };
        for contact in all_contacts(scenario) {
            supports.add_wall(sharing, &contact, at)?;
        }
        for (set, tether) in scenario.tethers.iter().enumerate() {
            let before = supports.tethered.len();
            for (node, area, normal) in surface_nodes(sharing, &tether.set)? {
                let node = at.number[node as usize];
                let stiffness = tether.stiffness_pa_per_mm / METRES_PER_MM * area;
                let along = tether.only_normal.then_some(normal);
                let row = at.row_of[node as usize];
                if row != HELD {
                    supports.tethered.push(Tethered { node, row, set: set as u32, stiffness, along });
                }
            }
            if supports.tethered.len() == before {
                supports.idle.push(FemWarning::NoEffect { set: tether.set.clone(), idle: Idle::Tether });
            }
        }
        Ok(supports)
    }

    fn add_wall(&mut self, sharing: &Sharing, contact: &Contact, at: &Numbering) -> Result<(), FemError> {
        let wall = self.walls.len() as u32;
        let potential = Potential {
            stiffness: contact.stiffness_pa_per_mm / METRES_PER_MM,
            softness_m: contact.softness_mm * METRES_PER_MM,
        };
        // A plane stands where it stands.
        let plane = matches!(contact.wall, Wall::Plane { .. });
        let gap = if plane { 0.0 } else { contact.gap_mm * METRES_PER_MM };
        let field = match &contact.wall {
            Wall::Field { name, distance_mm: None, .. } => {
                return Err(FemError::NoField { set: contact.set.clone(), name: name.clone() });
            }
            Wall::Field { distance_mm, .. } => distance_mm.clone(),
            _ => None,
        };
        if let Wall::Plane { point_mm, normal } = &contact.wall {
            check_plane(&contact.set, *point_mm, *normal, at)?;
        }
        let mut all_held = true;
        for (node, area_m2, normal) in surface_nodes(sharing, &contact.set)? {
            let node = at.number[node as usize];
            let row = at.row_of[node as usize];
            all_held &= row == HELD;
            // The two sides of a sheet meet at its edge, which stays free.
            let edge = matches!(contact.wall, Wall::OwnSurface | Wall::Sheet) && normal == Vector3::zeros();
            if row == HELD || edge {
                continue;
            }
            let x = at.nodes_m[node as usize];
            let mut field_slope = 1.0;
            let (before, own_m, at_rest_m) = match &contact.wall {
                Wall::Plane { point_mm, normal } => {
                    let n = Vector3::from(*normal).normalize();
                    let room = n.dot(&(Vector3::from(x) - Vector3::from(metres(*point_mm))));
                    (Before::Plane(n), room, None)
                }
                Wall::OwnSurface | Wall::Sheet => (Before::Plane(-normal), 0.0, Some(0.0)),
                Wall::Field { even, .. } => {
                    let at = field.as_ref().map(|f| f.at(millimetres(x))).unwrap_or_default();
                    if *even {
                        field_slope = Vector3::from(at.gradient).norm().clamp(LEAST_SLOPE, 1.0);
                    }
                    let seen = at.value * METRES_PER_MM / field_slope;
                    (Before::Field, if *even { -seen } else { 0.0 }, Some(seen))
                }
            };
            self.standing.push(Standing { node, row, wall, before, area_m2, own_m, at_rest_m, field_slope });
        }
        if all_held {
            self.idle.push(FemWarning::NoEffect { set: contact.set.clone(), idle: Idle::Contact });
        }
        self.walls.push(Barrier { set: contact.set.clone(), potential, field, gap_m: gap });
        Ok(())
    }

    /// Gives the wall of this number another gap, mm, as if it had been made with it.
    pub(super) fn set_gap(&mut self, wall: usize, gap_mm: f64) {
        if let Some(wall) = self.walls.get_mut(wall) {
            wall.gap_m = gap_mm * METRES_PER_MM;
        }
    }

    /// How far springs that are all there is to hold the body give way under a load (N), mm; `None` where there are none.
    pub(super) fn give_mm(&self, load_n: &[[f64; 3]]) -> Option<f64> {
        // Springs along normals hold a closed surface as well, by how much its shape says.
        let everywhere = self.tethered.iter().all(|t| t.along.is_none());
        let stiffness: f64 = self.tethered.iter().map(|t| t.stiffness).sum();
        let total = load_n.iter().fold(Vector3::zeros(), |sum, f| sum + Vector3::from(*f));
        (everywhere && stiffness > 0.0).then(|| total.norm() / stiffness / METRES_PER_MM)
    }

    /// Whether anything stands before a wall.
    pub(super) fn has_walls(&self) -> bool {
        !self.standing.is_empty()
    }

    /// Whether this node (solver numbering) stands before a wall.
    pub(super) fn stands_before_a_wall(&self, node: u32) -> bool {
        self.standing.iter().any(|s| s.node == node)
    }

    /// No walls and no springs.
    pub(super) fn is_empty(&self) -> bool {
        self.standing.is_empty() && self.tethered.is_empty()
    }

    fn gap(&self, s: &Standing, u: &[[f64; 3]], nodes_m: &[[f64; 3]]) -> Gap {
        let moved = Vector3::from(u[s.node as usize]);
        let wall = &self.walls[s.wall as usize];
        let (room_m, _) = s.room_m(wall);
        match s.before {
            Before::Plane(n) => (room_m + n.dot(&moved), n, Matrix3::zeros()),
            Before::Field => {
                let place = Vector3::from(nodes_m[s.node as usize]) + moved;
                let at = wall.field.as_ref().map(|f| f.at(millimetres(place.into())));
                let at = at.unwrap_or_default();
                let bend = Matrix3::from_fn(|r, c| at.hessian[r][c] / METRES_PER_MM / s.field_slope);
                let way = Vector3::from(at.gradient) / s.field_slope;
                (room_m + at.value * METRES_PER_MM / s.field_slope, way, bend)
            }
        }
    }

    /// `f` of every node before a wall, in order; one loop for every caller (see `reduce`).
    fn in_order<T: Send>(&self, f: &(dyn Fn(&Standing) -> T + Sync)) -> Vec<T> {
        self.standing.par_iter().with_min_len(256).map(f).collect()
    }

    /// `f` of every node before a wall, so many times softer than it is, with its gap, in order.
    fn each<T: Send>(
        &self,
        u: &[[f64; 3]],
        nodes_m: &[[f64; 3]],
        softer: f64,
        f: impl Fn(&Standing, &Potential, Gap) -> T + Sync,
    ) -> Vec<T> {
        self.in_order(&|s| f(s, &self.walls[s.wall as usize].potential.softer(softer), self.gap(s, u, nodes_m)))
    }

    /// Brings nodes that are through their wall's soft layer back to its middle, along the wall's normal. A state that was foretold
    /// has many, and the steps that mend them cost time (docs/evidence/prediction.md).
    pub(super) fn push_out(&self, u: &mut [[f64; 3]], nodes_m: &[[f64; 3]], held: Option<&[[bool; 3]]>) {
        let one = |s: &Standing| -> Option<Vector3<f64>> {
            let (gap, mut way, _) = self.gap(s, u, nodes_m);
            if gap >= -0.5 * self.walls[s.wall as usize].potential.softness_m {
                return None;
            }
            let held = held.map_or([false; 3], |h| h[s.row as usize]);
            (0..3).filter(|&i| held[i]).for_each(|i| way[i] = 0.0);
            let square = way.norm_squared();
            (square > 1e-6).then(|| way * (-gap / square))
        };
        let back: Vec<Option<Vector3<f64>>> = self.in_order(&one);
        for (s, back) in self.standing.iter().zip(back) {
            let back = back.unwrap_or_default();
            (0..3).for_each(|i| u[s.node as usize][i] += back[i]);
        }
    }

    /// Stored energy, J, with walls so many times softer than they are.
    pub(super) fn energy(&self, u: &[[f64; 3]], nodes_m: &[[f64; 3]], softer: f64) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let parts = self.each(u, nodes_m, softer, |s, potential, (gap, ..)| s.area_m2 * potential.at(gap)[0]);
        let springs = self.tethered.iter().map(|t| 0.5 * t.stiffness * t.stretch(u).norm_squared());
        parts.iter().sum::<f64>() + springs.sum::<f64>()
    }

    /// Adds the derivative of the energy to the internal forces of the nodes, N.
    pub(super) fn add_forces(&self, u: &[[f64; 3]], nodes_m: &[[f64; 3]], softer: f64, forces: &mut [[f64; 3]]) {
        if self.is_empty() {
            return;
        }
        let parts =
            self.each(u, nodes_m, softer, |s, potential, (gap, normal, _)| -s.area_m2 * potential.at(gap)[1] * normal);
        for (s, part) in self.standing.iter().zip(parts) {
            (0..3).for_each(|i| forces[s.node as usize][i] += part[i]);
        }
        for t in &self.tethered {
            let part = t.stiffness * t.stretch(u);
            (0..3).for_each(|i| forces[t.node as usize][i] += part[i]);
        }
    }

    /// Adds the stiffness to the blocks of the diagonal; `project` makes every block positive semi-definite. Held
    /// components of free rows stay alone.
    pub(super) fn add_stiffness(
        &self,
        u: &[[f64; 3]],
        nodes_m: &[[f64; 3]],
        softer: f64,
        held: Option<&[[bool; 3]]>,
        project: bool,
        tangent: &mut Tangent,
    ) {
        if self.is_empty() {
            return;
        }
        let parts = self.each(u, nodes_m, softer, |s, potential, (gap, normal, bend)| {
            let [_, pressure, stiffness] = potential.at(gap);
            if pressure == 0.0 {
                return Matrix3::zeros();
            }
            let mut curved = -pressure * bend;
            if project {
                let mut eigen = curved.symmetric_eigen();
                eigen.eigenvalues.iter_mut().for_each(|v| *v = v.max(0.0));
                curved = eigen.recompose();
            }
            s.area_m2 * (stiffness * normal * normal.transpose() + curved)
        });
        let matrix = &mut tangent.matrix;
        let walls = &mut tangent.walls;
        let mut add = |row: u32, block: Matrix3<f64>| {
            if block == Matrix3::zeros() {
                return;
            }
            let held = held.map_or([false; 3], |h| h[row as usize]);
            let target = &mut matrix.blocks[matrix.pattern.diagonal[row as usize] as usize];
            let mut own = [0.0; 9];
            for c in (0..3).filter(|&c| !held[c]) {
                for r in (0..3).filter(|&r| !held[r]) {
                    own[3 * c + r] = block[(r, c)];
                    target[3 * c + r] += block[(r, c)];
                }
            }
            walls.push((row, own));
        };
        for (s, part) in self.standing.iter().zip(parts) {
            add(s.row, part);
        }
        for t in &self.tethered {
            let along = t.along.map_or_else(Matrix3::identity, |n| n * n.transpose());
            add(t.row, t.stiffness * along);
        }
    }

    /// What drives the body when the wall of this number moves away from it: -dR per mm, N.
    pub(super) fn force_of_gap(&self, wall: usize, u: &[[f64; 3]], nodes_m: &[[f64; 3]]) -> Option<Vec<[f64; 3]>> {
        if wall >= self.walls.len() {
            return None;
        }
        let parts = self.each(u, nodes_m, 1.0, |s, potential, (gap, normal, _)| {
            let moves = s.wall as usize == wall && s.room_m(&self.walls[wall]).1;
            if moves { -s.area_m2 * potential.at(gap)[2] * METRES_PER_MM * normal } else { Vector3::zeros() }
        });
        let mut forces = vec![[0.0; 3]; u.len()];
        for (s, part) in self.standing.iter().zip(parts) {
            (0..3).for_each(|i| forces[s.node as usize][i] += part[i]);
        }
        Some(forces)
    }

    /// What every wall does, and the pressure on every node, Pa, in solver numbering; `None` where a node meets no wall.
    pub(super) fn outcome(&self, u: &[[f64; 3]], nodes_m: &[[f64; 3]]) -> (Vec<ContactOutcome>, Vec<Option<f64>>) {
        if self.walls.is_empty() {
            return (Vec::new(), Vec::new());
        }
        let parts = self.each(u, nodes_m, 1.0, |_, potential, (gap, normal, _)| (gap, potential.at(gap)[1], normal));
        let mut walls: Vec<ContactOutcome> =
            self.walls.iter().map(|w| ContactOutcome { set: w.set.clone(), ..Default::default() }).collect();
        let mut pressure_pa = vec![None; u.len()];
        for (s, (gap, pressure, normal)) in self.standing.iter().zip(parts) {
            let wall = &mut walls[s.wall as usize];
            wall.depth_mm = wall.depth_mm.max(-gap / METRES_PER_MM);
            *pressure_pa[s.node as usize].get_or_insert(0.0) += pressure;
            if pressure > 0.0 {
                wall.area_mm2 += s.area_m2 / METRES_PER_MM.powi(2);
                (0..3).for_each(|i| wall.force_n[i] += s.area_m2 * pressure * normal[i]);
            }
        }
        (walls, pressure_pa)
    }

    /// What the springs of every entry do.
    pub(super) fn outcome_of_tethers(&self, u: &[[f64; 3]]) -> Vec<TetherOutcome> {
        let entry = |set: &String| TetherOutcome { set: set.clone(), ..TetherOutcome::default() };
        let mut found: Vec<TetherOutcome> = self.tethered_sets.iter().map(entry).collect();
        for t in &self.tethered {
            let (entry, stretch) = (&mut found[t.set as usize], t.stretch(u));
            entry.stretch_mm = entry.stretch_mm.max(stretch.norm() / METRES_PER_MM);
            (0..3).for_each(|i| entry.force_n[i] -= t.stiffness * stretch[i]);
        }
        found
    }
}

/// A plane with the whole body at it or beyond it leaves no state to begin from: it looks the wrong way, or stands elsewhere. A
/// plane that lies upon a face of the body and looks away from it has nothing but rounding before it.
fn check_plane(set: &str, point_mm: [f64; 3], normal: [f64; 3], at: &Numbering) -> Result<(), FemError> {
    /// The part of the body's height over the plane that counts as being before it.
    const LEAST_PART: f64 = 1e-3;
    let (n, point) = (Vector3::from(normal).normalize(), Vector3::from(metres(point_mm)));
    let rooms = at.nodes_m.iter().map(|x| n.dot(&(Vector3::from(*x) - point)));
    let outermost = |(least, most): (f64, f64), room: f64| (least.min(room), most.max(room));
    let (least, most) = rooms.fold((f64::INFINITY, f64::NEG_INFINITY), outermost);
    if most > LEAST_PART * (most - least) {
        return Ok(());
    }
    // Rounding on the near side is no distance.
    Err(FemError::BeyondWall { set: set.to_owned(), least_mm: (-most).max(0.0) / METRES_PER_MM + 0.0 })
}

/// Nodes on springs that leave no direction free, in the mesh's numbering.
pub(super) fn tethered_nodes(sharing: &Sharing, scenario: &Scenario) -> Result<Vec<u32>, FemError> {
    let mut nodes = Vec::new();
    for tether in scenario.tethers.iter().filter(|t| !t.only_normal && t.stiffness_pa_per_mm > 0.0) {
        nodes.extend(surface_nodes(sharing, &tether.set)?.into_iter().map(|(n, ..)| n));
    }
    Ok(nodes)
}

/// Nodes of a surface with their area (m2) and mean outward normal, ascending; where a surface turns back on itself the
/// normal is shorter than one.
fn surface_nodes(sharing: &Sharing, set: &str) -> Result<Vec<(u32, f64, Vector3<f64>)>, FemError> {
    let mut nodes: BTreeMap<u32, (f64, Vector3<f64>)> = BTreeMap::new();
    for facet in surface_of(sharing, set)? {
        let area = Vector3::from(area_m2(sharing.mesh, facet)) / 3.0;
        for n in sharing.of_facet(facet) {
            let sum = nodes.entry(n).or_default();
            sum.0 += area.norm();
            sum.1 += area;
        }
    }
    let unit = |(n, (area, sum)): (u32, (f64, Vector3<f64>))| {
        let length = sum.norm();
        // Ridges and furrows keep a direction as long as their facets do not cancel.
        let normal = if length > 0.1 * area { sum / length } else { Vector3::zeros() };
        (n, area, normal)
    };
    Ok(nodes.into_iter().map(unit).collect())
}

/// The facets of a set, or of the whole boundary where `surface` is no set of the mesh.
fn surface_of(sharing: &Sharing, set: &str) -> Result<Vec<[u32; 3]>, FemError> {
    let mesh = sharing.mesh;
    let named = mesh.facet_sets.contains_key(set) || mesh.node_sets.contains_key(set);
    if set == WHOLE_SURFACE && !named { Ok(mesh.boundary_facets(|_| true)) } else { facets_of(mesh, set) }
}

/// The whole boundary, where the mesh has no set of this name.
const WHOLE_SURFACE: &str = "surface";

//! One step at a time from the last one's state.
//!
//! A moving body takes backward Euler steps as `fem::dynamics` does, each by one or two Newton iterations; one without
//! motion takes Newton steps towards its equilibrium. Either way a step is a descent of a potential - for a step in time
//! that of Baraff and Witkin's implicit step, inertia and damping included (Gast et al., "Optimization integrator for large
//! time steps", IEEE TVCG 21, 2015) - and is shortened until the potential falls: however a hand tears, nothing explodes.

use super::super::element::Laws;
use super::super::equilibrium::largest_ratio;
use super::super::linear::{LinearReport, LinearSolver, Tangent, Within};
use super::super::load::area_m2;
use super::super::mass::Mass;
use super::super::model::Model;
use super::super::scenario::{Loads, Materials, Method, Scenario};
use super::super::sparse::HELD;
use super::super::units::{METRES_PER_MM, metres, millimetres};
use super::super::{FemError, reduce, solver};
use super::hands::{Ball, Grip, Hands, Spring, SurfaceNode};
use crate::mesh::TetMesh;
use nalgebra::Vector3;

/// Whether steps go through time or towards equilibrium.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Manner {
    /// Backward Euler.
    #[default]
    Moving,
    /// Newton's method towards equilibrium, without time.
    QuasiStatic,
}

/// What a step came to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Out-of-balance force over applied force before the step.
    pub relative_residual: f64,
    /// Speed of the fastest node, mm/s; of a step without time how far it went, mm, over the time step.
    pub fastest_mm_per_s: f64,
    /// Iterations of the linear solver.
    pub linear_iterations: usize,
    /// The body had lost its way (a number that is not finite) and was put back to rest.
    pub recovered: bool,
}

/// What is read out now and then, not at every step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readout {
    /// Stored energy of body, walls and springs, J.
    pub energy_j: f64,
    /// Cells inside out.
    pub inverted: usize,
    /// The smallest volume ratio of a cell.
    pub least_volume_ratio: f64,
}

/// Steps of the line search, each half the last.
const HALVINGS: usize = 12;

/// How far the linear system of a step in time is solved, as a part of its right side: the next step begins where this one
/// ends and takes up what it left, so that rest is the equilibrium to the residual that rest is asked for.
const STEP_TOLERANCE: f64 = 1e-2;

/// A body under way.
pub struct Stepper {
    /// As [`Scenario::body`] leaves it.
    mesh: TetMesh,
    model: Model,
    laws: Laws,
    mass: Mass,
    solver: Box<dyn LinearSolver>,
    hands: Hands,
    manner: Manner,
    time_step_s: f64,
    newton_iterations: usize,
    /// Displacement, solver numbering, m.
    u: Vec<[f64; 3]>,
    /// Velocity of the free rows, m/s.
    v: Vec<[f64; 3]>,
    /// The matrix of the last system, whose memory the next one takes.
    spare: Option<Tangent>,
    /// Stored energy of body, walls and springs at `u`, where it is known.
    stored: Option<f64>,
    /// The tangent has changed by far more than by a step: the preconditioner is made anew.
    changed: bool,
}

/// The scenario as a live body reads it: held as in statics, so that its rest is the equilibrium `simulate` finds.
fn at_rest(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    scenario.solver.method = Method::Static;
    scenario
}

impl Stepper {
    /// The body at rest, its loads just set upon it.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn new(mesh: &TetMesh, scenario: &Scenario) -> Result<Self, FemError> {
        let mesh = scenario.body(mesh)?.into_owned();
        let scenario = at_rest(scenario);
        let model = Model::new(&mesh, &scenario)?;
        let laws = model.laws(&scenario.materials)?;
        let mass = Mass::new(&model);
        let solver = solver::for_model(&model, largest_ratio(&scenario.materials));
        let mut u = vec![[0.0; 3]; model.nodes_m.len()];
        model.move_prescribed(&mut u, 1.0);
        let v = vec![[0.0; 3]; model.free_nodes()];
        let hands = Hands { surface: surface(&mesh, &model), ..Hands::default() };
        let time_step_s = scenario.dynamics.time_step_s;
        let newton_iterations = scenario.dynamics.newton_iterations.clamp(1, 2);
        let manner = Manner::default();
        Ok(Self {
            mesh,
            model,
            laws,
            mass,
            solver,
            hands,
            manner,
            time_step_s,
            newton_iterations,
            u,
            v,
            spare: None,
            stored: None,
            changed: true,
        })
    }

    /// The mesh, cut open where sheets slide.
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// What may happen that keeps the model: other materials of the same names.
    ///
    /// # Errors
    /// [`FemError::Material`] and [`FemError::NoMaterial`]; nothing is changed then.
    pub fn set_materials(&mut self, materials: &Materials) -> Result<(), FemError> {
        self.laws = self.model.laws(materials)?;
        (self.stored, self.changed) = (None, true);
        let ratio = largest_ratio(&self.model.scenario.materials);
        self.model.scenario.materials.clone_from(materials);
        // The solver is chosen by Poisson's ratio.
        if largest_ratio(materials) != ratio {
            self.solver = solver::for_model(&self.model, largest_ratio(materials));
        }
        Ok(())
    }

    /// Other loads; the model stays.
    ///
    /// # Errors
    /// As [`Model::set_loads`]; nothing is changed then.
    pub fn set_loads(&mut self, loads: &Loads) -> Result<(), FemError> {
        let denser = loads.density_kg_per_m3 != self.model.scenario.loads.density_kg_per_m3;
        self.model.set_loads(&self.mesh, loads)?;
        if denser {
            self.changed = true;
            self.mass = Mass::new(&self.model);
        }
        Ok(())
    }

    /// Another scenario on the same mesh: the model is made again and the body goes on from where it is, as far as the new
    /// supports let it; nodes that are held now are put where they belong.
    ///
    /// # Errors
    /// As [`Stepper::new`]; nothing is changed then.
    pub fn set_scenario(&mut self, scenario: &Scenario) -> Result<(), FemError> {
        let mut fresh = Self::new(&self.mesh, scenario)?;
        let old_row = |mesh_node: usize| self.model.row_of[self.model.number[mesh_node] as usize];
        // The graph's numbering does not depend on what is held, but rows do.
        for node in 0..self.model.number.len() {
            let (old, new) = (self.model.number[node] as usize, fresh.model.number[node] as usize);
            let held = fresh.model.held_of_row(fresh.model.row_of[new]);
            (0..3).filter(|&i| !held[i]).for_each(|i| fresh.u[new][i] = self.u[old][i]);
            let (from, to) = (old_row(node), fresh.model.row_of[new]);
            if from != HELD && to != HELD {
                fresh.v[to as usize] = self.v[from as usize];
            }
        }
        fresh.model.clear_held(&mut fresh.v);
        fresh.manner = self.manner;
        fresh.time_step_s = self.time_step_s;
        if !fresh.model.energy(&fresh.u, &fresh.laws).is_finite() {
            fresh.rest();
        }
        *self = fresh;
        Ok(())
    }

    /// Back to the undeformed body, at rest; what the solver remembers of its way is forgotten, so that the same steps follow.
    pub fn rest(&mut self) {
        self.u.fill([0.0; 3]);
        self.model.move_prescribed(&mut self.u, 1.0);
        self.v.fill([0.0; 3]);
        (self.spare, self.stored, self.changed) = (None, None, true);
        self.solver = solver::for_model(&self.model, largest_ratio(&self.model.scenario.materials));
    }

    /// Starts from a displacement of the mesh's nodes (mm), at rest. Cells may be inside out where every law has an energy for
    /// that (`inversion_threshold`); else the start is dropped for rest, and `false` comes back.
    ///
    /// # Errors
    /// As [`Model::state`].
    pub fn start_from(&mut self, displacement_mm: &[[f64; 3]]) -> Result<bool, FemError> {
        let state = self.model.state(displacement_mm)?;
        self.rest();
        self.u = state.u;
        self.model.hold(&mut self.u);
        let taken = self.model.energy(&self.u, &self.laws).is_finite();
        if !taken {
            self.rest();
        }
        Ok(taken)
    }

    /// Through time or without it; the body stops where it is.
    pub fn set_manner(&mut self, manner: Manner) {
        (self.manner, self.changed) = (manner, true);
        self.v.fill([0.0; 3]);
    }

    /// Length of the steps in time, s.
    pub fn set_time_step(&mut self, time_step_s: f64) {
        (self.time_step_s, self.changed) = (time_step_s, true);
    }

    /// What hands hold and where the ball is; springs on held nodes do nothing.
    pub fn set_hands(&mut self, grips: &[Grip], ball: Option<Ball>) {
        let spring = |grip: &Grip| {
            let node = self.model.number[grip.node as usize];
            let stiffness = grip.stiffness_n_per_mm / METRES_PER_MM;
            Spring { node, row: self.model.row_of[node as usize], to_m: Vector3::from(metres(grip.to_mm)), stiffness }
        };
        self.hands.springs = grips.iter().map(spring).filter(|s| s.row != HELD).collect();
        self.hands.ball = ball;
    }

    /// Displacement of the mesh's nodes, mm.
    pub fn displacement_mm(&self) -> Vec<[f64; 3]> {
        self.model.to_mesh_mm(&self.u)
    }

    /// Displacement of one node of the mesh, mm.
    pub fn displacement_of_mm(&self, node: u32) -> [f64; 3] {
        millimetres(self.u[self.model.number[node as usize] as usize])
    }

    /// Force of the grips and of the ball on the body, N.
    pub fn force_n(&self) -> [[f64; 3]; 2] {
        self.hands.force_n(&self.u, &self.model.nodes_m)
    }

    /// Nodes of the mesh that hands act on now, ascending.
    pub fn touched(&self) -> Vec<u32> {
        let touched = self.hands.touched(&self.u, &self.model.nodes_m);
        (0..self.model.corners as u32)
            .filter(|&n| touched.binary_search(&self.model.number[n as usize]).is_ok())
            .collect()
    }

    /// Energy and cells, which take a pass over the body.
    pub fn readout(&self) -> Readout {
        let cells = self.model.body.state(&self.u, &self.laws);
        let ratios = || cells.iter().map(|s| s[1]);
        Readout {
            energy_j: self.stored.unwrap_or_else(|| self.model.energy(&self.u, &self.laws)),
            inverted: ratios().filter(|&r| r <= 0.0).count(),
            least_volume_ratio: ratios().fold(f64::INFINITY, f64::min),
        }
    }

    /// Volume ratio and stored energy per undeformed volume (Pa) of every cell.
    pub fn cells(&self) -> (Vec<f64>, Vec<f64>) {
        self.model.body.state(&self.u, &self.laws).into_iter().map(|s| (s[0], s[2])).unzip()
    }

    /// One step.
    pub fn step(&mut self) -> StepReport {
        let report = match self.manner {
            Manner::Moving => self.step_in_time(),
            Manner::QuasiStatic => self.step_to_equilibrium(),
        };
        let sound = self.u.iter().chain(&self.v).flatten().all(|x| x.is_finite());
        if let Some(report) = report.filter(|_| sound) {
            return report;
        }
        self.rest();
        StepReport { recovered: true, ..StepReport::default() }
    }

    /// Energy of the hands less the work of the loads, J.
    fn outside(&self, u: &[[f64; 3]]) -> f64 {
        self.hands.energy(u, &self.model.nodes_m) - reduce::dot(&self.model.load_n, u)
    }

    /// Tangent of the body and out-of-balance force of all; supports and hands are not in the tangent yet.
    fn linearised(&mut self, u: &[[f64; 3]], project: bool) -> (Tangent, Vec<[f64; 3]>) {
        let mut forces = vec![[0.0; 3]; u.len()];
        let spare = self.spare.take();
        let tangent = self.model.tangent_of_body(u, &self.laws, &mut forces, project, spare);
        self.model.supports.add_forces(u, &self.model.nodes_m, self.laws.walls_softer, &mut forces);
        self.hands.add_forces(u, &self.model.nodes_m, &mut forces);
        (tangent, self.model.out_of_balance(&forces, 1.0))
    }

    fn add_supports_and_hands(&self, u: &[[f64; 3]], project: bool, system: &mut Tangent) {
        self.model.add_stiffness_of_supports(u, self.laws.walls_softer, project, system);
        let held = self.model.held_components.as_ref().map(|held| held.as_slice());
        self.hands.add_stiffness(u, &self.model.nodes_m, held, system);
    }

    /// Loads and hands: what a residual is measured by.
    fn load_scale(&self) -> f64 {
        let [springs, ball] = self.force_n().map(|f| Vector3::from(f).norm());
        let scale = reduce::norm(&self.model.free_part(&self.model.load_n)) + springs + ball;
        if scale > 0.0 { scale } else { 1.0 }
    }

    fn step_in_time(&mut self) -> Option<StepReport> {
        let settings = &self.model.scenario.dynamics;
        let h = self.time_step_s;
        let (mass_damping, stiffness_damping) = (settings.mass_damping_per_s, settings.stiffness_damping_s);
        let mass_factor = 1.0 / (h * h) + mass_damping / h;
        let scaled: Vec<[f64; 3]> = self.v.iter().map(|v| v.map(|x| x / h)).collect();
        let mut momentum = self.mass.product(&scaled);
        self.model.clear_held(&mut momentum);
        let mut report = StepReport::default();
        let scale = self.load_scale();
        let mut moved = vec![[0.0; 3]; self.v.len()];
        for iteration in 0..self.newton_iterations {
            let now = self.u.clone();
            let mut inertia = self.mass.product(&moved);
            inertia.iter_mut().flatten().for_each(|x| *x *= mass_factor);
            let mut found = None;
            for project in [false, true] {
                let (tangent, balance) = self.linearised(&now, project);
                if iteration == 0 {
                    report.relative_residual = reduce::norm(&balance) / scale;
                }
                let mut rhs = balance;
                add(&mut rhs, 1.0, &momentum);
                if iteration > 0 {
                    add(&mut rhs, -1.0, &inertia);
                    let mut damped = vec![[0.0; 3]; moved.len()];
                    tangent.product(&moved, &mut damped);
                    add(&mut rhs, -stiffness_damping / h, &damped);
                    self.model.clear_held(&mut rhs);
                }
                if !reduce::norm(&rhs).is_finite() {
                    return None;
                }
                let mut system = self.mass.plus(mass_factor, tangent, 1.0 + stiffness_damping / h);
                self.add_supports_and_hands(&now, project, &mut system);
                self.solver.take_up(&system, std::mem::take(&mut self.changed));
                let mut change = vec![[0.0; 3]; rhs.len()];
                let along: &[[f64; 3]] = if iteration == 0 { &self.v } else { &[] };
                let solved = solve_along(along, self.solver.as_mut(), &system, &rhs, &mut change, STEP_TOLERANCE);
                report.linear_iterations += solved.iterations;
                self.spare = Some(system);
                found = Some(change);
                if !solved.negative_curvature {
                    break;
                }
            }
            let change = found?;
            // The damping's part of the step's potential is left out: it only rises.
            let bend = mass_factor * reduce::dot(&self.mass.product(&change), &change);
            let pull = reduce::dot(&momentum, &change) - reduce::dot(&inertia, &change);
            let (u, length) = self.descended(&now, &change, 1e-9, |a| 0.5 * a * a * bend - a * pull);
            add(&mut moved, length, &change);
            self.u = u;
        }
        for (v, m) in self.v.iter_mut().zip(&moved) {
            *v = m.map(|x| x / h);
        }
        report.fastest_mm_per_s = largest(&self.v) / METRES_PER_MM;
        Some(report)
    }

    /// As far along `change` as the potential with `more` falls but for rounding (a part `noise` of what is stored): there, and
    /// which part of the way that is.
    fn descended(
        &mut self,
        from: &[[f64; 3]],
        change: &[[f64; 3]],
        noise: f64,
        more: impl Fn(f64) -> f64,
    ) -> (Vec<[f64; 3]>, f64) {
        let stored = self.stored.take().unwrap_or_else(|| self.model.energy(from, &self.laws));
        let here = stored + self.outside(from);
        let noise = noise * (stored.abs() + self.outside(from).abs());
        let mut length = 1.0;
        for _ in 0..HALVINGS {
            let mut trial = from.to_vec();
            self.model.add_free(&mut trial, length, change);
            let energy = self.model.energy(&trial, &self.laws);
            if energy + self.outside(&trial) + more(length) <= here + noise {
                self.stored = Some(energy);
                return (trial, length);
            }
            length *= 0.5;
        }
        self.stored = Some(stored);
        (from.to_vec(), 0.0)
    }

    fn step_to_equilibrium(&mut self) -> Option<StepReport> {
        let now = self.u.clone();
        let mut report = StepReport::default();
        let goal = self.model.scenario.solver.relative_residual;
        let scale = self.load_scale();
        let mut found = None;
        for project in [false, true] {
            let (mut tangent, rhs) = self.linearised(&now, project);
            let size = reduce::norm(&rhs);
            if !size.is_finite() {
                return None;
            }
            report.relative_residual = size / scale;
            if report.relative_residual <= goal {
                self.spare = Some(tangent);
                return Some(report);
            }
            self.add_supports_and_hands(&now, project, &mut tangent);
            self.solver.prepare(&tangent);
            let mut change = vec![[0.0; 3]; rhs.len()];
            let finest = (0.1 * report.relative_residual).clamp(1e-4, 1e-2);
            let solved = self.solver.solve(&tangent, &rhs, &mut change, Within::Residual(finest));
            report.linear_iterations += solved.iterations;
            self.spare = Some(tangent);
            let slope = reduce::dot(&rhs, &change);
            found = Some((change, slope));
            if !solved.negative_curvature {
                break;
            }
        }
        let (change, slope) = found?;
        let (u, length) = self.descended(&now, &change, 1e-11, |a| 1e-4 * a * slope);
        self.u = u;
        self.v.fill([0.0; 3]);
        report.fastest_mm_per_s = length * largest(&change) / METRES_PER_MM / self.time_step_s;
        Some(report)
    }
}

/// Boundary nodes with the area around them.
fn surface(mesh: &TetMesh, model: &Model) -> Vec<SurfaceNode> {
    let mut areas = vec![0.0; model.corners];
    for facet in mesh.boundary_facets(|_| true) {
        let area = Vector3::from(area_m2(mesh, facet)).norm() / 3.0;
        for n in facet {
            areas[n as usize] += area;
        }
    }
    let on_surface = areas.iter().enumerate().filter(|(_, area)| **area > 0.0);
    let node = |(n, &area_m2): (usize, &f64)| {
        let node = model.number[n];
        SurfaceNode { node, row: model.row_of[node as usize], area_m2 }
    };
    on_surface.map(node).filter(|s| s.row != HELD).collect()
}

/// Solves for the displacement of a step from the best multiple of the velocity, as `fem::dynamics` does: with damping by
/// stiffness all modes slow down at nearly one rate, and little is left to iterate for.
fn solve_along(
    velocity: &[[f64; 3]],
    solver: &mut dyn LinearSolver,
    system: &Tangent,
    rhs: &[[f64; 3]],
    change: &mut [[f64; 3]],
    tolerance: f64,
) -> LinearReport {
    let mut multiple = f64::NAN;
    let mut image = vec![[0.0; 3]; rhs.len()];
    if velocity.len() == rhs.len() {
        system.product(velocity, &mut image);
        multiple = reduce::dot(velocity, rhs) / reduce::dot(velocity, &image);
    }
    if !(multiple.is_finite() && multiple > 0.0) {
        return solver.solve(system, rhs, change, Within::Residual(tolerance));
    }
    let mut rest = rhs.to_vec();
    add(&mut rest, -multiple, &image);
    let left = reduce::norm(&rest) / reduce::norm(rhs);
    let report = solver.solve(system, &rest, change, Within::Residual((tolerance / left).min(0.5)));
    add(change, multiple, velocity);
    report
}

fn add(a: &mut [[f64; 3]], factor: f64, b: &[[f64; 3]]) {
    a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += factor * b);
}

/// The longest of vectors.
fn largest(vectors: &[[f64; 3]]) -> f64 {
    vectors.iter().map(|v| v.iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max).sqrt()
}

//! Static equilibrium: inexact Newton with a line search on the potential energy and adaptive load steps.
//!
//! The potential is Pi(u) = sum V Psi(F(u)) - f . u. Newton's linear systems are solved only as well as the outer
//! iteration can use (Eisenstat and Walker, SIAM J. Sci. Comput. 17, 1996, choice 2); steps are halved until Pi falls
//! enough (Armijo; Nocedal and Wright, "Numerical Optimization", ch. 3). Where the tangent is not positive definite its
//! elements are projected, so that the step still goes down. A load step that fails is halved; one that succeeds lets
//! the next be longer.

use super::element::Laws;
use super::linear::{LinearReport, LinearSolver, Within};
use super::model::{Model, Projected};
use super::outcome::worst;
use super::scenario::Materials;
use super::solver;
use super::state::State;
use super::{ConvergenceRecord, FemError, NewtonIteration, Outcome, Progress, reduce};
use crate::material::law::Material;

/// Why a load step was given up.
enum Stuck {
    Iterations,
    LineSearch,
    NotFinite,
}

impl Stuck {
    fn words(&self) -> &'static str {
        match self {
            Self::Iterations => "Newton's method ran out of iterations",
            Self::LineSearch => "no step lowers the energy",
            Self::NotFinite => INSIDE_OUT,
        }
    }
}

/// Why an energy is not finite.
pub(super) const INSIDE_OUT: &str = "the deformation turns an element inside out, where a law without \
    `inversion_threshold` has no energy, or stretches it beyond what its law has an energy for";

/// Sufficient decrease of the line search.
const ARMIJO: f64 = 1e-4;

/// Accuracy of the first linear solution of a load step, where large rotations spoil a better one, and from a given
/// state, which is thought to be near.
const FIRST_FORCING: [f64; 2] = [0.1, 0.01];

/// Coarsest accuracy of a linear solution. Coarser ones would do for the last iteration, and for all of them before walls that
/// only have to be met roughly: there the iterations go round in circles.
const COARSEST: f64 = 0.1;

/// A load step is given up for a shorter one when the residual has found no new minimum for so many iterations.
const PATIENCE: usize = 12;
/// What a new minimum is of the last one: less would be a way that leads nowhere, slowly.
const NEW_BEST: f64 = 0.98;

/// How many times softer walls are on the way from rest to their own softness.
const SOFTER: [f64; 3] = [40.0, 13.0, 4.0];

/// What ends a step whose walls are not yet what they are.
const ROUGHLY: Within = Within::Residual(0.6);

/// Newton iterations of all load steps together, in units of the most for one: the whole call ends with a verdict.
const BUDGET: usize = 8;

impl Model {
    /// Equilibrium of the model with these materials, from rest or from a state of an earlier solve.
    ///
    /// # Errors
    /// [`FemError::NoEquilibrium`] with the load reached, the reason and the worst element.
    pub fn solve(
        &self,
        materials: &Materials,
        warm_start: Option<&State>,
        progress: &dyn Fn(&Progress),
    ) -> Result<(Outcome, State), FemError> {
        let goal = Within::Residual(self.scenario.solver.relative_residual);
        self.solve_within(goal, materials, warm_start, progress)
    }

    /// [`Model::solve`] no better than is asked for: its residual, or the energy of the last step as a part of the body's and
    /// the loads'. What is then left is that of the step's own linear solution and the square of the step.
    ///
    /// # Errors
    /// As [`Model::solve`].
    pub(crate) fn solve_within(
        &self,
        goal: Within,
        materials: &Materials,
        warm_start: Option<&State>,
        progress: &dyn Fn(&Progress),
    ) -> Result<(Outcome, State), FemError> {
        let mut laws = self.laws(materials)?;
        let mut record = ConvergenceRecord::default();
        let mut solver = solver::for_model(self, largest_ratio(materials));
        let nodes = self.nodes_m.len();
        let mut forces = vec![[0.0; 3]; nodes];
        let load_scale = reduce::norm(&self.free_part(&self.load_n));

        let work = |u: &[[f64; 3]]| reduce::dot(&self.load_n, u);
        // An equilibrium from cells inside out.
        let mut doubtful = None;
        if let Some(state) = warm_start.filter(|s| s.u.len() == nodes) {
            let mut u = state.u.clone();
            self.hold(&mut u);
            self.supports.push_out(&mut u, &self.nodes_m, self.held_components.as_deref().map(Vec::as_slice));
            let stored = self.energy(&u, &laws);
            if stored.is_finite() {
                let all_whole = |u: &[[f64; 3]]| self.body.state(u, &laws).iter().all(|s| s[1] > 0.0);
                let start_whole = all_whole(&u);
                let stage =
                    Stage { laws: &laws, factor: 1.0, load_scale, first_forcing: FIRST_FORCING[1], goal, progress };
                let found = self.newton(&stage, &mut u, &mut forces, solver.as_mut(), &mut record).is_ok();
                // A start far off may lead to an equilibrium with cells inside out: then the way is from rest.
                if found && all_whole(&u) {
                    if start_whole {
                        record.load_steps.push(1.0);
                        return Ok((self.outcome(&u, &forces, &laws, record), State { u }));
                    }
                    // From cells inside out Newton may end in a body that overlaps itself, all volumes positive and in
                    // equilibrium: it is taken only if the one from rest has no lower potential (but for rounding).
                    let potential = self.energy(&u, &laws) - work(&u);
                    doubtful = Some((u, forces.clone(), record.relative_residual, potential - 1e-9 * stored));
                }
            }
        }

        let way = Way { goal, load_scale, progress };
        let from_rest = self.solve_from_rest(&mut laws, way, &mut forces, solver.as_mut(), &mut record);
        let (u, forces) = match (from_rest, doubtful) {
            (Ok(u), Some((.., lower))) if self.energy(&u, &laws) - work(&u) < lower => (u, forces),
            (_, Some((u, forces, relative_residual, _))) => {
                record = ConvergenceRecord { load_steps: vec![1.0], relative_residual, ..record };
                (u, forces)
            }
            (from_rest, None) => (from_rest?, forces),
        };
        Ok((self.outcome(&u, &forces, &laws, record), State { u }))
    }

    /// Equilibrium from rest, in load steps; `forces` become its internal forces.
    fn solve_from_rest(
        &self,
        laws: &mut Laws,
        way: Way,
        forces: &mut [[f64; 3]],
        solver: &mut dyn LinearSolver,
        record: &mut ConvergenceRecord,
    ) -> Result<Vec<[f64; 3]>, FemError> {
        let Way { goal, load_scale, progress } = way;
        if let Some(u) = self.through_soft_walls(laws, way, forces, solver, record) {
            let stage = Stage { laws, factor: 1.0, load_scale, first_forcing: FIRST_FORCING[1], goal, progress };
            let mut hardened = u;
            if self.newton(&stage, &mut hardened, forces, solver, record).is_ok() {
                record.load_steps.push(1.0);
                return Ok(hardened);
            }
        }
        let laws = &*laws;
        let mut u = vec![[0.0; 3]; self.nodes_m.len()];
        let mut before: Option<(f64, Vec<[f64; 3]>)> = None;
        let (mut reached, mut step) = (0.0_f64, 1.0_f64);
        while reached < 1.0 {
            let factor = (reached + step).min(1.0);
            let stage = Stage { laws, factor, load_scale, first_forcing: FIRST_FORCING[0], goal, progress };
            let start = self.predicted(&u, reached, before.as_ref(), factor, laws, solver);
            let mut trial = start;
            match self.newton(&stage, &mut trial, forces, solver, record) {
                Ok(()) => {
                    before = Some((reached, std::mem::replace(&mut u, trial)));
                    reached = factor;
                    record.load_steps.push(factor);
                    step *= 2.0;
                }
                Err(stuck) => {
                    step *= 0.5;
                    let spent = record.iterations.len() >= BUDGET * self.scenario.solver.newton_iterations;
                    if spent || step < self.scenario.solver.smallest_load_step {
                        let state = self.body.state(&trial, laws);
                        let worst = worst(&state);
                        return Err(FemError::NoEquilibrium {
                            percent: 100.0 * reached,
                            reason: stuck.words().to_owned(),
                            cell: worst,
                            jacobian: state[worst][1],
                        });
                    }
                }
            }
        }
        Ok(u)
    }

    /// Near the equilibrium of a body before walls under the whole load, by way of softer ones; the walls are what they are
    /// at the end. `None` without walls, or where that way leads nowhere.
    ///
    /// A body with room before its wall falls into it in one step of Newton's method, and most of the next steps go to
    /// finding out which nodes are pressed. Walls as thick as the room catch it softly. The way from one softness to the next
    /// goes on along the last one, as far as the depth behind a wall that gets harder: in proportion to the softness.
    fn through_soft_walls(
        &self,
        laws: &mut Laws,
        way: Way,
        forces: &mut [[f64; 3]],
        solver: &mut dyn LinearSolver,
        record: &mut ConvergenceRecord,
    ) -> Option<Vec<[f64; 3]>> {
        if !self.supports.has_walls() {
            return None;
        }
        let Way { load_scale, progress, .. } = way;
        let mut u = vec![[0.0; 3]; self.nodes_m.len()];
        self.move_prescribed(&mut u, 1.0);
        let mut last: Option<(f64, Vec<[f64; 3]>)> = None;
        for (n, softer) in SOFTER.into_iter().enumerate() {
            laws.walls_softer = softer;
            let first_forcing = FIRST_FORCING[n.min(1)];
            let stage = Stage { laws, factor: 1.0, load_scale, first_forcing, goal: ROUGHLY, progress };
            let found = self.newton(&stage, &mut u, forces, solver, record).is_ok();
            laws.walls_softer = 1.0;
            if !found {
                return None;
            }
            let next = SOFTER.get(n + 1).copied().unwrap_or(1.0);
            let ahead = last.as_ref().map(|(was, old)| {
                let part = (softer - next) / (was - softer);
                u.iter().zip(old).map(|(u, o)| [0, 1, 2].map(|i| u[i] + part * (u[i] - o[i]))).collect::<Vec<_>>()
            });
            last = Some((softer, u.clone()));
            u = ahead.filter(|ahead| self.energy(ahead, laws).is_finite()).unwrap_or(u);
        }
        Some(u)
    }

    /// Puts held components where they belong at the whole load, whatever a start says of them.
    pub(super) fn hold(&self, u: &mut [[f64; 3]]) {
        for (u, &row) in u.iter_mut().zip(&self.row_of) {
            let held = self.held_of_row(row);
            (0..3).filter(|&i| held[i]).for_each(|i| u[i] = 0.0);
        }
        self.move_prescribed(u, 1.0);
    }

    /// Puts prescribed components where they belong at a part of the load.
    pub(super) fn move_prescribed(&self, u: &mut [[f64; 3]], factor: f64) {
        for (node, components, to) in &self.prescribed {
            for i in (0..3).filter(|&i| components[i]) {
                u[*node as usize][i] = factor * to[i];
            }
        }
    }

    /// Where to start a load step: along the last step, or, when nodes are moved, along the elastic answer to their
    /// movement; the old state when those are not finite.
    fn predicted(
        &self,
        u: &[[f64; 3]],
        reached: f64,
        before: Option<&(f64, Vec<[f64; 3]>)>,
        factor: f64,
        laws: &Laws,
        solver: &mut dyn LinearSolver,
    ) -> Vec<[f64; 3]> {
        let mut candidates: Vec<Vec<[f64; 3]>> = Vec::new();
        if let Some((earlier, old)) = before {
            let ahead = (factor - reached) / (reached - earlier);
            candidates.push(u.iter().zip(old).map(|(u, o)| [0, 1, 2].map(|i| u[i] + ahead * (u[i] - o[i]))).collect());
        }
        if !self.prescribed.is_empty() {
            candidates.push(self.elastic_answer(u, reached, factor, laws, solver));
        }
        for mut candidate in candidates {
            self.move_prescribed(&mut candidate, factor);
            if self.energy(&candidate, laws).is_finite() {
                return candidate;
            }
        }
        let mut same = u.to_vec();
        self.move_prescribed(&mut same, factor);
        same
    }

    /// The linear answer of the free nodes to a movement of the prescribed ones, by a difference of forces.
    fn elastic_answer(
        &self,
        u: &[[f64; 3]],
        reached: f64,
        factor: f64,
        laws: &Laws,
        solver: &mut dyn LinearSolver,
    ) -> Vec<[f64; 3]> {
        let small = 1e-4;
        let mut moved = u.to_vec();
        self.move_prescribed(&mut moved, reached + small * (factor - reached));
        let (mut here, mut there) = (vec![[0.0; 3]; u.len()], vec![[0.0; 3]; u.len()]);
        let tangent = self.tangent(u, laws, &mut here, Projected::All, None);
        self.internal_forces(&moved, laws, &mut there);
        let difference: Vec<[f64; 3]> =
            there.iter().zip(&here).map(|(t, h)| [0, 1, 2].map(|i| (h[i] - t[i]) / small)).collect();
        let rhs = self.free_part(&difference);
        let mut answer = vec![[0.0; 3]; rhs.len()];
        solver.prepare(&tangent);
        solver.solve(&tangent, &rhs, &mut answer, Within::Residual(1e-3));
        let mut predicted = u.to_vec();
        self.add_free(&mut predicted, 1.0, &answer);
        predicted
    }

    /// u += factor step on the free nodes.
    pub(super) fn add_free(&self, u: &mut [[f64; 3]], factor: f64, step: &[[f64; 3]]) {
        for (&node, s) in self.node_of_row.iter().zip(step) {
            (0..3).for_each(|i| u[node as usize][i] += factor * s[i]);
        }
    }

    /// Newton's method at one load; on success `u` is the equilibrium and `forces` its internal forces.
    fn newton(
        &self,
        stage: &Stage,
        u: &mut Vec<[f64; 3]>,
        forces: &mut [[f64; 3]],
        solver: &mut dyn LinearSolver,
        record: &mut ConvergenceRecord,
    ) -> Result<(), Stuck> {
        let settings = &self.scenario.solver;
        let (laws, factor) = (stage.laws, stage.factor);
        let work = |u: &[[f64; 3]]| factor * reduce::dot(&self.load_n, u);
        let stored = self.energy(u, laws);
        if !stored.is_finite() {
            return Err(Stuck::NotFinite);
        }
        let mut potential = stored - work(u);
        let mut energy_scale = stored.abs() + work(u).abs();
        let (mut last_size, mut last_forcing) = (f64::INFINITY, 0.0);
        let mut reference = stage.load_scale;
        let mut project = false;
        let (mut best, mut since_best) = (f64::INFINITY, 0);
        let mut spare = None;
        for iteration in 0..=settings.newton_iterations {
            let projected = if project {
                Projected::All
            } else if last_size > reference {
                Projected::Walls
            } else {
                Projected::Nothing
            };
            let mut tangent = self.tangent(u, laws, forces, projected, spare.take());
            let rhs = self.out_of_balance(forces, factor);
            let size = reduce::norm(&rhs);
            if !size.is_finite() {
                return Err(Stuck::NotFinite);
            }
            // Loads may be nothing but moved nodes: then what they cause first is the measure.
            if reference == 0.0 {
                reference = self.force_scale(forces).max(size);
            }
            let relative = if reference > 0.0 { size / reference } else { 0.0 };
            record.relative_residual = relative;
            (stage.progress)(&Progress {
                fraction: factor,
                iteration: record.iterations.len(),
                relative_residual: relative,
                goal: stage.goal.residual(),
            });
            if relative <= stage.goal.residual() {
                return Ok(());
            }
            (best, since_best) = if size < NEW_BEST * best { (size, 0) } else { (best.min(size), since_best + 1) };
            let spent = record.iterations.len() >= BUDGET * settings.newton_iterations;
            if iteration == settings.newton_iterations || since_best > PATIENCE || spent {
                return Err(Stuck::Iterations);
            }
            let needed = (0.5 * stage.goal.residual() / relative).min(COARSEST);
            let forcing = if iteration == 0 {
                stage.first_forcing.max(needed)
            } else {
                forcing_term(size / last_size, last_forcing, needed)
            };
            (last_size, last_forcing) = (size, forcing);
            let mut step = vec![[0.0; 3]; rhs.len()];
            solver.prepare(&tangent);
            let through_walls = relative > 1.0 && self.supports.has_walls();
            let within = if through_walls { THROUGH_WALLS } else { Within::Residual(forcing) };
            let mut report = solver.solve(&tangent, &rhs, &mut step, within);
            if report.negative_curvature && !project {
                // Not a minimum's neighbourhood: with projected elements the step certainly goes down.
                tangent = self.tangent(u, laws, forces, Projected::All, Some(tangent));
                solver.prepare(&tangent);
                let again = solver.solve(&tangent, &rhs, &mut step, within);
                report = LinearReport { iterations: report.iterations + again.iterations, ..again };
                project = true;
            } else {
                project = false;
            }
            let mut slope = -reduce::dot(&rhs, &step);
            if slope.is_nan() || slope >= 0.0 {
                // The linear solver lost its way: straight downhill, scaled by the diagonal.
                for ((s, r), d) in step.iter_mut().zip(&rhs).zip(tangent.diagonal_blocks()) {
                    *s = [0, 1, 2].map(|i| r[i] / d[4 * i].abs().max(f64::MIN_POSITIVE));
                }
                slope = -reduce::dot(&rhs, &step);
            }
            // Close to the solution the fall of energy drowns in rounding: any finite step is taken.
            let noise = 1e-11 * energy_scale;
            let mut length = 1.0;
            let (trial, next) = loop {
                let mut trial = u.clone();
                self.add_free(&mut trial, length, &step);
                let stored = self.energy(&trial, laws);
                let next = stored - work(&trial);
                if next <= potential + ARMIJO * length * slope + noise {
                    energy_scale = stored.abs() + work(&trial).abs();
                    break (trial, next);
                }
                length *= 0.5;
                if length < 1e-9 {
                    return Err(if next.is_finite() { Stuck::LineSearch } else { Stuck::NotFinite });
                }
            };
            record.iterations.push(NewtonIteration {
                load_factor: factor,
                relative_residual: relative,
                linear_iterations: report.iterations,
                step_length: length,
                projected: project,
            });
            *u = trial;
            potential = next;
            if matches!(stage.goal, Within::Energy(part) if length == 1.0 && -slope <= part * part * energy_scale) {
                self.internal_forces(u, laws, forces);
                record.relative_residual = reduce::norm(&self.out_of_balance(forces, factor)) / reference;
                return Ok(());
            }
            spare = Some(tangent);
        }
        Err(Stuck::Iterations)
    }

    /// Applied minus internal forces on the free rows.
    pub(super) fn out_of_balance(&self, forces: &[[f64; 3]], factor: f64) -> Vec<[f64; 3]> {
        let both = self.node_of_row.iter().map(|&n| (&forces[n as usize], &self.load_n[n as usize]));
        let mut rows: Vec<[f64; 3]> = both.map(|(f, l)| [0, 1, 2].map(|i| factor * l[i] - f[i])).collect();
        self.clear_held(&mut rows);
        rows
    }

    /// Size of the internal forces on held nodes: what the supports carry.
    fn force_scale(&self, forces: &[[f64; 3]]) -> f64 {
        let held: f64 = forces
            .iter()
            .zip(&self.row_of)
            .filter(|(_, row)| **row == super::sparse::HELD)
            .map(|(f, _)| f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
            .sum();
        held.sqrt()
    }
}

/// The largest Poisson's ratio among materials.
pub(super) fn largest_ratio(materials: &Materials) -> f64 {
    materials.values().map(Material::poisson_ratio).fold(0.0, f64::max)
}

/// What stays the same on the way from rest.
#[derive(Clone, Copy)]
struct Way<'a> {
    /// What is good enough at the end.
    goal: Within,
    /// Size of the load on the free nodes, N.
    load_scale: f64,
    progress: &'a dyn Fn(&Progress),
}

/// What stays the same during one load step.
struct Stage<'a> {
    laws: &'a Laws,
    factor: f64,
    load_scale: f64,
    first_forcing: f64,
    /// What is good enough.
    goal: Within,
    progress: &'a dyn Fn(&Progress),
}

/// How good a step is where forces are larger than the load: nodes are pressed through walls then, and a residual says little of
/// the body.
const THROUGH_WALLS: Within = Within::Energy(0.1);

/// Eisenstat and Walker's choice 2 with their safeguard; never finer than the outer iteration needs.
fn forcing_term(ratio: f64, last: f64, needed: f64) -> f64 {
    let mut forcing = 0.9 * ratio * ratio;
    let guard = 0.9 * last * last;
    if guard > 0.1 {
        forcing = forcing.max(guard);
    }
    forcing.clamp(1e-4, COARSEST).max(needed)
}

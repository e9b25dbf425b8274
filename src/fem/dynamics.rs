//! Motion: implicit backward Euler with Rayleigh damping C = a M + b K.
//!
//! One step of length h from (u, v) solves
//!   M (v+ - v)/h + C v+ + f_int(u+) = f_ext,  v+ = (u+ - u)/h
//! by Newton's method from u+ = u (Baraff and Witkin, "Large steps in cloth simulation", SIGGRAPH 1998), with the
//! stiffness in C that of the start of the step: one iteration is their linearised step, more converge to the nonlinear
//! one. Free fall and linear modes come out exactly as the formula says. Prescribed displacements are in place from the
//! start.

use super::element::Laws;
use super::equilibrium::{INSIDE_OUT, largest_ratio};
use super::linear::{self, Tangent, Within};
use super::mass::Mass;
use super::model::Model;
use super::outcome::worst;
use super::scenario::Materials;
use super::solver;
use super::units::METRES_PER_MM;
use super::{ConvergenceRecord, FemError, FemWarning, Frame, Motion, NewtonIteration, Outcome, Progress, reduce};

/// Most Newton iterations of a step that is to be solved to the residual asked for.
const MOST_NEWTON: usize = 30;

/// Part of the load that may be out of balance in a body that is called at rest.
const RESTED: f64 = 1e-2;

/// A body under way.
struct Moving<'a> {
    model: &'a Model,
    laws: Laws,
    mass: Mass,
    u: Vec<[f64; 3]>,
    /// Velocity of the free rows, m/s.
    v: Vec<[f64; 3]>,
    /// The matrix of the last system, whose memory the next one takes.
    spare: Option<Tangent>,
}

impl Model {
    /// The motion from rest under the full loads, until the body rests or the steps run out.
    ///
    /// # Errors
    /// [`FemError::NoMotion`] when a step has no solution, however short its Newton step.
    pub fn run(&self, materials: &Materials, progress: &dyn Fn(&Progress)) -> Result<Outcome, FemError> {
        let settings = &self.scenario.dynamics;
        let laws = self.laws(materials)?;
        let mass = Mass::new(self);
        let mut u = vec![[0.0; 3]; self.nodes_m.len()];
        self.move_prescribed(&mut u, 1.0);
        let v = vec![[0.0; 3]; self.free_nodes()];
        let mut body = Moving { model: self, laws, mass, u, v, spare: None };
        let mut solver = solver::for_model(self, largest_ratio(materials));
        let mut record = ConvergenceRecord::default();
        let mut motion = Motion::default();
        let h = settings.time_step_s;
        for step in 1..=settings.steps {
            body.step(solver.as_mut(), &mut record).map_err(|stuck| {
                let state = self.body.state(&body.u, &body.laws);
                let worst = worst(&state);
                let time_s = (step - 1) as f64 * h;
                FemError::NoMotion { time_s, reason: stuck.to_owned(), cell: worst, jacobian: state[worst][1] }
            })?;
            let fastest = body.v.iter().map(|v| v.iter().map(|x| x * x).sum::<f64>()).fold(0.0, f64::max).sqrt();
            motion.steps = step;
            motion.time_s = step as f64 * h;
            motion.fastest_mm_per_s = fastest / METRES_PER_MM;
            // Much damping or a short step make anything slow: what rests is also in balance.
            motion.rested = motion.fastest_mm_per_s <= settings.rest_speed_mm_per_s
                && self.out_of_balance_share(&body.u, &body.laws).1 <= RESTED;
            if settings.keep_every > 0 && step % settings.keep_every == 0 {
                motion.frames.push(Frame { time_s: motion.time_s, displacement_mm: self.to_mesh_mm(&body.u) });
            }
            progress(&Progress {
                fraction: step as f64 / settings.steps as f64,
                iteration: step,
                relative_residual: motion.fastest_mm_per_s,
                goal: settings.rest_speed_mm_per_s,
            });
            if motion.rested {
                break;
            }
        }
        let (forces, share) = self.out_of_balance_share(&body.u, &body.laws);
        record.relative_residual = share;
        let mut outcome = self.outcome(&body.u, &forces, &body.laws, record);
        if !motion.rested {
            let Motion { steps, time_s, fastest_mm_per_s, .. } = motion;
            outcome.warnings.push(FemWarning::StillMoves { steps, time_s, fastest_mm_per_s });
        }
        outcome.motion = Some(motion);
        Ok(outcome)
    }

    /// The internal forces at a state, N, and how much is out of balance there, over the loads (where there are none, over the
    /// internal forces).
    fn out_of_balance_share(&self, u: &[[f64; 3]], laws: &Laws) -> (Vec<[f64; 3]>, f64) {
        let mut forces = vec![[0.0; 3]; u.len()];
        self.internal_forces(u, laws, &mut forces);
        let size = reduce::norm(&self.out_of_balance(&forces, 1.0));
        let load = reduce::norm(&self.free_part(&self.load_n));
        let scale = if load > 0.0 { load } else { reduce::norm(&forces) };
        (forces, if scale > 0.0 { size / scale } else { size })
    }
}

impl Moving<'_> {
    /// One time step.
    fn step(
        &mut self,
        solver: &mut dyn linear::LinearSolver,
        record: &mut ConvergenceRecord,
    ) -> Result<(), &'static str> {
        let settings = &self.model.scenario.dynamics;
        let (h, goal) = (settings.time_step_s, self.model.scenario.solver.relative_residual);
        let [mass_damping, stiffness_damping] = [settings.mass_damping_per_s, settings.stiffness_damping_s];
        let (fixed_count, most) = match settings.newton_iterations {
            0 => (false, MOST_NEWTON),
            n => (true, n),
        };
        let mass_factor = 1.0 / (h * h) + mass_damping / h;
        let momentum = self.mass.product(&self.v.iter().map(|v| v.map(|x| x / h)).collect::<Vec<_>>());
        let mut reference = reduce::norm(&self.model.free_part(&self.model.load_n)) + reduce::norm(&momentum);
        // Displacement of the step on the free rows.
        let mut moved = vec![[0.0; 3]; self.v.len()];
        let mut forces = vec![[0.0; 3]; self.u.len()];
        let mut at_start: Option<Tangent> = None;
        let mut spare = self.spare.take();
        for iteration in 0..=most {
            let mut now = self.u.clone();
            self.model.add_free(&mut now, 1.0, &moved);
            let mut first = Some(self.model.tangent_of_body(&now, &self.laws, &mut forces, false, spare.take()));
            // Damping by stiffness is the tissue's: a wall that damped would hold what leaves it.
            self.model.supports.add_forces(&now, &self.model.nodes_m, self.laws.walls_softer, &mut forces);
            let mut rhs = self.model.out_of_balance(&forces, 1.0);
            add(&mut rhs, 1.0, &momentum);
            if let Some(start) = &at_start {
                add(&mut rhs, -mass_factor, &self.mass.product(&moved));
                let mut damped = vec![[0.0; 3]; moved.len()];
                start.product(&moved, &mut damped);
                add(&mut rhs, -stiffness_damping / h, &damped);
            }
            self.model.clear_held(&mut rhs);
            let size = reduce::norm(&rhs);
            if !size.is_finite() {
                return Err(INSIDE_OUT);
            }
            // What moves the body may be nothing but moved nodes: then the measure is what that stirs up.
            if iteration == 0 && !self.model.prescribed.is_empty() {
                reference = reference.max(reduce::norm(&forces));
            }
            let relative = if reference > 0.0 { size / reference } else { 0.0 };
            if iteration == most || (!fixed_count && relative <= goal) || size == 0.0 {
                if !fixed_count && relative > goal && iteration == most {
                    return Err("Newton's method ran out of iterations");
                }
                break;
            }
            let finest = if fixed_count { goal.sqrt() } else { (0.1 * goal / relative).clamp(1e-10, 1e-3) };
            let mut report = linear::LinearReport::default();
            let mut change = vec![[0.0; 3]; rhs.len()];
            let mut kept = None;
            for project in [false, true] {
                let tangent = first.take();
                let tangent = tangent.unwrap_or_else(|| {
                    let mut again = vec![[0.0; 3]; forces.len()];
                    self.model.tangent_of_body(&now, &self.laws, &mut again, project, spare.take())
                });
                let mut system = if fixed_count && most == 1 {
                    self.mass.plus(mass_factor, tangent, 1.0 + stiffness_damping / h)
                } else {
                    let sum = tangent.plus(stiffness_damping / h, at_start.as_ref().unwrap_or(&tangent));
                    kept = Some(tangent);
                    self.mass.plus(mass_factor, sum, 1.0)
                };
                self.model.add_stiffness_of_supports(&now, self.laws.walls_softer, project, &mut system);
                solver.prepare(&system);
                report = if iteration == 0 {
                    self.solve_along_velocity(solver, &system, &rhs, &mut change, finest)
                } else {
                    solver.solve(&system, &rhs, &mut change, Within::Residual(finest))
                };
                spare = Some(system);
                if !report.negative_curvature {
                    break;
                }
            }
            // Only as far as every element keeps a finite energy.
            let mut length = 1.0;
            loop {
                let mut trial = now.clone();
                self.model.add_free(&mut trial, length, &change);
                if self.model.energy(&trial, &self.laws).is_finite() {
                    break;
                }
                length *= 0.5;
                if length < 1e-6 {
                    return Err(INSIDE_OUT);
                }
            }
            add(&mut moved, length, &change);
            record.iterations.push(NewtonIteration {
                load_factor: 1.0,
                relative_residual: relative,
                linear_iterations: report.iterations,
                step_length: length,
                projected: report.negative_curvature,
            });
            if fixed_count && iteration + 1 == most {
                break;
            }
            if at_start.is_none() {
                at_start = kept;
            }
        }
        self.spare = spare;
        self.model.add_free(&mut self.u, 1.0, &moved);
        for (v, m) in self.v.iter_mut().zip(&moved) {
            *v = m.map(|x| x / h);
        }
        Ok(())
    }

    /// Solves for the displacement of a step from the best multiple of the velocity: with damping by stiffness all modes
    /// slow down at nearly one rate, and little is left to iterate for (on brain5k 48 iterations a step, 85 from zero).
    fn solve_along_velocity(
        &self,
        solver: &mut dyn linear::LinearSolver,
        system: &Tangent,
        rhs: &[[f64; 3]],
        change: &mut [[f64; 3]],
        tolerance: f64,
    ) -> linear::LinearReport {
        let mut image = vec![[0.0; 3]; rhs.len()];
        system.product(&self.v, &mut image);
        // The multiple with the least error in the norm of the system, as of the first step of conjugate gradients.
        let multiple = reduce::dot(&self.v, rhs) / reduce::dot(&self.v, &image);
        if !(multiple.is_finite() && multiple > 0.0) {
            return solver.solve(system, rhs, change, Within::Residual(tolerance));
        }
        let mut rest = rhs.to_vec();
        add(&mut rest, -multiple, &image);
        let left = reduce::norm(&rest) / reduce::norm(rhs);
        let report = solver.solve(system, &rest, change, Within::Residual((tolerance / left).min(0.5)));
        add(change, multiple, &self.v);
        report
    }
}

fn add(a: &mut [[f64; 3]], factor: f64, b: &[[f64; 3]]) {
    a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += factor * b);
}

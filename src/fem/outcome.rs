//! What a simulation answers.

use super::contact::{ContactOutcome, TetherOutcome};
use super::element::Laws;
use super::measured::outside_measured;
use super::model::Model;
use super::warning::FemWarning;
use serde::{Deserialize, Serialize};

/// A deformed state; nodes and cells numbered as in the mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Displacement of every node, mm.
    pub displacement_mm: Vec<[f64; 3]>,
    /// Force that keeps every held or moved node where it is told to be, N; zero elsewhere. What walls and springs do is told by
    /// `contact` and `tethers`: with these it balances the loads.
    pub reaction_n: Vec<[f64; 3]>,
    /// Volume ratio of every cell.
    pub jacobian: Vec<f64>,
    /// Stored energy per undeformed volume of every cell, Pa.
    pub strain_energy_density_pa: Vec<f64>,
    /// What every wall does; none without walls.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<ContactOutcome>,
    /// Pressure of walls on every node, Pa; empty without walls.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact_pressure_pa: Vec<f64>,
    /// What the springs of every entry do; none without springs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tethers: Vec<TetherOutcome>,
    /// How it was found.
    pub convergence: ConvergenceRecord,
    /// How it moved there; absent in statics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// What the reader should know.
    pub warnings: Vec<FemWarning>,
}

/// A motion from rest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Time steps taken.
    pub steps: usize,
    /// Time at the end, s.
    pub time_s: f64,
    /// The body came to rest.
    pub rested: bool,
    /// Speed of the fastest node at the end, mm/s.
    pub fastest_mm_per_s: f64,
    /// States along the way, as asked for by `dynamics.keep_every`.
    pub frames: Vec<Frame>,
}

/// A state of a motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Time, s.
    pub time_s: f64,
    /// Displacement of every node, mm.
    pub displacement_mm: Vec<[f64; 3]>,
}

/// Newton's way to the solution.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ConvergenceRecord {
    /// Every Newton iteration, also of load steps that were given up.
    pub iterations: Vec<NewtonIteration>,
    /// Parts of the load at which equilibrium was found.
    pub load_steps: Vec<f64>,
    /// Out-of-balance force over applied force at the end.
    pub relative_residual: f64,
    /// The cell with the smallest volume ratio at the end.
    #[serde(default)]
    pub worst_cell: usize,
    /// Its volume ratio.
    #[serde(default)]
    pub worst_volume_ratio: f64,
}

impl ConvergenceRecord {
    /// All iterations of the linear solver.
    pub fn linear_iterations(&self) -> usize {
        self.iterations.iter().map(|i| i.linear_iterations).sum()
    }
}

/// One Newton iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NewtonIteration {
    /// Part of the load.
    pub load_factor: f64,
    /// Out-of-balance force over applied force before the step.
    pub relative_residual: f64,
    /// Iterations of the linear solver.
    pub linear_iterations: usize,
    /// Part of the Newton step taken.
    pub step_length: f64,
    /// The tangent was not positive definite and was projected.
    pub projected: bool,
}

/// What a progress display may show.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Part of the load, or of the time.
    pub fraction: f64,
    /// Newton iterations (statics) or time steps (dynamics) so far.
    pub iteration: usize,
    /// Out-of-balance force over applied force.
    pub relative_residual: f64,
    /// What is asked for.
    pub goal: f64,
}

impl Model {
    /// The answer at a state: u in m, internal forces in N.
    pub(super) fn outcome(
        &self,
        u: &[[f64; 3]],
        forces: &[[f64; 3]],
        laws: &Laws,
        convergence: ConvergenceRecord,
    ) -> Outcome {
        let state = self.body.state(u, laws);
        let reaction = |n: usize| {
            let new = self.number[n] as usize;
            let held = self.held_of_row(self.row_of[new]);
            [0, 1, 2].map(|i| if held[i] { forces[new][i] - self.load_n[new][i] } else { 0.0 })
        };
        let mut reaction_n: Vec<[f64; 3]> = (0..self.corners).map(reaction).collect();
        // The mesh has no mid-edge nodes: half of what holds one at either end has the same sum and the same moment.
        for (k, ends) in self.edges.iter().enumerate() {
            let middle = reaction(self.corners + k);
            for &end in ends {
                (0..3).for_each(|i| reaction_n[end as usize][i] += 0.5 * middle[i]);
            }
        }
        let density: Vec<f64> = state.iter().map(|s| s[2]).collect();

        let worst_cell = worst(&state);
        let convergence = ConvergenceRecord { worst_cell, worst_volume_ratio: state[worst_cell][1], ..convergence };
        let mut warnings = self.warnings.clone();
        let inverted = state.iter().filter(|s| s[1] <= 0.0).count();
        if inverted > 0 {
            warnings.push(FemWarning::InsideOut { cells: inverted, worst: worst_cell });
        }
        let crushed = state.iter().filter(|s| (0.0..0.1).contains(&s[1])).count();
        if crushed > 0 {
            warnings.push(FemWarning::Squeezed { cells: crushed });
        }
        warnings.extend(outside_measured(&*self.body, &self.names, u, laws));
        let (contact, pressure) = self.supports.outcome(u, &self.nodes_m);
        Outcome {
            contact_pressure_pa: if contact.is_empty() { Vec::new() } else { self.at_corners(&pressure) },
            contact,
            tethers: self.supports.outcome_of_tethers(u),
            displacement_mm: self.to_mesh_mm(u),
            reaction_n,
            jacobian: state.iter().map(|s| s[0]).collect(),
            strain_energy_density_pa: density,
            convergence,
            motion: None,
            warnings,
        }
    }

    /// What nodes of the solver hold, on those of the mesh: where a corner holds nothing of its own (the area of a quadratic face
    /// lies on its mid-edge nodes alone), the mean over the edges that end there.
    fn at_corners(&self, held: &[Option<f64>]) -> Vec<f64> {
        let of = |n: usize| held[self.number[n] as usize];
        let mut sums = vec![(0.0, 0usize); self.corners];
        for (k, ends) in self.edges.iter().enumerate() {
            let Some(value) = of(self.corners + k) else { continue };
            for &end in ends {
                let (sum, count) = &mut sums[end as usize];
                (*sum, *count) = (*sum + value, *count + 1);
            }
        }
        (0..self.corners).zip(sums).map(|(n, (sum, count))| of(n).unwrap_or(sum / count.max(1) as f64)).collect()
    }
}

/// The cell with the smallest volume ratio.
pub(super) fn worst(state: &[[f64; 3]]) -> usize {
    (0..state.len()).min_by(|&a, &b| state[a][1].total_cmp(&state[b][1])).unwrap_or(0)
}

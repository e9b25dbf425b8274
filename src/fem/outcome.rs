//! What a simulation answers.

use serde::{Deserialize, Serialize};

/// A deformed state; nodes and cells numbered as in the mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Displacement of every node, mm.
    pub displacement_mm: Vec<[f64; 3]>,
    /// Force the supports exert on every held node, N; zero elsewhere.
    pub reaction_n: Vec<[f64; 3]>,
    /// Volume ratio of every cell.
    pub jacobian: Vec<f64>,
    /// Stored energy per undeformed volume of every cell, Pa.
    pub strain_energy_density_pa: Vec<f64>,
    /// How it was found.
    pub convergence: ConvergenceRecord,
    /// What the reader should know.
    pub warnings: Vec<String>,
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

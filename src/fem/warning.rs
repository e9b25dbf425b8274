//! What a reader of a simulation should know.

use super::element::ElementKind;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a reader of a simulation should know.
#[derive(Clone, Debug, PartialEq, Error, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum FemWarning {
    #[error(
        "{} locks at Poisson's ratio {poisson_ratio}: displacements come out too small; \
         `element = \"tet4-nodal\"` does not",
        element.name()
    )]
    Locks { element: ElementKind, poisson_ratio: f64 },
    #[error(
        "`[materials.{material}]` is not stable at the stretches it was measured at ({low} to {high}): {}; there may be \
         no equilibrium, or several",
        broken.join(", ")
    )]
    Unstable { material: String, low: f64, high: f64, broken: Vec<String> },
    #[error(
        "the body still moves after {steps} steps ({time_s:.3} s), up to {fastest_mm_per_s:.3e} mm/s: raise `dynamics.steps` or \
         the damping"
    )]
    StillMoves { steps: usize, time_s: f64, fastest_mm_per_s: f64 },
    #[error("{cells} cells are inside out, among them cell {worst}: lower the load or raise the modulus")]
    InsideOut { cells: usize, worst: usize },
    #[error("{cells} cells are squeezed below a tenth of their volume: treat stresses with care")]
    Squeezed { cells: usize },
}

//! What a reader of a simulation should know.

use super::element::ElementKind;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What acts on held nodes alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Idle {
    /// A wall.
    Contact,
    /// Springs.
    Tether,
    /// A force over a set.
    Patch,
    /// A pressure.
    Pressure,
}

impl Idle {
    fn words(self) -> &'static str {
        match self {
            Self::Contact => "wall (`contact`)",
            Self::Tether => "spring (`tethers`)",
            Self::Patch => "force (`loads.patch`)",
            Self::Pressure => "pressure (`loads.pressure`)",
        }
    }
}

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
    #[error(
        "the whole mesh is {size_mm:.3} mm across: coordinates are read as mm; a mesh in metres has to be scaled by 1000 first"
    )]
    Tiny { size_mm: f64 },
    #[error(
        "the tissue ({tissue} kg/m3) is lighter than the fluid of `loads.csf` ({fluid} kg/m3) and floats below its level: where a \
         fluid is given, `loads.density_kg_per_m3` is the tissue's own (about 1040), not an effective one"
    )]
    LighterThanFluid { tissue: f64, fluid: f64 },
    #[error(
        "the {} of set `{set}` has no effect: every node of it is held; take the set out of what is held, or leave the {0} out",
        idle.words()
    )]
    NoEffect { set: String, idle: Idle },
    #[error(
        "nothing loads the body, which stays as it is: give `loads.gravity_m_per_s2`, a force (`loads.patch`), a pressure \
         (`loads.pressure`) or a displacement (`prescribed`)"
    )]
    Unloaded,
    #[error(
        "the fluid of `loads.csf` has no effect without gravity: give `loads.gravity_m_per_s2`, or leave `loads.csf` out"
    )]
    FluidWithoutGravity,
    #[error(
        "`[dynamics]` has no effect on an equilibrium: write `method = \"backward-euler\"` into `[solver]` for a motion, or leave \
         `[dynamics]` out"
    )]
    StepsOfNoMotion,
    #[error(
        "{facets} facets of the mesh lie upon others without sharing their nodes, the first of them at ({:.1}, {:.1}, {:.1}) mm: nothing \
         holds the two sides together there; merge their nodes (gmsh: `Coherence Mesh`, ParaView: Clean to Grid), or, where a gap is \
         meant, name a set of both sides in `supports` or `contact`",
        at_mm[0], at_mm[1], at_mm[2]
    )]
    Unglued { facets: usize, at_mm: [f64; 3] },
    #[error(
        "volume {number} is called `{name}` in the mesh and taken for `{taken}`, by its number: give its number in the scenario's \
         `[labels]`"
    )]
    CalledOtherwise { number: u8, name: String, taken: String },
    #[error(
        "{nodes} of the {of} nodes of set `{set}`, which is moved in `prescribed`, are held by another set and stay: where that is not \
         meant, take them out of one of the two"
    )]
    StaysHeld { set: String, nodes: usize, of: usize },
    #[error(
        "`[materials.{material}]` was measured at stretches of {low} to {high}, and {cells} of its {of} cells are stretched to \
         {least:.3} to {most:.3} of their length: beyond what was measured its law is a guess; give a model that was measured there"
    )]
    OutsideMeasured { material: String, cells: usize, of: usize, least: f64, most: f64, low: f64, high: f64 },
    #[error(
        "a piece of {cells} cells, among them cell {cell}, hangs on to the rest by an edge or a corner alone: only the wall before it \
         keeps it from turning; hold a set of it in `fixed`, or mesh the body so that it shares whole facets with the rest"
    )]
    Hinged { cells: usize, cell: usize },
    #[error("{cells} cells are inside out, among them cell {worst}: lower the load or raise the modulus")]
    InsideOut { cells: usize, worst: usize },
    #[error("{cells} cells are squeezed below a tenth of their volume: treat stresses with care")]
    Squeezed { cells: usize },
}

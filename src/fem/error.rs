//! Why a simulation was refused or ended without an answer.

use crate::material::law::MaterialError;
use crate::mesh::TetMesh;
use thiserror::Error;

/// Why a simulation was refused or ended without an answer. All but [`FemError::NoEquilibrium`] and
/// [`FemError::NoMotion`] are input errors.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum FemError {
    #[error("there is no set `{set}` in the mesh; it has: {known}. Write one of these, or tag the mesh")]
    UnknownSet { set: String, known: String },
    #[error("set `{set}` is a set of facets, and one of nodes is asked for; the mesh has of these: {known}")]
    OfFacets { set: String, known: String },
    #[error("no node is held: the body would fall for ever. Name a node set of the mesh in `fixed`")]
    NothingHeld,
    #[error("set `{set}` is both {first} and {second}: take one of the two away")]
    TwoSupports { set: String, first: &'static str, second: &'static str },
    #[error(
        "`prescribed` of set `{set}` moves no component: name one of x, y and z at least in `components`, or take it away"
    )]
    NothingPrescribed { set: String },
    #[error(
        "sets `{first}` and `{second}` share nodes, among them node {node}, and `prescribed` moves them to different places: take these \
         nodes out of one of the two"
    )]
    TwoMovements { first: String, second: String, node: u32 },
    #[error(
        "the whole body lies at or beyond the plane before set `{set}`, by {least_mm:.1} mm and more: turn `wall.normal`, which points \
         to the side that is free, or move `wall.point_mm`"
    )]
    BeyondWall { set: String, least_mm: f64 },
    #[error(
        "nothing but springs holds the body, and they would give way by {give_mm:.3e} mm under its load, more than the body is large \
         ({size_mm:.0} mm): raise `tethers.stiffness_pa_per_mm`, or hold a set in `fixed`"
    )]
    WeakSprings { give_mm: f64, size_mm: f64 },
    #[error("set `{set}` is empty: nothing can be held by it; name another set, or tag the mesh again")]
    EmptySet { set: String },
    #[error("every node is held: there is nothing to compute; take a set out of `fixed`")]
    AllHeld,
    #[error(
        "cell {cell} has label {label}, which has no name: give it one in the scenario's `[labels]` table \
         (`grey_matter = {label}`)"
    )]
    UnnamedLabel { cell: usize, label: u8 },
    #[error("cell {cell} has label {label} (`{name}`), but the scenario has no `[materials.{name}]`; add it")]
    NoMaterial { cell: usize, label: u8, name: String },
    #[error(
        "cell {cell} has label {label}, but the mesh says by `fraction:` arrays what its cells are filled with, and there is none of \
         that label: write one (`{name}`), or take all `fraction:` arrays away so that every cell is of its label alone"
    )]
    NoFraction { cell: usize, label: u8, name: String },
    #[error("`[materials.{name}]`: `{name}` is no label: name its number in `[labels]` (`{name} = 1`)")]
    UnknownLabel { name: String },
    #[error("labels `{first}` and `{second}` have the same number {number} in `[labels]`; give each its own")]
    SameLabel { first: String, second: String, number: u8 },
    #[error("`[materials.{name}]`: {source}")]
    Material { name: String, source: MaterialError },
    #[error(
        "set `{set}` has no facet on the boundary: a force or pressure needs an area; name a facet set, or a node set \
         that holds whole facets of the surface"
    )]
    NoFacets { set: String },
    #[error(
        "{stray} of the {of} facets of set `{set}` are no facet of any cell, and would swallow part of its force or pressure: take them \
         out of the set, or mesh the body so that it conforms to them"
    )]
    StrayFacets { set: String, stray: usize, of: usize },
    #[error(
        "a pressure on set `{set}`, which lies within the body, has no side to push from: neighbours at the edge of nodes {} and {} \
         are turned to different sides; turn all its facets to one side, or name a set of the boundary",
        ends[0], ends[1]
    )]
    NoSide { set: String, ends: [u32; 2] },
    #[error(
        "set `{set}` cannot slide on both sides: it is no sheet of facets but has all four facets of cell {cell}; mesh the \
         body so that it conforms to the sheet, or hold the set in `fixed`"
    )]
    NoSheet { set: String, cell: usize },
    #[error(
        "the body cut open along set `{set}` leaves a piece of {cells} cells, among them cell {cell}, that hangs on to the rest by no \
         facet and is not held: hold a set of it in `fixed`, mesh the body with smaller cells there, or hold `{set}` as well"
    )]
    Floats { set: String, cells: usize, cell: usize },
    #[error(
        "the wall before set `{set}` is the field `{name}`, which a scenario file cannot hold; give the wall as \
         \"own-surface\" or \"plane\", or call the library with the field"
    )]
    NoField { set: String, name: String },
    #[error("`{key}` is {value}: it must be {rule}")]
    Setting { key: String, value: f64, rule: &'static str },
    #[error("part of the mesh ({nodes} nodes, among them node {node}) is held nowhere: fix a set there or remove it")]
    Loose { nodes: usize, node: usize },
    #[error("the displacement to start from has {found} nodes, the mesh {nodes}: take one from a run on the same mesh")]
    StartLength { found: usize, nodes: usize },
    #[error("the displacement to start from is not a finite number at node {node}: leave it out and start from rest")]
    StartNotFinite { node: usize },
    #[error(
        "a piece of {cells} cells, among them cell {cell}, hangs on to the rest by an edge or a corner alone and would turn about it: hold \
         a set of it in `fixed`, mesh the body so that it shares whole facets with the rest, or remove it"
    )]
    Hinged { cells: usize, cell: usize },
    #[error("there is no {what} to differentiate by: name a material of the scenario and a parameter of its law")]
    NoParameter { what: String },
    #[error(
        "the body is about to buckle at this state, so nothing can be said of how it depends on the moduli; lower the \
         load or raise the shear modulus"
    )]
    UnstableState,
    #[error(
        "how the body depends on its parameters could not be solved for at this state (a residual of {residual:.1e} is left): give a \
         Poisson's ratio farther from 0.5 or walls that are less stiff"
    )]
    NoSensitivity { residual: f64 },
    #[error(
        "the motion stops at {time_s:.4} s: {reason}; the worst element is cell {cell} (volume ratio {jacobian:.3}). \
         Shorten `dynamics.time_step_s` or lower the load"
    )]
    NoMotion { time_s: f64, reason: String, cell: usize, jacobian: f64 },
    #[error(
        "no equilibrium beyond {percent:.1} % of the load: {reason}; the worst element is cell {cell} \
         (volume ratio {jacobian:.3}). Lower the load, raise the shear modulus or repair the mesh there"
    )]
    NoEquilibrium { percent: f64, reason: String, cell: usize, jacobian: f64 },
}

impl FemError {
    /// Whether the input is at fault, not the physics.
    pub fn is_input(&self) -> bool {
        !matches!(
            self,
            Self::NoEquilibrium { .. } | Self::NoMotion { .. } | Self::UnstableState | Self::NoSensitivity { .. }
        )
    }

    /// Of a set of nodes that is not there; it may be there as one of facets.
    pub(super) fn unknown_nodes(mesh: &TetMesh, set: &str) -> Self {
        if !mesh.facet_sets.contains_key(set) {
            return Self::unknown_set(mesh, set);
        }
        let known: Vec<&str> = mesh.node_sets.keys().map(String::as_str).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        Self::OfFacets { set: set.to_owned(), known }
    }

    pub(super) fn unknown_set(mesh: &TetMesh, set: &str) -> Self {
        let mut known: Vec<&str> = mesh.node_sets.keys().chain(mesh.facet_sets.keys()).map(String::as_str).collect();
        known.sort_unstable();
        known.dedup();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        Self::UnknownSet { set: set.to_owned(), known }
    }
}

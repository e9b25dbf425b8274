//! Why there is no mesh.

use super::process::ProcessError;
use crate::mesh::tet_mesh::MeshError;
use thiserror::Error;

/// Why there is no mesh.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum EngineError {
    #[error("no voxel carries a label to mesh{}; check the label map", besides(without))]
    NoLabels { without: Vec<u8> },
    #[error(
        "the map holds {found} labels, {most} are meshed at most: say whose parcellation it is (it becomes grey matter, white \
         matter, fluid), join labels, or leave some out"
    )]
    TooManyLabels { found: usize, most: usize },
    #[error("`{name}` is {value:?}: it must be {rule}")]
    Setting { name: &'static str, value: f64, rule: &'static str },
    #[error(
        "[mesh.sizing] names label {label}, which is not meshed; name one of {present:?} \
         or drop it"
    )]
    NoSuchLabel { label: u8, present: Vec<u8> },
    #[error(
        "[mesh.sizing]: the factor at {place} {label} must be between {least} and \
         {most}, got {factor}"
    )]
    Factor { place: &'static str, label: u8, factor: f64, least: f64, most: f64 },
    #[error(
        "a target edge of {} mm would give about {cells:.1e} tetrahedra; the most is {most:.0e}; ask for a larger edge \
         or fewer cells",
        three_digits(*edge_mm)
    )]
    TooFine { edge_mm: f64, cells: f64, most: f64 },
    #[error(
        "engine `{engine}`: the labelled region near {centre_mm:.1?} mm ({volume_mm3:.1} mm3) is too small for \
         tetrahedra of {edge_mm:.2} mm; ask for more of them or a smaller edge"
    )]
    TooSmall { engine: &'static str, centre_mm: [f64; 3], volume_mm3: f64, edge_mm: f64 },
    #[error(
        "engine `{engine}` is not installed (no program {program} was found); install it or use \
         the engine `lattice`"
    )]
    Missing { engine: &'static str, program: &'static str },
    #[error("engine `{engine}`: {source}")]
    Program { engine: &'static str, source: ProcessError },
    #[error("engine `{engine}`: the result is not a valid mesh: {source}; use the engine `lattice`")]
    Invalid { engine: &'static str, source: MeshError },
}

/// What the settings take from the labels, in words; nothing where they take nothing.
fn besides(without: &[u8]) -> String {
    let labels: Vec<String> = without.iter().map(u8::to_string).collect();
    if labels.is_empty() { String::new() } else { format!(" besides those left out ({})", labels.join(", ")) }
}

/// A number with the digits that a reader wants.
fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

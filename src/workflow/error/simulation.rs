//! Why a mesh in a file cannot be simulated.

use super::input::InputError;
use crate::fem::FemError;
use crate::mesh::format::{ReadError, WriteError};
use std::path::PathBuf;
use thiserror::Error;

/// Why a mesh in a file cannot be simulated.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum SimulationError {
    #[error("{}: the name of a deformed state ends in .vtu", output.display())]
    Output { output: PathBuf },
    #[error("{name}: the name of a mesh ends in .vtu or .msh; convert the file first, for example with meshio")]
    MeshName { name: String },
    #[error("{name}: {reason}")]
    Scenario { name: String, reason: String },
    #[error("a motion (`method = \"backward-euler\"`) starts at rest: it takes no state to start from")]
    StartOfMotion,
    #[error(
        "{name}: cells {first} and {second} have the same nodes: their tissue would count twice; write each cell once"
    )]
    TwiceTheSameCell { name: String, first: usize, second: usize },
    #[error("{name}: no point array `displacement` of three components; give the result of a simulation")]
    NoDisplacement { name: String },
    #[error("{name}: has {found} nodes, the mesh {nodes}: give a result on the same mesh")]
    OtherMesh { name: String, found: usize, nodes: usize },
    #[error("{name}: node {node} (counted from 0) lies elsewhere than in the mesh: give a result on the same mesh")]
    OtherNodes { name: String, node: usize },
    #[error("{names}: {source}")]
    Fem { names: String, source: FemError },
    #[error("{name}: {source}")]
    Format { name: String, source: WriteError },
    #[error("`{field}` is not a finite number everywhere: the result is not written")]
    NotFinite { field: String },
    #[error("{file}: what another version of hgm noted about it cannot be read; make it again")]
    Noted { file: String },
    #[error(transparent)]
    Input(#[from] InputError),
    #[error(transparent)]
    Mesh(#[from] ReadError),
}

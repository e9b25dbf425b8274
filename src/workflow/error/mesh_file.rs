//! Why a label map in a file cannot be meshed.

use super::input::InputError;
use crate::mesh::format::WriteError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a label map in a file cannot be meshed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum MeshFileError {
    #[error("{}: the name of a mesh ends in .vtu, .msh, .inp or .feb", output.display())]
    Output { output: PathBuf },
    #[error(
        "{}: what lies within the cells (`partial_volume` of [mesh]) is kept by .vtu alone; write a .vtu, or set it to false",
        output.display()
    )]
    Fractions { output: PathBuf },
    #[error(
        "{}: its name says `space-MNI`, its header says coordinates of the scanner (code 1): boundary sets are to be made in MNI \
         space alone; say which of the two is right, or correct the name or the header",
        labels.display()
    )]
    NameOrHeader { labels: PathBuf },
    #[error("{file}: {source}")]
    Format { file: String, source: WriteError },
    #[error("{file}: what another version of hgm noted about it cannot be read; make it again")]
    Noted { file: String },
    #[error(transparent)]
    Input(#[from] InputError),
}

//! A label map of another tool that cannot be used.

use crate::anatomy::TsvError;
use crate::segment::{Disagreement, ImportError};
use thiserror::Error;

/// Why a label map of another tool cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum LabelMapError {
    #[error(
        "no label table is called {word}; choose {} or a table of your own (FILE.tsv with the columns index, name, tissue)",
        .known.join(", ")
    )]
    NoTable { word: String, known: Vec<&'static str> },
    #[error("{word}: {source}")]
    Table { word: String, source: TsvError },
    #[error("{name}: {source}")]
    Import { name: String, source: ImportError },
    #[error(
        "{name}: the number {code} is in no table and larger than 255; name the numbers in a table of your own (a .tsv file \
         with the columns index, name, tissue)"
    )]
    TooLarge { name: String, code: u32 },
    #[error(
        "{name}: only {percent:.0} % of its labels lie in the field of view of the pre-operative scan: it is not this scan's \
         map, or it was moved; give the map made from this scan"
    )]
    Elsewhere { name: String, percent: f64 },
    #[error("{name}: {source}")]
    OffScan { name: String, source: Disagreement },
}

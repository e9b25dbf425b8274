//! Why a prediction cannot be taken up by the pair that came after it.

use super::case::in_words;
use crate::artefact::Reason;
use std::path::PathBuf;
use thiserror::Error;

/// Why nothing of a prediction can be taken.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum TakenUpError {
    #[error("{}: no prediction, so that a pair can take nothing from it", folder.display())]
    NoPrediction { folder: PathBuf },
    #[error("{}: the prediction was made from another pre-operative scan than that of this pair", folder.display())]
    OtherScan { folder: PathBuf },
    #[error(
        "{}: the prediction has taken its scan apart otherwise than this pair would: {}",
        folder.display(), in_words(reasons)
    )]
    MadeOtherwise { folder: PathBuf, reasons: Vec<Reason> },
}

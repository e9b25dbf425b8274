//! Why a prediction cannot be compared with what was seen.

use std::path::PathBuf;
use thiserror::Error;

/// Why there is nothing to compare.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum EvaluateError {
    #[error("{}: a prediction, and nothing says what was seen afterwards", folder.display())]
    NothingSeen { folder: PathBuf },
    #[error("{}: nothing is given to hold against this case of two scans", folder.display())]
    NoLandmarks { folder: PathBuf },
    #[error("{}: no prediction, so that no later case can be held against it", folder.display())]
    NotAPrediction { folder: PathBuf },
    #[error("{}: no case of two scans, so that it shows nothing of what happened afterwards", folder.display())]
    NothingAfter { folder: PathBuf },
    #[error(
        "{} was made from another pre-operative scan than {}: another patient's, or another scan of the same; use the scan that the \
         prediction was made from for both",
        against.display(), prediction.display()
    )]
    OtherScan { prediction: PathBuf, against: PathBuf },
    #[error(
        "{} reads the pre-operative scan on another grid than {}, though the file is the same: make one of them again with the \
         settings `prefer` and `volume` of the other",
        against.display(), prediction.display()
    )]
    OtherGrid { prediction: PathBuf, against: PathBuf },
    #[error("{}: nowhere in the predicted tissue is the state `{state}` believed; look at its page", folder.display())]
    NowhereSeen { folder: PathBuf, state: String },
    #[error("{file}: landmarks of a later scan, and nothing says how that scan lies to the one before")]
    NoPose { file: String },
    #[error(
        "{file}: not one landmark lies in or beside the brain that was predicted; landmarks are in their scanners' frames (mm, RAS+)"
    )]
    NoLandmark { file: String },
}

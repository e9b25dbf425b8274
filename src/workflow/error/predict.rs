//! Why no prediction can be made.

use crate::experiment::predict::PlannedError;
use std::path::PathBuf;
use thiserror::Error;

/// Why no prediction can be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum PredictError {
    #[error(transparent)]
    Plan(#[from] PlannedError),
    #[error("nothing is said of what is to be taken: give a mask in the scan's grid, or an ellipsoid")]
    NoPlan,
    #[error("`{given}` is no ellipsoid: give six numbers x,y,z,rx,ry,rz (mm, scanner, RAS+), the half axes above 0")]
    Ellipsoid { given: String },
    #[error("{file}: holds no point; give the targets as .csv (x,y,z in mm, RAS+), .fcsv or .mrk.json")]
    NoTarget { file: String },
    #[error(
        "{file}: target {target} at ({:.1}, {:.1}, {:.1}) mm lies outside the head; targets are in the pre-operative scanner's frame \
         (mm, RAS+): correct it or take it away",
        at_mm[0], at_mm[1], at_mm[2]
    )]
    TargetOutside { file: String, target: usize, at_mm: [f64; 3] },
    #[error(
        "the brain finds no equilibrium under these loads, however it is supported ({reason}); lower `density_kg_per_m3` in the \
         table [resection] or the part that has drained"
    )]
    NoEquilibrium { reason: String },
    #[error("{}: {file} is not there: an earlier version has made this prediction", folder.display())]
    NoDraws { folder: PathBuf, file: String },
}

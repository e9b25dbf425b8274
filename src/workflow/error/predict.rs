//! Why no prediction can be made.

use crate::experiment::predict::{Head, LevelError, PlannedError, TaughtError};
use crate::experiment::setting::SettingError;
use crate::mesh::OpenSurface;
use std::path::PathBuf;
use thiserror::Error;

/// Why no prediction can be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum PredictError {
    #[error(transparent)]
    Plan(#[from] PlannedError),
    #[error(transparent)]
    Loads(#[from] SettingError),
    #[error(transparent)]
    Taught(#[from] TaughtError),
    #[error(
        "`poisson_ratio` of the table [resection] is 0, and Poisson's ratio is to be drawn around it (`poisson_log_sd` of the table [predict]): \
         give one above 0, or leave that out"
    )]
    RatioAtEnd,
    #[error(transparent)]
    Level(#[from] LevelError),
    #[error("nothing is said of what is to be taken: give a mask in the scan's grid, or an ellipsoid")]
    NoPlan,
    #[error("`{given}` is no ellipsoid: give six numbers x,y,z,rx,ry,rz (mm, scanner, RAS+), the half axes above 0")]
    Ellipsoid { given: String },
    #[error(
        "`{given}` is no label: give whole numbers above 0 as the label map has them, with commas between (1010,1011)"
    )]
    Label { given: String },
    #[error("{plan}: there is no label map to take it from; give one made of this scan")]
    NoLabelMap { plan: String },
    #[error("{file}: not one voxel has the {plan}; it holds {}", holds.join(", "))]
    NoSuchLabel { file: String, plan: String, holds: Vec<String> },
    #[error(
        "{file}: a drawing without triangles: give a surface (.stl, .surf.gii, .ply), or a mask in the scan's grid (.nii, .nii.gz)"
    )]
    NoSurface { file: String },
    #[error(
        "{file}: surfaces of this kind are not read: save it as .stl, .ply or .surf.gii (mm, RAS+), or give a mask (.nii, .nii.gz)"
    )]
    OtherSurface { file: String },
    #[error(
        "{file}: {source}; close it (3D Slicer: Surface Toolbox, Fill Holes; MeshLab: Close Holes), or give a mask"
    )]
    OpenSurface { file: String, source: OpenSurface },
    #[error(
        "{plan}: within the scan it is empty: no voxel's centre lies inside; places are in mm of the scanner's frame (RAS+), correct place \
         and size"
    )]
    NoVoxel { plan: String },
    #[error(
        "{plan}: {percent:.0} % of it lie outside the scan; places are in mm of the scanner's frame (RAS+): check that it was drawn on this \
         scan"
    )]
    BesideScan { plan: String, percent: f64 },
    #[error("{}: the case of one plan, and a folder for several is asked for", folder.display())]
    OnePlan { folder: PathBuf },
    #[error("{}: the folder of several plans, and one is given", folder.display())]
    SeveralPlans { folder: PathBuf },
    #[error("the heads {first} and {second} lie in one way: leave one of them out")]
    OneHead { first: Head, second: Head },
    #[error("{plan} is given twice")]
    Twice { plan: String },
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
         table [resection] or the part that has drained, or raise the fluid's level"
    )]
    NoEquilibrium { reason: String },
    #[error("{}: {file} is not there: an earlier version has made this prediction", folder.display())]
    NoDraws { folder: PathBuf, file: String },
}

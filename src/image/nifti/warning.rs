//! What was odd about a file that is read all the same.

use super::error::NiftiProblem;
use super::which::Orientation;
use thiserror::Error;

/// Something odd about a file that is read all the same; without the file's name.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum NiftiWarning {
    #[error("the mask holds fractions; voxels above {half} are inside")]
    SoftMask { half: f32 },
    #[error("bitpix is {bitpix}, datatype {datatype} has {of_datatype}; datatype is believed")]
    Bits { bitpix: i32, datatype: i32, of_datatype: usize },
    #[error("{voxels} voxels are NaN or infinite and were set to 0")]
    NotFinite { voxels: usize },
    #[error("intensities begin at {floor:.4}, below zero: they are counted from there")]
    BelowZero { floor: f64 },
    #[error(
        "the intensities are much {} than a scanner's: they are read {factor:.3e} times as large, in the files of T1 images as well",
        if *factor > 1.0 { "smaller" } else { "larger" }
    )]
    UnusualUnit { factor: f64 },
    #[error("pixdim[{field}] is negative; its absolute value is taken")]
    NegativeSpacing { field: usize },
    #[error("xyzt_units says {unit}; the numbers are taken as millimetres")]
    Unit { unit: &'static str },
    #[error("{used} is used as asked; {problem}")]
    OtherIsBroken { used: Orientation, problem: NiftiProblem },
    #[error(
        "sform and qform differ by up to {difference_mm:.3} mm; {used} is {}",
        if *asked { "used as asked" } else { "used" }
    )]
    OrientationsDiffer { difference_mm: f64, used: Orientation, asked: bool },
    #[error("pixdim[{field}] is {stated_mm} mm, {used} says {size_mm:.4} mm; {used} is used")]
    Spacing { field: usize, stated_mm: f64, size_mm: f64, used: Orientation },
    #[error("{used}: the voxel axes are {skew_deg:.2} degrees from perpendicular")]
    Skewed { used: Orientation, skew_deg: f64 },
}

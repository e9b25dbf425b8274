//! Why two images could not be registered.

use thiserror::Error;

/// Why two images could not be registered.
#[derive(Debug, Error, PartialEq)]
pub enum RegisterError {
    /// A voxel is NaN or infinite.
    #[error("the {which} image has {count} voxels that are not finite: replace them (for example by 0) first")]
    NotFinite {
        /// "moving" or "fixed".
        which: &'static str,
        /// How many voxels.
        count: usize,
    },
    /// All voxels are alike.
    #[error("the {which} image is constant ({value}): there is nothing to register; give the T1 image itself")]
    Constant {
        /// "moving" or "fixed".
        which: &'static str,
        /// The value.
        value: f32,
    },
    /// Too small to hold a head.
    #[error(
        "the {which} image has {} x {} x {} voxels: registration needs at least 8 along each axis", dims[0], dims[1], dims[2]
    )]
    TooSmall {
        /// "moving" or "fixed".
        which: &'static str,
        /// Voxels along each axis.
        dims: [usize; 3],
    },
    /// A mask has no voxel inside.
    #[error("the mask of the {which} image is empty: leave it out or give one with voxels inside")]
    EmptyMask {
        /// "moving" or "fixed".
        which: &'static str,
    },
    /// A setting has no meaning.
    #[error("rigid registration: `{name}` is {value}: it must be {rule}")]
    Setting {
        /// The setting's name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// No resolution to register at.
    #[error(
        "`levels_mm` of the rigid registration is empty: give one or more resolutions between 0 and 16 mm, such as \
         [4.0, 2.0, 1.0]"
    )]
    NoLevels,
    /// The images do not overlap at any pose tried.
    #[error("no pose was found at which the images share information: are both T1 images of a head?")]
    NoOverlap,
    /// The head has another size in the two scans.
    #[error(
        "the head is {percent:.1} % {} in the fixed image than in the moving one from {along} (voxel axis {axis} of the moving \
         image; up to {most} % are taken for one head): the voxel size or slice spacing in one of the headers is wrong (slices with a gap between them lie \
         their thickness and the gap apart); compare both headers with the scanner's protocol and convert that scan again",
        if *longer { "longer" } else { "shorter" }
    )]
    OtherSize {
        /// How much longer or shorter, percent.
        percent: f64,
        /// The fixed image's head is the longer one.
        longer: bool,
        /// Where the axis runs in the head.
        along: &'static str,
        /// The moving image's voxel axis along which they differ most: i, j or k.
        axis: char,
        /// What is taken for one head, percent.
        most: f64,
    },
    /// No pose makes a head of it.
    #[error(
        "no pose was found at which the image looks like a head (likeness {likeness:.2}, at least {least:.2} is needed): it must \
         be a T1-weighted scan that shows most of the brain; where it is one its header has it upside down, or its voxel size is \
         wrong: check both in a viewer"
    )]
    NoHead {
        /// Mean local correlation with the mean head at the best pose.
        likeness: f64,
        /// What is needed.
        least: f64,
    },
}

//! Rigid registration of two images of one head, or of a head and a template.

mod error;
mod fit;
mod quality;
mod settings;
mod side;
mod size;
#[cfg(test)]
mod tests;

pub use error::RegisterError;
pub use quality::{FitQuality, FitWarning};
pub use settings::RigidSettings;
pub use size::RelativeSize;

use crate::geometry::{Frame, Native, RigidTransform};
use crate::image::{Mask, Volume};
use crate::register::mutual_information::Pose;
use fit::{fit, fit_near};
use nalgebra::{Rotation3, UnitQuaternion};
use side::Side;
pub(super) use side::side;

/// Where the images count; `None` lets the head itself decide.
#[derive(Clone, Copy, Debug)]
pub struct RigidMasks<'a, M: Frame, F: Frame> {
    /// Region of the moving image.
    pub moving: Option<&'a Mask<M>>,
    /// Region of the fixed image.
    pub fixed: Option<&'a Mask<F>>,
}

impl<M: Frame, F: Frame> Default for RigidMasks<'_, M, F> {
    fn default() -> Self {
        Self { moving: None, fixed: None }
    }
}

/// The transform found and how far it can be trusted.
#[derive(Clone, Debug)]
pub struct RigidFit<M: Frame, F: Frame> {
    /// Maps a point of the moving image to the fixed image.
    pub fixed_from_moving: RigidTransform<M, F>,
    /// Figures behind the verdict.
    pub quality: FitQuality,
    /// What a person should look at.
    pub warnings: Vec<FitWarning>,
}

/// Finds the rigid motion that takes the moving image onto the fixed one.
///
/// Mattes' mutual information (Mattes et al. 2003) of the two images over the head with its skull, or inside the masks,
/// by a quasi-Newton search at 4, 2 and 1 mm, after a search over starting poses at 8 mm around aligned centres (turns to
/// 30 degrees, shifts to 60 mm). Values are read by smoothing B-splines off the voxel grid; along slices 1.5 times
/// thicker than the other image's voxels that image is averaged over the slice's thickness. Outside its field of view an
/// image is unknown. The result is the same on any number of threads.
///
/// Stripped scans have no second fit without the cavity's side: where the whole brain sags it is no better
/// (docs/evidence/choices.md).
///
/// # Errors
/// [`RegisterError`] when an image holds no information or the settings are out of range.
pub fn register_rigid<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    fixed: &Volume<f32, F>,
    masks: RigidMasks<'_, M, F>,
    settings: &RigidSettings,
) -> Result<RigidFit<M, F>, RegisterError> {
    settings.check()?;
    let moving = side("moving", moving, masks.moving)?;
    let fixed = side("fixed", fixed, masks.fixed)?;
    let sample_moving = is_moving_sampled(&moving, &fixed);
    let (sampled, other) = if sample_moving { (&moving, &fixed) } else { (&fixed, &moving) };
    let (pose, mut quality, linear) = fit(sampled, other, settings)?;
    // The part that a mask names may change its size; the head does not.
    if moving.mask.is_none() && fixed.mask.is_none() {
        let linear = if sample_moving { Some(linear) } else { linear.try_inverse() };
        quality.size = linear.map(|linear| RelativeSize::of(&linear, &moving));
    }
    let other_from_sampled = transform_of(&pose);
    let fixed_from_moving = if sample_moving { other_from_sampled } else { other_from_sampled.inverse() };
    Ok(RigidFit { fixed_from_moving: fixed_from_moving.relabelled(), quality, warnings: quality.warnings() })
}

/// The rigid motion near one that is known already, from the moving to the fixed image, at the finest resolution.
pub(super) fn refine_rigid(
    moving: &Volume<f32, Native>,
    fixed: &Volume<f32, Native>,
    near: &RigidTransform<Native, Native>,
    settings: &RigidSettings,
) -> Result<RigidTransform<Native, Native>, RegisterError> {
    let (moving, fixed) = (side("moving", moving, None)?, side("fixed", fixed, None)?);
    Ok(if is_moving_sampled(&moving, &fixed) {
        transform_of(&fit_near(&moving, &fixed, near, settings)?)
    } else {
        transform_of(&fit_near(&fixed, &moving, &near.inverse(), settings)?).inverse()
    })
}

/// The image with the thicker slices is sampled: its slices can be read as they are, and the finer image can be averaged over
/// their thickness. A mask names the region to sample, so it wins over a small difference.
fn is_moving_sampled(moving: &Side, fixed: &Side) -> bool {
    let thickness = |s: &Side| s.image.grid.spacing_mm().into_iter().fold(0.0, f64::max);
    let ratio = thickness(moving) / thickness(fixed);
    if fixed.mask.is_some() && moving.mask.is_none() { ratio > 2.0 } else { ratio > 1.2 }
}

/// From the sampled image to the other one.
fn transform_of(pose: &Pose) -> RigidTransform<Native, Native> {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(pose.linear));
    RigidTransform::new(rotation, pose.target - rotation * pose.centre)
}

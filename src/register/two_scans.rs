//! Two scans of one head, each through a coil of its own.
//!
//! Mutual information takes a slow change of brightness for anatomy: between scans of two coils, or of one acquisition with and
//! without the scanner's normalisation, the best pose is off by tenths of a millimetre, and where a brain has sagged within a skull
//! that has not moved it follows the brain more than it has to (docs/evidence/choices.md). So the pose that the scans have as they
//! come is found again without either coil's gain.

use super::gain::{on_the_gain_of, without_gain};
use super::rigid::refine_rigid;
use super::{RegisterError, RigidFit, RigidMasks, RigidSettings, register_rigid};
use crate::geometry::{Frame, Native, RigidTransform};
use crate::image::Volume;

/// Finds the rigid motion that takes one scan of a head onto another one, whatever the coils: [`register_rigid`] over the whole
/// head, then [`register_two_scans_near`] from there. Quality and warnings are those of the scans as they come.
///
/// # Errors
/// As [`register_rigid`]; [`RegisterError::OtherSize`] for scans in which the head has two sizes.
pub fn register_two_scans<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    fixed: &Volume<f32, F>,
    settings: &RigidSettings,
) -> Result<RigidFit<M, F>, RegisterError> {
    let found = register_rigid(moving, fixed, RigidMasks::default(), settings)?;
    found.quality.check_size(settings.largest_size_difference_percent)?;
    let fixed_from_moving = register_two_scans_near(moving, fixed, &found.fixed_from_moving, settings)?;
    Ok(RigidFit { fixed_from_moving, ..found })
}

/// The rigid motion that takes one scan of a head onto another one, near one that is known: found at the finest step of the settings
/// alone, without the scans' gains.
///
/// # Errors
/// As [`register_rigid`].
pub fn register_two_scans_near<M: Frame, F: Frame>(
    moving: &Volume<f32, M>,
    fixed: &Volume<f32, F>,
    near: &RigidTransform<M, F>,
    settings: &RigidSettings,
) -> Result<RigidTransform<M, F>, RegisterError> {
    let start: RigidTransform<Native, Native> = near.relabelled();
    let (moving, fixed): (Volume<f32, Native>, Volume<f32, Native>) =
        (moving.clone().relabelled(), fixed.clone().relabelled());
    let (moving, fixed) = rayon::join(|| without_gain(&moving), || without_gain(&fixed));
    let moving = on_the_gain_of(&fixed, &moving, &start).unwrap_or(moving);
    Ok(refine_rigid(&moving, &fixed, &start, settings)?.relabelled())
}

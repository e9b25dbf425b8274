//! The template carried onto a head by a deformable fit, and the head segmented with it.

use super::{AtlasPriors, SegmentError, SegmentOverrides, SegmentSettings, Segmentation, atlas, segment_with_priors};
use crate::geometry::{AffineTransform, Frame, Mni, Position, RigidTransform};
use crate::image::{Mask, Volume};
use crate::image::resample::{Interpolation, resample};
use crate::register::{MeanHead, RegisterError, RigidFit, register_to_mean_head, subject_from_mean_head};
use crate::register::deformable::{AtlasFit, DeformableError, DeformableSettings, fit_atlas};
use thiserror::Error;

/// What is left of the misfit between the carried template and a head, mm: about a voxel of the fit's finest level.
const MISFIT_MM: f64 = 1.5;

/// Why a head could not be taken apart.
#[derive(Debug, Error)]
pub enum HeadError {
    /// The template does not fit.
    #[error(transparent)]
    Fit(#[from] DeformableError),
    /// The labels are refused.
    #[error(transparent)]
    Segment(#[from] SegmentError),
}

/// The pose of a head in the template's frame, found against the mean of whole heads.
///
/// # Errors
/// [`RegisterError`].
pub fn pose_of_head<F: Frame>(t1: &Volume<f32, F>) -> Result<RigidFit<F, Mni>, RegisterError> {
    let head = atlas::mean_head();
    register_to_mean_head(t1, &MeanHead { t1: &head.t1, brain: &head.brain })
}

/// The template deformed onto a head; both in the MNI frame reached rigidly.
///
/// # Errors
/// The fit's.
pub fn fit_template<F: Frame>(
    t1: &Volume<f32, F>,
    mni_from_t1: &RigidTransform<F, Mni>,
    settings: &DeformableSettings,
) -> Result<AtlasFit<Mni>, DeformableError> {
    let template = atlas::template().t1_f32();
    let affine = mni_from_t1.inverse().to_affine();
    let on_grid = resample(t1, &template.grid, &affine, Interpolation::Linear, f32::NAN);
    let start = if settings.affine { stretch(&on_grid.volume, &on_grid.inside) } else { AffineTransform::identity() };
    fit_atlas(&on_grid.volume, &template, &start, None, settings)
}

/// From the template to a head that lies rigidly aligned with it: by way of the mean head in its natural size.
fn stretch(subject: &Volume<f32, Mni>, known: &Mask<Mni>) -> AffineTransform<Mni, Mni> {
    let head = atlas::mean_head();
    let finite = subject.map(|x| if x.is_finite() { x } else { 0.0 });
    let mean = MeanHead { t1: &head.t1, brain: &head.brain };
    atlas::head_from_template().then(&subject_from_mean_head(&finite, &mean, Some(known)))
}

/// The template's maps read through `template_from_patient`, a map that [`fit_template`] made.
pub fn carried_priors(template_from_patient: impl Fn(Position<Mni>) -> Position<Mni> + Sync) -> AtlasPriors {
    AtlasPriors::through(&atlas::template().grid(), template_from_patient, MISFIT_MM)
}

/// Labels of a head that has been registered rigidly to the template: fits the template, then [`segment_with_priors`].
///
/// # Errors
/// [`HeadError`].
pub fn segment_head<F: Frame>(
    t1: &Volume<f32, F>,
    mni_from_t1: &RigidTransform<F, Mni>,
    overrides: &SegmentOverrides<'_, F>,
    deformable: &DeformableSettings,
    settings: &SegmentSettings,
) -> Result<(Segmentation<F>, AtlasFit<Mni>), HeadError> {
    let fit = fit_template(t1, mni_from_t1, deformable)?;
    let priors = carried_priors(|p| fit.atlas_from_subject.apply(p));
    let segmentation = segment_with_priors(t1, mni_from_t1, &priors, overrides, settings)?;
    Ok((segmentation, fit))
}

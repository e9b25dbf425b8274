//! The registration behind the displacement of a patient's brain, with the images it looked at, as a case's files hold them.

use super::anat::{AnatFacts, Anatomy};
use super::registration::transforms;
use crate::experiment::estimate::ReRegistration;
use crate::geometry::{Mni, Post};
use crate::image::morphology::erode;
use crate::image::nifti::{self, ReadOptions};
use crate::image::resample::{Interpolation, resample};
use crate::image::{LabelMap, Mask, Volume};
use crate::layout::{POST_NATIVE_BRAIN, POST_T1, PRE_BRAIN, PRE_EVEN_T1};
use crate::register::RigidSettings;
use crate::register::deformable::{DeformableSettings, DisplacementField};
use crate::resect::{SagScans, skull_is_shown};
use crate::segment::label;
use crate::workflow::Settings;
use crate::workflow::case::Case;
use crate::workflow::error::WorkflowError;
use crate::workflow::stage_name::StageName;

/// How far the wall of a ventricle reaches into an image's fluid, mm (docs/evidence/choices.md).
const WALL_MM: f64 = 2.0;

/// Fewer voxels than this are no sample of the fluid.
const LEAST_CORE: usize = 100;

/// What a patient's scans show of the brain shift, and what it takes to show the registration another one.
#[derive(Debug)]
pub(crate) struct SeenShift {
    /// Where the brain has moved to, around the cavity.
    pub seen: DisplacementField<Mni>,
    pre: Volume<f32, Mni>,
    pre_brain: Mask<Mni>,
    tissue: Mask<Mni>,
    scale_sigma_mm: f64,
    post_known: Mask<Mni>,
    cavity: Mask<Mni>,
    fluid: f32,
    skull_is_shown: bool,
    rigid: RigidSettings,
    settings: DeformableSettings,
}

impl SeenShift {
    /// Reads the images of a case. The registrations are posed as they were for the masks: by the case's own settings.
    pub fn read(case: &Case, anatomy: Anatomy, settings: &Settings) -> Result<Self, WorkflowError> {
        let options = ReadOptions::default();
        let pre: Volume<f32, Mni> = nifti::decode(&case.read(PRE_EVEN_T1)?, PRE_EVEN_T1, &options)?.volume.relabelled();
        let (pre_brain, _) = nifti::decode_mask(&case.read(PRE_BRAIN)?, PRE_BRAIN, &options)?;
        // On the post-operative scan's own grid: what tells how far that scan looked.
        let (on_post, _) = nifti::decode_mask(&case.read(POST_NATIVE_BRAIN)?, POST_NATIVE_BRAIN, &options)?;
        let on_post: Volume<f32, Post> = on_post.map(f32::from).relabelled();
        let (pre_from_post, mni_from_pre) = transforms(case)?;
        let post_from_mni = pre_from_post.then(&mni_from_pre).inverse().to_affine();
        let covered = resample(&on_post, &pre.grid, &post_from_mni, Interpolation::Nearest, 0.0).inside;
        let post: Volume<f32, Mni> = nifti::decode(&case.read(POST_T1)?, POST_T1, &options)?.volume.relabelled();
        // What the scan was filled up with is as little of it as what lies beyond its grid.
        let (_, AnatFacts { post_filled_up, .. }) = case.stage(&StageName::Anat)?;
        let taken = |n: usize| {
            let there = on_post.grid.voxel_at(post_from_mni.apply(pre.grid.centre(pre.grid.voxel(n))));
            !post_filled_up.iter().any(|padding| padding.contains(there.into()))
        };
        let post_known = Mask::from_fn(pre.grid, |n| covered.data[n] && (post_filled_up.is_empty() || taken(n)));
        let (pre_brain, cavity) = (pre_brain.relabelled(), anatomy.cavity);
        let scans =
            SagScans { pre: &pre, pre_brain: &pre_brain, post: &post, post_known: &post_known, cavity: &cavity };
        Ok(Self {
            skull_is_shown: skull_is_shown(&scans),
            fluid: fluid_in_ventricles(&pre, &anatomy.labels),
            tissue: Mask::from_fn(pre.grid, |n| label::is_tissue(anatomy.labels.data[n]) && post_known.data[n]),
            scale_sigma_mm: settings.anat.cavity.bias_sigma_mm,
            pre,
            pre_brain,
            post_known,
            seen: anatomy.sag,
            cavity,
            rigid: settings.register.clone(),
            settings: settings.anat.sag.clone(),
        })
    }

    /// The registration, to be shown a displacement that is known.
    pub fn registration(&self) -> ReRegistration<'_> {
        ReRegistration {
            pre: &self.pre,
            pre_brain: &self.pre_brain,
            tissue: &self.tissue,
            scale_sigma_mm: self.scale_sigma_mm,
            post_known: &self.post_known,
            cavity: &self.cavity,
            fluid: self.fluid,
            skull_is_shown: self.skull_is_shown,
            rigid: &self.rigid,
            settings: &self.settings,
        }
    }
}

/// Intensity of fluid: the mean well within the ventricles, where they are that wide. Beside their walls and the plexus it is mixed
/// with tissue, and brighter.
fn fluid_in_ventricles(t1: &Volume<f32, Mni>, labels: &LabelMap<Mni>) -> f32 {
    let ventricles = labels.map(|l| l == label::VENTRICLE);
    let core = erode(&ventricles, WALL_MM);
    let inside = if core.count() < LEAST_CORE { ventricles } else { core };
    let (sum, count) = (t1.data.iter().zip(&inside.data).filter(|(_, inside)| **inside))
        .fold((0.0, 0.0), |(s, c), (t1, _)| (s + f64::from(*t1), c + 1.0));
    (sum / f64::max(count, 1.0)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    /// A ball of fluid (30) whose outer millimetre and a half is mixed with its wall (60).
    fn read_of(radius_mm: f64) -> f32 {
        let grid = Grid::<Mni>::axis_aligned([41; 3], [1.0; 3], [-20.0; 3]);
        let radius = |n: usize| grid.centre(grid.voxel(n)).mm.coords.norm();
        let labels = LabelMap::from_fn(grid, |n| if radius(n) < radius_mm { label::VENTRICLE } else { 0 });
        let t1 = Volume::from_fn(grid, |n| if radius(n) < radius_mm - 1.5 { 30.0 } else { 60.0 });
        fluid_in_ventricles(&t1, &labels)
    }

    #[test]
    fn fluid_is_read_away_from_the_walls_where_there_is_room() {
        assert_eq!(read_of(12.0), 30.0);
        let narrow = read_of(3.0);
        assert!((40.0..60.0).contains(&narrow), "{narrow}");
    }
}

//! The cerebellum's tissue, as label maps of the head know it.
//!
//! A folium is some 2 mm thick: cortex around a blade of white matter, fluid between it and the next, all of them shared by
//! most voxels. Atlases and label maps (FreeSurfer's, SynthSeg's, hand-drawn ones, the template's own) give the folia to grey
//! matter, and white matter what is under them. A mixture of intensities takes the blades for white matter and the fissures
//! for fluid.

use super::label::{CSF, GREY_MATTER, WHITE_MATTER};
use super::priors::AtlasPriors;
use crate::geometry::Mni;
use crate::image::morphology::{close, open};
use crate::image::{LabelMap, Mask, Volume};

/// Blades of white matter thinner than twice this are folia, mm,
const BLADE_MM: f64 = 1.0;
/// and so are fissures between them, mm.
const FISSURE_MM: f64 = 1.5;

/// Folia as grey matter, in place. What the template expects to be fluid (the fourth ventricle, cisterns) stays fluid.
pub(super) fn with_whole_folia(labels: &mut LabelMap<Mni>, priors: &AtlasPriors) {
    let cerebellum = priors.cerebellum.map(|p| p > 0.5);
    let Some(found) = cerebellum.bounding_box() else { return };
    let around = found.grown(&labels.grid, 4.0);
    let (mut part, cerebellum) = (labels.cropped(&around), cerebellum.cropped(&around));
    let fluid = priors.tissue[0].cropped(&around);
    let thick = open(&part.map(|l| l == WHITE_MATTER), BLADE_MM);
    // Of the cerebellum alone: the tentorium's cistern is no fissure.
    let tissue = Mask::from_fn(part.grid, |n| cerebellum.data[n] && matches!(part.data[n], GREY_MATTER | WHITE_MATTER));
    let closed = close(&tissue, FISSURE_MM);
    part = Volume::from_fn(part.grid, |n| match part.data[n] {
        WHITE_MATTER if cerebellum.data[n] && !thick.data[n] => GREY_MATTER,
        CSF if cerebellum.data[n] && closed.data[n] && fluid.data[n] < 0.5 => GREY_MATTER,
        other => other,
    });
    labels.paste(&part, &around);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    /// Blades, fissures and a core within a cerebellum that begins at x = 20; the same beside it.
    fn folded() -> (LabelMap<Mni>, AtlasPriors) {
        let grid = Grid::<Mni>::axis_aligned([40, 48, 30], [1.0; 3], [0.0; 3]);
        let labels = Volume::from_fn(grid, |n| match grid.voxel(n)[1] {
            15 | 16 | 24 | 36..40 => CSF,
            10 | 11 | 20 | 28..34 => WHITE_MATTER,
            _ => GREY_MATTER,
        });
        let nothing = Volume::filled(grid, 0f32);
        let fluid = Volume::from_fn(grid, |n| if grid.voxel(n)[1] == 24 { 0.8 } else { 0.0 });
        let priors = AtlasPriors {
            brain_mm: nothing.clone(),
            tissue: [fluid, nothing.clone(), nothing.clone()],
            ventricle_mm: nothing.clone(),
            cistern_mm: nothing.clone(),
            deep_grey: nothing,
            cerebellum: Volume::from_fn(grid, |n| f32::from(u8::from(grid.voxel(n)[0] >= 20))),
        };
        (labels, priors)
    }

    #[test]
    fn thin_blades_and_fissures_are_grey_matter_within_the_cerebellum_alone() {
        let (before, priors) = folded();
        let mut after = before.clone();
        with_whole_folia(&mut after, &priors);
        for y in [10, 11, 15, 16, 20] {
            assert_eq!(after.at(30, y, 15), GREY_MATTER, "{y}");
        }
        // The core, a wide fissure, and fluid that the template expects.
        for y in [24, 28, 30, 33, 37] {
            assert_eq!(after.at(30, y, 15), before.at(30, y, 15), "{y}");
        }
        for y in 0..48 {
            assert_eq!(after.at(10, y, 15), before.at(10, y, 15), "{y}");
        }
        let once = after.clone();
        with_whole_folia(&mut after, &priors);
        assert_eq!(after, once);
    }
}

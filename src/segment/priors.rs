//! What the template expects at each voxel of a patient's image.

use super::atlas;
use super::label;
use crate::geometry::{Mni, Position};
use crate::image::distance::signed_distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::morphology::close;
use crate::image::resample::resample_together;
use crate::image::{Grid, Volume, VoxelBox};
use nalgebra::Point3;
use std::sync::OnceLock;

/// Widest distance outside the brain that the fields know, in mm.
const FAR_MM: f32 = 60.0;

/// The template's maps on a patient's working grid (MNI frame reached rigidly).
#[derive(Clone, Debug)]
pub struct AtlasPriors {
    /// Signed distance to the template's brain surface in mm, negative inside. The surface is the pia with the sulci
    /// closed.
    pub brain_mm: Volume<f32, Mni>,
    /// Probability of CSF, grey matter and white matter, 0 to 1, blurred by the expected misfit.
    pub tissue: [Volume<f32, Mni>; 3],
    /// Signed distance to the wall of the lateral and third ventricles in mm, negative inside.
    pub ventricle_mm: Volume<f32, Mni>,
    /// Signed distance to CSF that is no ventricle: sulci, fissures, cisterns, fourth ventricle; negative inside.
    pub cistern_mm: Volume<f32, Mni>,
    /// Probability of thalamus, putamen and pallidum, 0 to 1.
    pub deep_grey: Volume<f32, Mni>,
}

/// The fields on the template's own grid, before any warp.
struct TemplateFields {
    brain_mm: Volume<f32, Mni>,
    tissue: [Volume<f32, Mni>; 3],
    ventricle_mm: Volume<f32, Mni>,
    cistern_mm: Volume<f32, Mni>,
    deep_grey: Volume<f32, Mni>,
}

fn template_fields() -> &'static TemplateFields {
    static FIELDS: OnceLock<TemplateFields> = OnceLock::new();
    FIELDS.get_or_init(|| {
        let atlas = atlas::template();
        let tissue_sum: Vec<f32> = (atlas.grey.data.iter().zip(&atlas.white.data))
            .map(|(&g, &w)| (f32::from(g) + f32::from(w)) / 255.0)
            .collect();
        // The template's T1 reaches about a voxel past the pia: there grey and white together are below one half.
        let solid = Volume::from_data(atlas.grid(), tissue_sum.iter().map(|&p| p >= 0.5).collect());
        let mut brain = close(&solid, 6.0);
        for (inside, &t1) in brain.data.iter_mut().zip(&atlas.t1.data) {
            *inside &= t1 > 0;
        }
        let csf = (tissue_sum.iter().zip(&atlas.t1.data))
            .map(|(&p, &t1)| if t1 > 0 { (1.0 - p).max(0.0) } else { 0.0 })
            .collect();
        let distance = |l: u8| signed_distance_mm(&atlas.labels.map(|v| v == l)).map(|d| d.min(FAR_MM));
        TemplateFields {
            brain_mm: signed_distance_mm(&brain).map(|d| d.min(FAR_MM)),
            tissue: [
                Volume::from_data(atlas.grid(), csf),
                atlas.grey.map(|v| f32::from(v) / 255.0),
                atlas.white.map(|v| f32::from(v) / 255.0),
            ],
            ventricle_mm: distance(label::VENTRICLE),
            cistern_mm: distance(label::CSF),
            deep_grey: gaussian(&atlas::deep_grey().map(|inside| f32::from(u8::from(inside))), 1.0),
        }
    })
}

/// The part of the grid where the template's brain comes to lie, with room for whatever is looked at around it.
fn where_brain_may_be(
    brain_mm: &Volume<f32, Mni>,
    grid: &Grid<Mni>,
    template_from_patient: &(impl Fn(Position<Mni>) -> Position<Mni> + Sync),
) -> VoxelBox {
    /// Farther out nothing is asked of the priors: reach, closing and blur together.
    const ROOM_MM: f64 = 20.0;
    const STEP: usize = 4;
    let near = Volume::from_fn(*grid, |n| {
        let voxel = grid.voxel(n);
        if voxel.iter().any(|v| v % STEP != 0) {
            return false;
        }
        let p = template_from_patient(grid.position(Point3::from(voxel.map(|v| v as f64))));
        brain_mm.nearest(p).is_some_and(|d| d < 0.0)
    });
    let whole = VoxelBox { first: [0; 3], end: grid.dims };
    near.bounding_box().map_or(whole, |found| found.grown(grid, ROOM_MM))
}

impl AtlasPriors {
    /// The template's fields at `template_from_patient(p)` for every voxel centre `p` of the grid.
    /// `misfit_mm` is the expected error of that map (standard deviation): the tissue maps are blurred by it.
    #[must_use]
    pub fn through(
        grid: &Grid<Mni>,
        template_from_patient: impl Fn(Position<Mni>) -> Position<Mni> + Sync,
        misfit_mm: f64,
    ) -> Self {
        let fields = template_fields();
        let around = where_brain_may_be(&fields.brain_mm, grid, &template_from_patient);
        let near = grid.cropped(&around);
        let [csf, grey, white] = &fields.tissue;
        let maps = [csf, grey, white, &fields.brain_mm, &fields.ventricle_mm, &fields.cistern_mm, &fields.deep_grey];
        let outside = [0.0, 0.0, 0.0, FAR_MM, FAR_MM, FAR_MM, 0.0];
        let [csf, grey, white, brain_mm, ventricle_mm, cistern_mm, deep_grey] =
            resample_together(maps, &near, template_from_patient, outside);
        // Each part is let go as soon as it is in its place: all of them twice would be the peak of memory.
        let whole = |part: Volume<f32, Mni>, value: f32| {
            let mut all = Volume::filled(*grid, value);
            all.paste(&part, &around);
            all
        };
        Self {
            brain_mm: whole(brain_mm, FAR_MM),
            ventricle_mm: whole(ventricle_mm, FAR_MM),
            cistern_mm: whole(cistern_mm, FAR_MM),
            deep_grey: whole(deep_grey, 0.0),
            tissue: [csf, grey, white].map(|map| {
                let blurred = gaussian(&map, misfit_mm);
                drop(map);
                whole(blurred, 0.0)
            }),
        }
    }

    /// The template as it stands, for a patient who has only been aligned rigidly: misfits of several millimetres are
    /// expected.
    #[must_use]
    pub fn rigid(grid: &Grid<Mni>) -> Self {
        let priors = Self::through(grid, |p| p, 3.0);
        // That is more than tells a nucleus from the capsule beside it: place alone says nothing.
        Self { deep_grey: Volume::filled(*grid, 0.0), ..priors }
    }
}

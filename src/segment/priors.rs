//! What the template expects at each voxel of a patient's image.

use super::atlas;
use super::cerebellum::cerebellum;
use super::label;
use crate::geometry::{Mni, Position};
use crate::image::distance::signed_distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::morphology::close;
use crate::image::resample::resample_each;
use crate::image::{Grid, Volume, VoxelBox};
use nalgebra::Point3;
use rayon::prelude::*;
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
    /// Probability of the cerebellum, 0 to 1.
    pub cerebellum: Volume<f32, Mni>,
}

/// Maps of the template on its own grid, side by side: one reading of eight corners then brings them all. Whole numbers of
/// [`UNITS`], which are finer than anything the maps know, take half the room.
const MAPS: usize = 8;
/// The first of them are the probabilities of CSF, grey and white matter,
const TISSUES: usize = 3;
/// the next is the distance to the brain's surface.
const BRAIN_MM: usize = TISSUES;
/// Units of probability and of mm.
const UNITS: [f32; MAPS] = {
    let (share, mm) = (1.0 / 32_000.0, 1.0 / 512.0);
    [share, share, share, mm, mm, mm, share, share]
};
/// What they are outside the template.
const OUTSIDE: [f32; MAPS] = [0.0, 0.0, 0.0, FAR_MM, FAR_MM, FAR_MM, 0.0, 0.0];

fn template_maps() -> &'static Volume<[i16; MAPS], Mni> {
    static MAPS_OF_TEMPLATE: OnceLock<Volume<[i16; MAPS], Mni>> = OnceLock::new();
    MAPS_OF_TEMPLATE.get_or_init(|| {
        let atlas = atlas::template();
        let tissue = |n: usize| (f32::from(atlas.grey.data[n]) + f32::from(atlas.white.data[n])) / 255.0;
        // The template's T1 reaches about a voxel past the pia: there grey and white together are below one half.
        let closed = close(&Volume::from_fn(atlas.grid(), |n| tissue(n) >= 0.5), 6.0);
        let brain = Volume::from_fn(atlas.grid(), |n| closed.data[n] && atlas.t1.data[n] > 0);
        let brain_mm = signed_distance_mm(&brain);
        let [ventricle_mm, cistern_mm] =
            [label::VENTRICLE, label::CSF].map(|l| signed_distance_mm(&atlas.labels.map(|v| v == l)));
        let [deep_grey, cerebellum] = [atlas::deep_grey(), cerebellum()]
            .map(|region| gaussian(&region.map(|inside| f32::from(u8::from(inside))), 1.0));
        Volume::from_fn(atlas.grid(), |n| {
            let csf = if atlas.t1.data[n] > 0 { (1.0 - tissue(n)).max(0.0) } else { 0.0 };
            let [grey, white] = [&atlas.grey, &atlas.white].map(|map| f32::from(map.data[n]) / 255.0);
            let [brain, ventricle, cistern] =
                [&brain_mm, &ventricle_mm, &cistern_mm].map(|mm| mm.data[n].clamp(-FAR_MM, FAR_MM));
            let values = [csf, grey, white, brain, ventricle, cistern, deep_grey.data[n], cerebellum.data[n]];
            std::array::from_fn(|map| (values[map] / UNITS[map]).round() as i16)
        })
    })
}

/// The part of the grid where the template's brain comes to lie, with room for whatever is looked at around it.
fn where_brain_may_be(
    template: &Volume<[i16; MAPS], Mni>,
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
        template.nearest(p).is_some_and(|maps| maps[BRAIN_MM] < 0)
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
        let outside = std::array::from_fn(|map| OUTSIDE[map] / UNITS[map]);
        let mut maps = resample_each(template_maps(), grid, template_from_patient, outside);
        for (map, values) in maps.iter_mut().enumerate() {
            values.data.par_iter_mut().for_each(|x| *x *= UNITS[map]);
            if map < TISSUES {
                *values = gaussian(values, misfit_mm);
            }
        }
        let [csf, grey, white, brain_mm, ventricle_mm, cistern_mm, deep_grey, cerebellum] = maps;
        Self { brain_mm, tissue: [csf, grey, white], ventricle_mm, cistern_mm, deep_grey, cerebellum }
    }

    /// [`Self::through`] on the part of the grid where brain may be: nothing is asked of the template beyond it.
    #[must_use]
    pub fn near_brain(
        grid: &Grid<Mni>,
        template_from_patient: impl Fn(Position<Mni>) -> Position<Mni> + Sync,
        misfit_mm: f64,
    ) -> Self {
        let near = where_brain_may_be(template_maps(), grid, &template_from_patient);
        Self::through(&grid.cropped(&near), template_from_patient, misfit_mm)
    }

    /// The template as it stands, for a patient who has only been aligned rigidly: misfits of several millimetres are
    /// expected.
    #[must_use]
    pub fn rigid(grid: &Grid<Mni>) -> Self {
        let priors = Self::through(grid, |p| p, 3.0);
        // That is more than tells a nucleus from the capsule beside it, or a folium from a gyrus: place alone says nothing.
        let nowhere = Volume::filled(*grid, 0.0);
        Self { deep_grey: nowhere.clone(), cerebellum: nowhere, ..priors }
    }
}

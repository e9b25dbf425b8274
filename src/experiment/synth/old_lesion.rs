//! What a stroke left long before the operation: a cavity full of fluid, in both scans.

use super::frame::{Patient, centre};
use super::resection::{Resection, walled};
use super::settings::{SynthError, SynthSettings};
use crate::experiment::smooth_noise::SmoothNoise;
use crate::geometry::{Mni, Position};
use crate::image::morphology::{close, open};
use crate::image::{LabelMap, Mask};
use crate::material::random::CounterRng;
use crate::segment::label;
use nalgebra::Point3;
use rayon::prelude::*;

/// Brain that always lies between the old lesion and the resection, mm: the two are never one hole.
const APART_MM: f64 = 12.0;

/// A place for the lesion, in the brain above the tentorium and away from the resection, chosen by the seed.
///
/// # Errors
/// [`SynthError::NoRoomForLesion`] where the brain has no such place of that size.
pub fn old_lesion(
    labels: &LabelMap<Patient>,
    in_template: impl Fn(Point3<f64>) -> Position<Mni> + Sync,
    resection: &Resection,
    settings: &SynthSettings,
) -> Result<Resection, SynthError> {
    let wanted_cc = settings.pathology.old_lesion_cc;
    let grid = labels.grid;
    let (choice, wall) =
        (CounterRng::new(settings.seed, 711), SmoothNoise::new(CounterRng::new(settings.seed, 712), 14.0));
    let radius_mm = (wanted_cc * 1000.0 * 0.75 / std::f64::consts::PI).cbrt();
    let tissue = |n: usize| matches!(labels.data[n], label::GREY_MATTER | label::WHITE_MATTER);
    // Where the middle cerebral artery's branches go: neither cerebellum and brainstem nor the midline.
    let territory = |p: Point3<f64>| {
        let q = in_template(p).mm;
        q.x.abs() > 16.0 && q.z > -8.0 && q.y > -80.0
    };
    let centres: Vec<usize> = (0..grid.len())
        .into_par_iter()
        .filter(|&n| {
            let p = centre(&grid, n);
            tissue(n) && resection.distance_mm(p) > APART_MM + 1.2 * radius_mm && territory(p)
        })
        .collect();
    let refused = || SynthError::NoRoomForLesion { wanted_cc };
    let chosen = centres.get((choice.uniform(0) * centres.len() as f64) as usize).ok_or_else(refused)?;
    let (middle, side) = (centre(&grid, *chosen), in_template(centre(&grid, *chosen)).mm.x.signum());
    let order: Vec<f32> = (0..grid.len())
        .into_par_iter()
        .map(|n| {
            let p = centre(&grid, n);
            let far = resection.distance_mm(p) > APART_MM && side * in_template(p).mm.x > 4.0;
            if !(far && (tissue(n) || labels.data[n] == label::CSF)) {
                return f32::INFINITY;
            }
            ((p - middle).norm() + 0.3 * radius_mm * wall.at(p.into())) as f32
        })
        .collect();
    let mut sorted: Vec<f32> = order.iter().copied().filter(|o| o.is_finite()).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let count = (wanted_cc * 1000.0 / grid.voxel_volume_mm3()) as usize;
    let limit = sorted.get(count).ok_or_else(refused)?;
    let lost = Mask::from_data(grid, order.iter().map(|o| o < limit).collect());
    Ok(walled(labels, &close(&open(&lost, 1.0), 2.0)))
}

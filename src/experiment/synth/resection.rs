//! What the surgeon takes: part of a lobe, or what a mask says.

use super::frame::{Patient, centre};
use super::settings::{SynthError, SynthSettings};
use crate::experiment::smooth_noise::SmoothNoise;
use crate::geometry::{Mni, Position};
use crate::image::components::{Connectivity, largest_component, without_islands};
use crate::image::distance::signed_distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::morphology::{close, open};
use crate::image::{LabelMap, Mask, Volume};
use crate::material::random::CounterRng;
use crate::segment::atlas::Side;
use crate::segment::label;
use nalgebra::Point3;
use rayon::prelude::*;

/// The region that is removed, in the patient before the operation.
#[derive(Clone, Debug)]
pub struct Resection {
    /// Signed distance in mm from its wall, negative inside.
    pub wall_mm: Volume<f32, Patient>,
    /// Its centroid.
    pub centroid: Point3<f64>,
}

impl Resection {
    /// Signed distance from the wall; far outside of the volume a large number.
    pub fn distance_mm(&self, p: Point3<f64>) -> f64 {
        self.wall_mm.trilinear(Position::from_point(p)).map_or(60.0, f64::from)
    }

    /// Gives what lies within the wall this label; never the ventricle.
    pub fn label(&self, labels: &mut LabelMap<Patient>, as_label: u8) {
        for (own, &wall_mm) in labels.data.iter_mut().zip(&self.wall_mm.data) {
            if wall_mm < 0.0 && *own != label::BACKGROUND && *own != label::VENTRICLE {
                *own = as_label;
            }
        }
    }
}

/// Takes `resection_cc` from where the surgeon of the lobe begins, with an uneven wall; never the ventricle.
pub fn resect(
    labels: &LabelMap<Patient>,
    in_template: impl Fn(Point3<f64>) -> Position<Mni> + Sync,
    settings: &SynthSettings,
) -> Result<Resection, SynthError> {
    let grid = labels.grid;
    let noise = |stream, size_mm| SmoothNoise::new(CounterRng::new(settings.seed, stream), size_mm);
    let (wall, lobe_edge) = (noise(201, 16.0), noise(202, 24.0));
    let sign = if settings.side == Side::Left { -1.0 } else { 1.0 };
    let (stray_mm, tip_mm) = settings.lobe.tool_mm();
    // How late a voxel would be taken: uneven by a few mm.
    let order: Vec<f32> = (0..grid.len())
        .into_par_iter()
        .map(|n| {
            let p = centre(&grid, n);
            if !matches!(labels.data[n], label::CSF | label::GREY_MATTER | label::WHITE_MATTER) {
                return f32::INFINITY;
            }
            let at = in_template(p);
            let edge = 2.0 * lobe_edge.at(p.into());
            let moved = Position::new(at.mm.x + sign * edge, at.mm.y + edge, at.mm.z + edge);
            if !settings.lobe.holds(settings.side, moved) {
                return f32::INFINITY;
            }
            (settings.lobe.order_mm(settings.side, at) + stray_mm * wall.at(p.into())) as f32
        })
        .collect();
    let mut lobe: Vec<f32> = order.iter().copied().filter(|o| o.is_finite()).collect();
    lobe.sort_unstable_by(f32::total_cmp);
    let voxel_cc = grid.voxel_volume_mm3() / 1000.0;
    let lobe_cc = lobe.len() as f64 * voxel_cc;
    let wanted = (settings.resection_cc / voxel_cc) as usize;
    if lobe.is_empty() || settings.resection_cc > 0.8 * lobe_cc {
        return Err(SynthError::LobeTooSmall {
            wanted_cc: settings.resection_cc,
            lobe_cc,
            side: settings.side,
            lobe: settings.lobe,
        });
    }
    let limit = lobe[wanted.min(lobe.len() - 1)];
    let taken = Mask::from_data(grid, order.iter().map(|&o| o < limit).collect());
    // A suction tip leaves neither threads nor islands.
    Ok(walled(labels, &close(&open(&taken, tip_mm), 1.5 * tip_mm)))
}

/// Takes what a mask of the head holds of the brain, in one place or several; never the ventricle.
pub fn resect_mask(
    labels: &LabelMap<Patient>,
    in_head: impl Fn(Point3<f64>) -> Position<Mni> + Sync,
    mask: &Mask<Mni>,
) -> Result<Resection, SynthError> {
    /// From a biopsy to more than a lobe.
    const LEAST_CC: f64 = 0.5;
    const MOST_CC: f64 = 150.0;
    let grid = labels.grid;
    let taken = Mask::from_fn(grid, |n| {
        let brain = matches!(
            labels.data[n],
            label::CSF | label::GREY_MATTER | label::WHITE_MATTER | label::TUMOUR | label::OEDEMA
        );
        brain && mask.nearest(in_head(centre(&grid, n))) == Some(true)
    });
    let found_cc = taken.volume_cc();
    if found_cc == 0.0 {
        return Err(SynthError::NothingToTake);
    }
    // Crumbs are a mask's edge, not a place of the operation.
    let voxels = (LEAST_CC * 1000.0 / grid.voxel_volume_mm3()).ceil() as usize;
    let places = without_islands(&taken, Connectivity::Faces, voxels);
    if places.count() == 0 || found_cc > MOST_CC {
        return Err(SynthError::MaskSize { found_cc, least_cc: LEAST_CC, most_cc: MOST_CC });
    }
    Ok(with_wall(&places))
}

/// The largest part of the region, with a smooth wall; never the ventricle.
pub(super) fn walled(labels: &LabelMap<Patient>, smooth: &Mask<Patient>) -> Resection {
    let free = |l: u8| l != label::VENTRICLE && l != label::BACKGROUND;
    let kept = Mask::from_fn(labels.grid, |n| smooth.data[n] && free(labels.data[n]));
    with_wall(&largest_component(&kept, Connectivity::Faces))
}

fn with_wall(region: &Mask<Patient>) -> Resection {
    let grid = region.grid;
    let wall_mm = gaussian(&signed_distance_mm(region), 0.8);
    let inside = (0..grid.len()).filter(|&n| region.data[n]);
    let sum =
        inside.fold((Point3::origin().coords, 0f64), |(sum, count), n| (sum + centre(&grid, n).coords, count + 1.0));
    Resection { wall_mm, centroid: Point3::from(sum.0 / sum.1.max(1.0)) }
}

//! What the surgeon takes: the front of one temporal lobe.

use super::field::{Field, in_template};
use super::frame::{Patient, centre};
use super::settings::{SynthError, SynthSettings};
use crate::experiment::smooth_noise::SmoothNoise;
use crate::geometry::Position;
use crate::image::components::{Connectivity, largest_component};
use crate::image::distance::signed_distance_mm;
use crate::image::gaussian::gaussian;
use crate::image::morphology::{close, open};
use crate::image::{LabelMap, Mask, Volume};
use crate::material::random::CounterRng;
use crate::segment::atlas::{Side, temporal_lobe};
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
}

/// Takes `resection_cc` from the temporal pole backwards, with an uneven wall; never the ventricle.
pub fn resect(labels: &LabelMap<Patient>, anatomy: &Field, settings: &SynthSettings) -> Result<Resection, SynthError> {
    let grid = labels.grid;
    let noise = |stream, size_mm| SmoothNoise::new(CounterRng::new(settings.seed, stream), size_mm);
    let (wall, lobe_edge) = (noise(201, 16.0), noise(202, 24.0));
    let sign = if settings.side == Side::Left { -1.0 } else { 1.0 };
    // How late a voxel would be taken: an elliptic distance from the temporal pole, uneven by a few mm.
    let order: Vec<f32> = (0..grid.len())
        .into_par_iter()
        .map(|n| {
            let p = centre(&grid, n);
            if !matches!(labels.data[n], label::CSF | label::GREY_MATTER | label::WHITE_MATTER) {
                return f32::INFINITY;
            }
            let q = in_template(anatomy, p).mm;
            let edge = 2.0 * lobe_edge.at(p.into());
            let lobe = temporal_lobe(Position::new(q.x + sign * edge, q.y + edge, q.z + edge));
            if lobe != Some(settings.side) {
                return f32::INFINITY;
            }
            let from_pole = [(q.x - sign * 42.0) / 1.0, (q.y - 16.0) / 1.7, (q.z + 30.0) / 1.05];
            (from_pole.iter().map(|d| d * d).sum::<f64>().sqrt() + 2.5 * wall.at(p.into())) as f32
        })
        .collect();
    let mut lobe: Vec<f32> = order.iter().copied().filter(|o| o.is_finite()).collect();
    lobe.sort_unstable_by(f32::total_cmp);
    let voxel_cc = grid.voxel_volume_mm3() / 1000.0;
    let lobe_cc = lobe.len() as f64 * voxel_cc;
    let wanted = (settings.resection_cc / voxel_cc) as usize;
    if lobe.is_empty() || settings.resection_cc > 0.8 * lobe_cc {
        return Err(SynthError::LobeTooSmall { wanted_cc: settings.resection_cc, lobe_cc, side: settings.side });
    }
    let limit = lobe[wanted.min(lobe.len() - 1)];
    let taken = Mask::from_data(grid, order.iter().map(|&o| o < limit).collect());
    // A suction tip leaves neither threads nor islands.
    let smooth = close(&open(&taken, 2.0), 3.0);
    let ventricle = labels.map(|l| l == label::VENTRICLE);
    let head = labels.map(|l| l != label::BACKGROUND);
    let kept = smooth
        .data
        .iter()
        .zip(&ventricle.data)
        .zip(&head.data)
        .map(|((&taken, &ventricle), &head)| taken && !ventricle && head);
    let region = largest_component(&Mask::from_data(grid, kept.collect()), Connectivity::Faces);
    let wall_mm = gaussian(&signed_distance_mm(&region), 0.8);
    let inside = (0..grid.len()).filter(|&n| region.data[n]);
    let sum =
        inside.fold((Point3::origin().coords, 0f64), |(sum, count), n| (sum + centre(&grid, n).coords, count + 1.0));
    Ok(Resection { wall_mm, centroid: Point3::from(sum.0 / sum.1.max(1.0)) })
}

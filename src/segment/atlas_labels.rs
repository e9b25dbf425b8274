//! Labels of the template from its tissue probabilities.

use super::label;
use crate::geometry::{Mni, Position};
use crate::image::components::{Connectivity, components};
use crate::image::{LabelMap, Mask, Volume};
use nalgebra::Point3;

/// The most probable of CSF (what grey and white leave of 1), grey and white in every voxel of the brain (`t1` above
/// 0); of the CSF, the part that is lateral or third ventricle gets its own label.
///
/// The ventricles are CSF that a few boxes, placed by eye on the template, cut from the cisterns: the lateral ones are
/// what hangs together with a seed in each atrium, the third is the midline
/// slit between the thalami (lamina terminalis to pineal gland, below the velum interpositum), the temporal horns are
/// the CSF beside the hippocampus. The fourth ventricle stays CSF.
pub fn derive_labels(t1: &Volume<u8, Mni>, grey: &Volume<u8, Mni>, white: &Volume<u8, Mni>) -> LabelMap<Mni> {
    let tissue = |n: usize| {
        let (g, w) = (u16::from(grey.data[n]), u16::from(white.data[n]));
        let csf = 255u16.saturating_sub(g + w);
        match (t1.data[n], csf > g.max(w), g >= w) {
            (0, ..) => label::BACKGROUND,
            (_, true, _) => label::CSF,
            (_, _, true) => label::GREY_MATTER,
            _ => label::WHITE_MATTER,
        }
    };
    let mut labels = Volume::from_data(t1.grid, (0..t1.data.len()).map(tissue).collect());
    let within = |near: fn([f64; 3]) -> bool| csf_within(&labels, near);
    let lateral = within(|[x, y, z]| x.abs() <= 44.0 && (-62.0..=40.0).contains(&y) && (-5.0..=34.0).contains(&z));
    let third = within(|[x, y, z]| x.abs() <= 6.0 && (-28.0..=4.0).contains(&y) && (-15.0..=8.0).contains(&z));
    let horns = within(|[x, y, z]| {
        (23.0..=40.0).contains(&x.abs()) && (-36.0..=-4.0).contains(&y) && (-24.0..=-6.0).contains(&z)
    });
    for (csf, seeds) in [
        (lateral, [[25.0, -42.0, 10.0], [-25.0, -42.0, 10.0]]),
        (third, [[0.0, -10.0, -4.0], [0.0, -10.0, -4.0]]),
        (horns, [[36.0, -10.0, -22.0], [-36.0, -10.0, -22.0]]),
    ] {
        for n in hanging_together(&csf, seeds) {
            labels.data[n] = label::VENTRICLE;
        }
    }
    labels
}

fn csf_within(labels: &LabelMap<Mni>, near: fn([f64; 3]) -> bool) -> Mask<Mni> {
    let grid = labels.grid;
    let inside = |n: usize| {
        let voxel = Point3::from(grid.voxel(n).map(|x| x as f64));
        labels.data[n] == label::CSF && near(grid.position(voxel).mm.into())
    };
    Volume::from_data(grid, (0..grid.len()).map(inside).collect())
}

/// Voxels of the components (over faces) that hold one of the seeds.
fn hanging_together(mask: &Mask<Mni>, seeds_mm: [[f64; 3]; 2]) -> Vec<usize> {
    let found = components(mask, Connectivity::Faces);
    let wanted = seeds_mm.map(|[x, y, z]| found.labels.nearest(Position::new(x, y, z)).unwrap_or(0));
    let inside = |&n: &usize| found.labels.data[n] > 0 && wanted.contains(&found.labels.data[n]);
    (0..mask.data.len()).filter(inside).collect()
}

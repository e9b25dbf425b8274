//! How much of the brain the field of view covers.

use super::super::atlas;
use super::super::posed_scan::PosedScan;
use crate::geometry::{Frame, Mni, Position};
use crate::image::blank_slices;
use crate::register::deformable::DisplacementField;
use rayon::prelude::*;

/// Every how many voxels of the template's grid are asked along each axis.
const STRIDE: usize = 3;

/// Share of the places where the carried template has its brain that lie in a voxel of the scan, percent.
pub(super) fn percent<F: Frame>(scan: &PosedScan<'_, F>, template_from_patient: &DisplacementField<Mni>) -> f64 {
    let template = &atlas::template().t1;
    let (grid, t1_from_mni) = (template.grid, scan.mni_from_t1.inverse());
    let lost = blank_slices(scan.t1, f64::INFINITY);
    let is_brain = |p: Position<Mni>| template.nearest(template_from_patient.apply(p)).is_some_and(|value| value > 0);
    let is_seen = |p: Position<Mni>| {
        let at = scan.t1.grid.voxel_at(t1_from_mni.apply(p)).coords.map(f64::round);
        let inside = (0..3).all(|a| at[a] >= 0.0 && at[a] < scan.t1.grid.dims[a] as f64);
        inside && !lost.iter().any(|gap| gap.slices.contains(&(at[gap.axis] as usize)))
    };
    let of_slice = |k: usize| {
        let places =
            (0..grid.dims[1]).step_by(STRIDE).flat_map(|j| (0..grid.dims[0]).step_by(STRIDE).map(move |i| (i, j)));
        let brain = places.map(|(i, j)| grid.centre([i, j, k])).filter(|p| is_brain(*p));
        brain.fold([0usize; 2], |[all, seen], p| [all + 1, seen + usize::from(is_seen(p))])
    };
    let slices: Vec<[usize; 2]> = (0..grid.dims[2]).into_par_iter().step_by(STRIDE).map(of_slice).collect();
    let [all, seen] = slices.iter().fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
    100.0 * seen as f64 / all.max(1) as f64
}

//! How much of the brain the field of view covers.

use super::super::atlas;
use super::super::posed_scan::PosedScan;
use super::super::region::Region;
use crate::geometry::{Frame, Mni, Position};
use crate::image::blank_slices;
use crate::register::deformable::DisplacementField;
use rayon::prelude::*;

/// Every how many voxels of the template's grid are asked along each axis.
const STRIDE: usize = 3;

/// What of the carried template's brain the field of view covers.
pub(super) struct Coverage {
    /// Of the whole, percent.
    pub percent: f64,
    /// Of every part outside, percent, in the order of [`Region::ALL`].
    pub outside_percent: [f64; Region::ALL.len()],
}

/// Shares of the places where the carried template has its brain that lie in a voxel of the scan.
pub(super) fn coverage<F: Frame>(scan: &PosedScan<'_, F>, template_from_patient: &DisplacementField<Mni>) -> Coverage {
    type Counts = [[usize; 2]; Region::ALL.len()];
    let template = &atlas::template().t1;
    let (grid, t1_from_mni) = (template.grid, scan.mni_from_t1.inverse());
    let lost = blank_slices(scan.t1, f64::INFINITY);
    let brain_at = |p: Position<Mni>| {
        let there = template_from_patient.apply(p);
        template.nearest(there).is_some_and(|value| value > 0).then(|| Region::at(there))
    };
    let is_seen = |p: Position<Mni>| {
        let there = t1_from_mni.apply(p);
        let at = scan.t1.grid.voxel_at(there).coords.map(f64::round);
        let inside = (0..3).all(|a| at[a] >= 0.0 && at[a] < scan.t1.grid.dims[a] as f64);
        inside && scan.is_taken(there) && !lost.iter().any(|gap| gap.slices.contains(&(at[gap.axis] as usize)))
    };
    let of_slice = |k: usize| {
        let mut counts: Counts = Default::default();
        let places =
            (0..grid.dims[1]).step_by(STRIDE).flat_map(|j| (0..grid.dims[0]).step_by(STRIDE).map(move |i| (i, j)));
        for p in places.map(|(i, j)| grid.centre([i, j, k])) {
            let Some(region) = brain_at(p) else { continue };
            let [all, seen] = &mut counts[region as usize];
            *all += 1;
            *seen += usize::from(is_seen(p));
        }
        counts
    };
    let slices: Vec<Counts> = (0..grid.dims[2]).into_par_iter().step_by(STRIDE).map(of_slice).collect();
    let of_region = |region: usize| {
        slices.iter().fold([0, 0], |[all, seen], counts| [all + counts[region][0], seen + counts[region][1]])
    };
    let regions: [[usize; 2]; Region::ALL.len()] = std::array::from_fn(of_region);
    let [all, seen] = regions.iter().fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
    let percent = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    Coverage { percent: percent(seen, all), outside_percent: regions.map(|[all, seen]| percent(all - seen, all)) }
}

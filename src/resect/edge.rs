//! Whether a cavity ends where the scan does, and more of it lies where nothing can be seen; and whether it runs on into the
//! fluid above a brain that has sunk.

use super::sets::{both, without};
use crate::geometry::Mni;
use crate::image::Mask;
use crate::image::morphology::dilate;

/// Thickness of the layer around the cavity that is looked at, mm: a voxel or two.
const LAYER_MM: f64 = 1.5;

/// How much of the brain right around the cavity the scan does not show, percent.
pub(super) fn at_edge_percent(cavity: &Mask<Mni>, brain: &Mask<Mni>, known: &Mask<Mni>) -> f64 {
    let layer = both(&without(&dilate(cavity, LAYER_MM), cavity), brain);
    let all = layer.count();
    if all == 0 { 0.0 } else { 100.0 * without(&layer, known).count() as f64 / all as f64 }
}

/// How much of a cavity lies outside the brain once the brain's sag is undone, percent.
pub(super) fn outside_percent(undone_cavity: &Mask<Mni>, brain: &Mask<Mni>) -> f64 {
    let all = undone_cavity.count();
    if all == 0 { 0.0 } else { 100.0 * without(undone_cavity, brain).count() as f64 / all as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn a_cavity_that_the_scan_cuts_borders_on_what_is_not_shown_and_one_within_it_does_not() {
        let grid = Grid::<Mni>::axis_aligned([40; 3], [1.0; 3], [0.0; 3]);
        let within = |centre: f64, radius: f64| {
            Mask::from_fn(grid, |n| {
                grid.voxel(n).iter().map(|&v| (v as f64 - centre).powi(2)).sum::<f64>() <= radius * radius
            })
        };
        let (brain, hole) = (within(20.0, 18.0), within(20.0, 8.0));
        let seen_to = |k: usize| Mask::from_fn(grid, |n| grid.voxel(n)[2] < k);
        let of = |known: &Mask<Mni>| at_edge_percent(&both(&hole, known), &brain, known);
        assert_eq!(of(&seen_to(40)), 0.0);
        assert_eq!(of(&seen_to(30)), 0.0);
        // A ball cut through the middle: a disc of pi r2 beside half a sphere of 2 pi r2.
        let cut = of(&seen_to(21));
        assert!((cut - 33.0).abs() < 6.0, "{cut}");
        assert_eq!(at_edge_percent(&hole.map(|_| false), &brain, &brain), 0.0);
    }

    #[test]
    fn a_cavity_reaches_out_of_the_brain_by_its_part_beyond_it() {
        let grid = Grid::<Mni>::axis_aligned([10; 3], [1.0; 3], [0.0; 3]);
        let below = |k: usize| Mask::from_fn(grid, |n| grid.voxel(n)[2] < k);
        assert_eq!(outside_percent(&below(4), &below(4)), 0.0);
        assert_eq!(outside_percent(&below(8), &below(6)), 25.0);
        assert_eq!(outside_percent(&below(0), &below(6)), 0.0);
    }
}

//! Slices that a scanner or a converter lost: of one value throughout, between slices that show something.

use super::Volume;
use crate::geometry::Frame;
use std::ops::Range;

/// A run of blank slices between two that are not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlankSlices {
    /// The voxel axis across them.
    pub axis: usize,
    /// Their indices on it.
    pub slices: Range<usize>,
}

/// The runs of blank slices across each axis that are no wider than `widest_mm`; those at the ends of an axis are no gap but a
/// margin.
pub fn blank_slices<F: Frame>(image: &Volume<f32, F>, widest_mm: f64) -> Vec<BlankSlices> {
    let spacing = image.grid.spacing_mm();
    let narrow = |gap: &BlankSlices| gap.slices.len() as f64 * spacing[gap.axis] <= widest_mm;
    let all = shown(image).into_iter().enumerate();
    all.flat_map(|(axis, shown)| gaps(&shown).into_iter().map(move |slices| BlankSlices { axis, slices }))
        .filter(narrow)
        .collect()
}

/// The image with every gap read between the slices on either side of it.
#[must_use]
pub fn with_filled<F: Frame>(image: &Volume<f32, F>, gaps: &[BlankSlices]) -> Volume<f32, F> {
    let mut filled = image.clone();
    for BlankSlices { axis, slices } in gaps {
        let (before, after) = (slices.start - 1, slices.end);
        for n in 0..filled.data.len() {
            let mut voxel = filled.grid.voxel(n);
            let at = voxel[*axis];
            if !slices.contains(&at) {
                continue;
            }
            let mut read = |slice: usize| {
                voxel[*axis] = slice;
                filled.at(voxel[0], voxel[1], voxel[2])
            };
            let (low, high) = (read(before), read(after));
            filled.data[n] = low + (high - low) * (at - before) as f32 / (after - before) as f32;
        }
    }
    filled
}

/// For every slice across each axis how many of its voxels are not the value that its first one has.
fn shown<F: Frame>(image: &Volume<f32, F>) -> [Vec<usize>; 3] {
    let [nx, ny, nz] = image.grid.dims;
    let mut first = [nx, ny, nz].map(|n| vec![None; n]);
    let mut shown = [nx, ny, nz].map(|n| vec![0; n]);
    let mut rest = image.data.iter();
    for k in 0..nz {
        for j in 0..ny {
            for (i, &value) in rest.by_ref().take(nx).enumerate() {
                // Not a number is nothing, as zero is.
                let value = if value.is_finite() { value } else { 0.0 };
                for (axis, slice) in [i, j, k].into_iter().enumerate() {
                    shown[axis][slice] += usize::from(*first[axis][slice].get_or_insert(value) != value);
                }
            }
        }
    }
    shown
}

/// Runs of slices that show nothing between slices that show much: next to the last specks of a masked background nothing is
/// lost.
fn gaps(shown: &[usize]) -> Vec<Range<usize>> {
    let much = shown.iter().copied().max().unwrap_or(0).div_ceil(4).max(1);
    let mut gaps = Vec::new();
    let mut start = None;
    for (slice, &voxels) in shown.iter().enumerate() {
        match (voxels, start) {
            (0, None) if slice > 0 && shown[slice - 1] >= much => start = Some(slice),
            (1.., Some(first)) => {
                if voxels >= much {
                    gaps.push(first..slice);
                }
                start = None;
            }
            _ => {}
        }
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Native;
    use crate::image::Grid;

    /// What no line along one axis can tell from its filling.
    fn ramp() -> Volume<f32, Native> {
        let grid = Grid::axis_aligned([6, 7, 12], [1.0, 1.0, 2.0], [0.0; 3]);
        Volume::from_fn(grid, |n| {
            let [i, j, k] = grid.voxel(n).map(|v| v as f32);
            1.0 + i + 2.0 * j + 3.0 * k
        })
    }

    fn without(image: &Volume<f32, Native>, axis: usize, slices: Range<usize>) -> Volume<f32, Native> {
        Volume::from_fn(image.grid, |n| if slices.contains(&image.grid.voxel(n)[axis]) { 0.0 } else { image.data[n] })
    }

    #[test]
    fn lost_slices_of_an_even_image_come_back() {
        for (axis, slices) in [(0, 2..3), (1, 3..5), (2, 4..7)] {
            let lost = without(&ramp(), axis, slices.clone());
            let gaps = blank_slices(&lost, 6.0);
            assert_eq!(gaps, [BlankSlices { axis, slices }]);
            for (a, b) in with_filled(&lost, &gaps).data.iter().zip(&ramp().data) {
                assert!((a - b).abs() < 1e-4, "{a} {b}");
            }
        }
    }

    #[test]
    fn specks_beside_the_head_are_no_slices() {
        let head = without(&ramp(), 2, 0..5);
        let speck = Volume::from_fn(head.grid, |n| if head.grid.voxel(n) == [2, 2, 2] { 9.0 } else { head.data[n] });
        assert_eq!(blank_slices(&speck, 100.0), []);
    }

    #[test]
    fn margins_and_wide_gaps_stay_blank() {
        let margins = without(&without(&ramp(), 2, 0..3), 2, 10..12);
        assert_eq!(blank_slices(&margins, 100.0), []);
        let wide = without(&ramp(), 2, 4..8);
        assert_eq!(blank_slices(&wide, 6.0), []);
        assert_eq!(blank_slices(&wide, 8.0), [BlankSlices { axis: 2, slices: 4..8 }]);
    }
}

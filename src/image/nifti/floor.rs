//! Scans whose intensities do not begin at zero.

use super::NiftiImage;
use super::warning::NiftiWarning;

/// Intensities that begin well below zero (standardised, or stored with an offset), counted from where they begin; with a
/// warning. Air is dark in magnitude images, and everything that reads a T1 takes zero for nothing.
pub(super) fn counted_from_their_floor(image: &mut NiftiImage) {
    /// Interpolation undershoots edges by a few percent of the range: that is no floor.
    const UNDERSHOOT: f32 = 0.05;
    /// So many values tell quantiles.
    const ENOUGH: usize = 200_000;
    let data = &mut image.volume.data;
    let lowest = data.iter().copied().fold(f32::INFINITY, f32::min);
    if lowest >= 0.0 {
        return;
    }
    // Padding has the lowest value of all, however low, and says nothing of the rest.
    let stride = data.len().div_ceil(ENOUGH).max(1);
    let mut rest: Vec<f32> = data.iter().copied().step_by(stride).filter(|&x| x > lowest).collect();
    if rest.is_empty() {
        return;
    }
    rest.sort_unstable_by(f32::total_cmp);
    let [floor, top] = [rest[rest.len() / 100], rest[rest.len() - 1 - rest.len() / 100]];
    if floor < -UNDERSHOOT * (top - floor) {
        data.iter_mut().for_each(|x| *x = (*x - floor).max(0.0));
        image.warnings.push(NiftiWarning::BelowZero { floor: f64::from(floor) });
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ReadOptions, decode_scan, encode_f32};
    use crate::geometry::Pre;
    use crate::image::{Grid, Volume};

    /// A bright ball in air, and what it is read as.
    fn read(of: impl Fn(f32) -> f32 + Sync) -> (Vec<f32>, usize) {
        let grid = Grid::<Pre>::axis_aligned([20; 3], [1.0; 3], [0.0; 3]);
        let scan = Volume::from_voxels(grid, |v| {
            let from_middle: f32 = v.iter().map(|&x| (x as f32 - 9.5).powi(2)).sum::<f32>().sqrt();
            of(if from_middle < 7.0 { 400.0 + 10.0 * from_middle } else { (v[0] % 3) as f32 })
        });
        let read = decode_scan(&encode_f32(&scan), "scan.nii", &ReadOptions::default()).unwrap();
        (read.volume.data, read.warnings.len())
    }

    #[test]
    fn an_offset_is_taken_out_and_told_and_an_undershoot_or_padding_is_left() {
        let (plain, quiet) = read(|x| x);
        assert_eq!(quiet, 0);
        for by in [1000.0, 200.0] {
            let (moved, told) = read(|x| x - by);
            assert_eq!(told, 1);
            assert!(moved.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 2.0), "{by}");
        }
        let (under, told) = read(|x| x - 5.0);
        assert!(told == 0 && under[0] < 0.0);
        let (padded, told) = read(|x| if x == 0.0 { -32_768.0 } else { x });
        assert!(told == 0 && padded.iter().any(|&x| x == -32_768.0));
    }
}

//! Scans whose intensities do not begin at zero.

use super::magnitude::some_above;

/// Counts intensities that begin well below zero (standardised, or stored with an offset) from where they begin, and says
/// where that was. Air is dark in magnitude images, and everything that reads a T1 takes zero for nothing. A background of zeros
/// is nothing already, though a brain standardised within its mask has lower values: it stays 0, and all else lies above it.
pub(super) fn counted_from_their_floor(data: &mut [f32]) -> Option<f32> {
    /// Interpolation undershoots edges by a few percent of the range: that is no floor.
    const UNDERSHOOT: f32 = 0.05;
    /// One voxel of so many is exactly 0 where that is a background: a scan has hundreds of grey levels, none of which holds a
    /// twentieth of it by chance.
    const ONE_OF: usize = 20;
    /// What is no background stays so much of the range above it.
    const ABOVE_BACKGROUND: f32 = 1e-3;
    let lowest = data.iter().copied().fold(f32::INFINITY, f32::min);
    if lowest >= 0.0 {
        return None;
    }
    // Padding has the lowest value of all, however low, and says nothing of the rest.
    let mut rest = some_above(data, lowest);
    let ends = |rest: &[f32]| Some([*rest.get(rest.len() / 100)?, *rest.get(rest.len() - 1 - rest.len() / 100)?]);
    let [floor, top] = ends(&rest)?;
    if floor >= -UNDERSHOOT * (top - floor) {
        return None;
    }
    let is_common = |value: f32| ONE_OF * data.iter().filter(|x| **x == value).count() >= data.len();
    let (is_cut_out, is_padded) = (is_common(0.0), is_common(lowest));
    if !is_cut_out {
        for x in data {
            *x = (*x - floor).max(0.0);
        }
        return Some(floor);
    }
    rest.retain(|x| *x != 0.0);
    let [floor, top] = ends(&rest)?;
    let least = ABOVE_BACKGROUND * (top - floor);
    for x in data.iter_mut().filter(|x| **x != 0.0) {
        *x = if is_padded && *x == lowest { 0.0 } else { (*x - floor).max(least) };
    }
    Some(floor)
}

#[cfg(test)]
mod tests {
    use super::super::{NiftiWarning, ReadOptions, decode_scan, encode_f32};
    use super::*;
    use crate::geometry::Native;
    use crate::image::{Grid, Volume, padding};

    /// A bright ball in air, what becomes of it, and the floor that was found.
    fn counted(of: impl Fn(f32) -> f32) -> (Vec<f32>, Option<f32>) {
        let value = |n: i32| {
            let v = [n % 20, n / 20 % 20, n / 400];
            let from_middle = v.iter().map(|&x| (x as f32 - 9.5).powi(2)).sum::<f32>().sqrt();
            if from_middle < 7.0 { 400.0 + 10.0 * from_middle } else { (v[0] % 3) as f32 }
        };
        let mut data: Vec<f32> = (0..8000).map(|n| of(value(n))).collect();
        let floor = counted_from_their_floor(&mut data);
        (data, floor)
    }

    #[test]
    fn an_offset_is_taken_out_and_told_and_an_undershoot_or_padding_is_left() {
        let (plain, none) = counted(|x| x);
        assert_eq!(none, None);
        for by in [1000.0, 200.0] {
            let (moved, floor) = counted(|x| x - by);
            assert!(floor.is_some_and(|floor| (floor + by).abs() <= 2.0), "{floor:?}");
            assert!(moved.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 2.0), "{by}");
        }
        let (under, none) = counted(|x| x - 5.0);
        assert!(none.is_none() && under[0] < 0.0);
        let (padded, none) = counted(|x| if x == 0.0 { -32_768.0 } else { x });
        assert!(none.is_none() && padded.iter().any(|&x| x == -32_768.0));
        assert_eq!(counted_from_their_floor(&mut [-1.0; 5]), None);
    }

    /// A brain that is dark around its middle, standardised within its mask, as a program writes it.
    fn standardised(from_middle_mm: f64) -> f32 {
        if from_middle_mm < 70.0 { (from_middle_mm as f32 - 50.0) / 14.0 } else { 0.0 }
    }

    #[test]
    fn a_background_of_zeros_stays_nothing_and_a_standardised_brain_lies_above_it() {
        for background in [0.0, -1e4] {
            let data: Vec<f32> = (0..20_000).map(|n| standardised(f64::from(n % 200))).collect();
            let mut read = data.clone();
            // What was filled up with a value of its own is nothing either.
            (0..2000).for_each(|n| read[n] = if background < 0.0 { background } else { 0.0 });
            let before = read.clone();
            let floor = counted_from_their_floor(&mut read).unwrap();
            assert!((-3.6..-3.2).contains(&floor), "{floor}");
            for (was, is) in before.iter().zip(&read) {
                let is_nothing = *was == 0.0 || *was < -100.0;
                let expected = if is_nothing { 0.0 } else { was - floor };
                assert!((is - expected).abs() < 0.2 && (*is > 0.0) != is_nothing, "{was} {is}");
            }
        }
        // A few zeros among other values are values.
        let mut few: Vec<f32> = (0..20_000).map(|n| (n % 200) as f32 - 100.0).collect();
        counted_from_their_floor(&mut few).unwrap();
        assert!(few[100] > 90.0);
    }

    #[test]
    fn where_a_standardised_scan_ends_within_the_head_is_seen_once_it_is_read() {
        let grid = Grid::<Native>::axis_aligned([60, 60, 60], [3.0; 3], [0.0; 3]);
        let scan = Volume::from_voxels(grid, |voxel| {
            let from_middle = voxel.map(|x| (x as f64 - 29.5) * 3.0).iter().map(|x| x * x).sum::<f64>().sqrt();
            if voxel[2] < 40 { standardised(from_middle) } else { 0.0 }
        });
        let read = decode_scan(&encode_f32(&scan), "scan.nii.gz", &ReadOptions::default()).unwrap();
        assert!(read.warnings.iter().any(|w| matches!(w, NiftiWarning::BelowZero { .. })), "{:?}", read.warnings);
        assert_eq!(padding(&read.volume).len(), 1);
        assert_eq!(padding(&read.volume), padding(&scan));
        assert!(read.volume.data.iter().zip(&scan.data).all(|(is, was)| (*is == 0.0) == (*was == 0.0)));
    }
}

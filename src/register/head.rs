//! Where the head is in an image: a lenient foreground, its centre, and its range of values.

use crate::geometry::Native;
use crate::image::{Mask, Volume, coprime_stride, morphology};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Foreground lies within this distance of something brighter than half of Otsu's threshold.
const MARGIN_MM: f64 = 8.0;
/// A head's centre is taken over this height below its top, so that a neck in the field of view does not move it.
const HEAD_HEIGHT_MM: f64 = 150.0;

/// Foreground of an image: half of Otsu's threshold, then a margin that also closes cavities and sinuses.
pub(super) fn foreground(image: &Volume<f32, Native>) -> Mask<Native> {
    let threshold = half_otsu(&image.data);
    morphology::dilate(&image.map(|x| x > threshold), MARGIN_MM)
}

/// Bins of Otsu's histogram.
const BINS: usize = 256;

/// Half way from the smallest value to Otsu's threshold.
fn half_otsu(values: &[f32]) -> f32 {
    let [low, threshold] = otsu(values);
    low + 0.5 * (threshold - low)
}

/// The smallest value and the threshold that best separates two classes (Otsu 1979).
pub(super) fn otsu(values: &[f32]) -> [f32; 2] {
    let [low, high] = range_of(values, 0.0, 0.999);
    let mut histogram = [0f64; BINS];
    for &x in values {
        let b = (x - low) / (high - low) * BINS as f32;
        histogram[(b.max(0.0) as usize).min(BINS - 1)] += 1.0;
    }
    let total: f64 = histogram.iter().sum();
    let moment: f64 = histogram.iter().enumerate().map(|(b, h)| b as f64 * h).sum();
    let (mut below, mut below_moment, mut best) = (0.0, 0.0, (0.0, 0));
    for (b, h) in histogram.iter().enumerate() {
        below += h;
        below_moment += b as f64 * h;
        let above = total - below;
        if below > 0.0 && above > 0.0 {
            let contrast = below * above * (below_moment / below - (moment - below_moment) / above).powi(2);
            if contrast > best.0 {
                best = (contrast, b);
            }
        }
    }
    [low, low + (best.1 as f32 + 1.0) / BINS as f32 * (high - low)]
}

/// Two quantiles of the values, always apart; at most about 200 000 values are looked at.
pub(super) fn range_of(values: &[f32], low: f64, high: f64) -> [f32; 2] {
    let stride = coprime_stride(values.len().div_ceil(200_000), values.len());
    let mut values: Vec<f32> = values.iter().copied().step_by(stride).collect();
    if values.is_empty() {
        return [0.0, 1.0];
    }
    let last = values.len() - 1;
    let mut quantile = |q: f64| *values.select_nth_unstable_by((last as f64 * q).round() as usize, f32::total_cmp).1;
    let [a, b] = [low, high].map(&mut quantile);
    if b > a { [a, b] } else { [a, quantile(1.0).max(a + 1e-3 * a.abs().max(1.0))] }
}

/// The range of nearly all values inside a region (given on any grid).
pub(super) fn range_inside(image: &Volume<f32, Native>, region: &Mask<Native>) -> [f32; 2] {
    range_within(image, region, 0.002, 0.998)
}

/// Two quantiles of the values inside a region (given on any grid).
pub(super) fn range_within(image: &Volume<f32, Native>, region: &Mask<Native>, low: f64, high: f64) -> [f32; 2] {
    let to_region = region.grid.voxel_from_mm() * image.grid.mm_from_voxel;
    let stride = coprime_stride(image.grid.len() / 400_000, image.grid.dims[0]);
    let inside = |index: usize| {
        let [i, j, k] = image.grid.voxel(index);
        let p = to_region.transform_point(&Point3::new(i as f64, j as f64, k as f64));
        let inside = region.get(p.x.round() as isize, p.y.round() as isize, p.z.round() as isize);
        inside.unwrap_or(false).then_some(image.data[index])
    };
    let looked_at = (0..image.grid.len().div_ceil(stride)).into_par_iter();
    range_of(&looked_at.filter_map(|n| inside(n * stride)).collect::<Vec<f32>>(), low, high)
}

/// Centre of the region's upper part, in mm.
pub(super) fn centre_mm(region: &Mask<Native>) -> Vector3<f64> {
    let inside = || {
        (0..region.data.len()).filter(|&n| region.data[n]).map(|n| {
            let [i, j, k] = region.grid.voxel(n);
            region.grid.position(Point3::new(i as f64, j as f64, k as f64)).mm.coords
        })
    };
    let top = inside().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for p in inside().filter(|p| p.z > top - HEAD_HEIGHT_MM) {
        sum += p;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { Vector3::zeros() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn the_range_is_the_images_where_a_row_is_as_long_as_the_step() {
        // A column of air, which each step of a row's length meets: by the number of voxels that is the step of one, then of the other.
        for slices in [12_500, 25_000] {
            let grid = Grid::<Native>::axis_aligned([16, 16, slices], [1.0; 3], [0.0; 3]);
            let image = Volume::from_fn(grid, |n| if n % 16 == 0 { 0.0 } else { 100.0 + (n % 7) as f32 });
            let [low, high] = range_of(&image.data, 0.5, 1.0);
            assert!(low > 99.0 && high > 105.0, "{low} {high}");
            let [low, high] = range_within(&image, &image.map(|_| true), 0.5, 1.0);
            assert!(low > 99.0 && high > 105.0, "{low} {high}");
        }
    }
}

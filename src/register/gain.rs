//! The slow gain of a coil, taken out of a scan before it is compared with another.

use super::head;
use super::pyramid::reduced_to;
use crate::geometry::{Native, RigidTransform};
use crate::image::blocks::on_finer_grid;
use crate::image::gaussian::gaussian;
use crate::image::{Mask, Volume};
use rayon::prelude::*;

/// Spacing that is fine enough for a gain, mm.
const SPACING_MM: f64 = 4.0;
/// The ratio of two scans of one head changes no faster than this, mm (standard deviation of a Gaussian): wider than what moves
/// between the scans, narrower than what a single scan's own gain is told by.
const RATIO_MM: f64 = 15.0;

/// The image over its own slow gain: every neighbourhood of the head (30 mm, standard deviation) becomes equally bright on
/// average. Intensities come out in units of their neighbourhood's mean.
#[must_use]
pub fn without_gain(image: &Volume<f32, Native>) -> Volume<f32, Native> {
    /// Wider than the brain's own regions, narrower than a coil's reach.
    const SIGMA_MM: f64 = 30.0;
    /// What stands for the head's brightness where there is no head nearby.
    const FLOOR: f32 = 0.02;
    let lowest = head::range_of(&image.data, 0.0, 1.0)[0].min(0.0);
    let image = image.map(|x| x - lowest);
    let mut flat = reduced_to(&image, SPACING_MM);
    let coarse = flat.clone();
    let mut gain = coarse.map(|_| 1.0);
    // The second time the foreground is that of the flattened image: a coil's shadow has become head.
    for _ in 0..2 {
        let inside = not_air(&flat).map(|inside| f32::from(u8::from(inside)));
        let share = gaussian(&inside, SIGMA_MM);
        let bright = Volume::from_fn(coarse.grid, |n| inside.data[n] * coarse.data[n]);
        let count = inside.data.iter().sum::<f32>().max(1.0);
        let mean = bright.data.iter().sum::<f32>() / count;
        let sum = gaussian(&bright, SIGMA_MM);
        gain = Volume::from_fn(coarse.grid, |n| (sum.data[n] + FLOOR * mean) / (share.data[n] + FLOOR));
        let least = 0.02 * mean.max(f32::MIN_POSITIVE);
        flat = Volume::from_fn(coarse.grid, |n| coarse.data[n] / gain.data[n].max(least));
    }
    let least = 0.02 * gain.data.iter().copied().fold(0.0, f32::max).max(f32::MIN_POSITIVE);
    let gain = gain.map(|g| g.max(least));
    divided_by(&image, &gain)
}

/// The image over a gain that is known on a coarser grid of the same axes.
fn divided_by(image: &Volume<f32, Native>, gain: &Volume<f32, Native>) -> Volume<f32, Native> {
    let mut out = on_finer_grid(gain, &image.grid);
    out.data.par_iter_mut().zip(&image.data).for_each(|(gain, value)| *gain = value / *gain);
    out
}

/// All that is brighter than air. In logarithms the air stays apart from a brain that is a tenth as bright as the scalp.
pub(super) fn not_air(image: &Volume<f32, Native>) -> Mask<Native> {
    let unit = 0.01 * head::range_of(&image.data, 0.0, 0.999)[1].max(f32::MIN_POSITIVE);
    let logarithm = image.map(|x| (1.0 + x.max(0.0) / unit).ln());
    let [_, threshold] = head::otsu(&logarithm.data);
    logarithm.map(|x| x > threshold)
}

/// The moving scan as bright as the fixed one wherever both show a head, on average over [`RATIO_MM`]; `None` of two contrasts, whose
/// ratio is no gain.
pub(super) fn on_the_gain_of(
    fixed: &Volume<f32, Native>,
    moving: &Volume<f32, Native>,
    fixed_from_moving: &RigidTransform<Native, Native>,
) -> Option<Volume<f32, Native>> {
    /// What stands for both where there is no head nearby, as a share of a head's mean.
    const FLOOR: f32 = 0.002;
    /// Two scans of one contrast correlate by more than this once their gains are out, other contrasts by less.
    const ONE_CONTRAST: f64 = 0.4;
    let (there, here) = (reduced_to(fixed, SPACING_MM), reduced_to(moving, SPACING_MM));
    let (in_there, in_here) = (not_air(&there), not_air(&here));
    let opposite = |n: usize| fixed_from_moving.apply(here.grid.centre(here.grid.voxel(n)));
    let both = Volume::from_fn(here.grid, |n| in_here.data[n] && in_there.nearest(opposite(n)) == Some(true));
    let facing = Volume::from_fn(here.grid, |n| there.trilinear(opposite(n)).unwrap_or_default());
    let inside = (0..both.data.len()).filter(|&n| both.data[n]).map(|n| [here.data[n], facing.data[n]].map(f64::from));
    if correlation(inside) < ONE_CONTRAST {
        return None;
    }
    let mean = |value: &(dyn Fn(usize) -> f32 + Sync)| {
        let inside = Volume::from_fn(here.grid, |n| if both.data[n] { value(n) } else { 0.0 });
        gaussian(&inside, RATIO_MM).map(|x| x + FLOOR)
    };
    let ours = mean(&|n| here.data[n]);
    let theirs = mean(&|n| facing.data[n]);
    Some(divided_by(moving, &Volume::from_fn(here.grid, |n| ours.data[n] / theirs.data[n])))
}

/// Of pairs of values; zero where one of them does not change.
fn correlation(pairs: impl Iterator<Item = [f64; 2]>) -> f64 {
    let [mut count, mut x, mut y, mut xx, mut xy, mut yy] = [0.0; 6];
    for [a, b] in pairs {
        (count, x, y, xx, xy, yy) = (count + 1.0, x + a, y + b, xx + a * a, xy + a * b, yy + b * b);
    }
    let spread = (count * xx - x * x) * (count * yy - y * y);
    if spread > 0.0 { (count * xy - x * y) / spread.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use nalgebra::{Matrix4, Vector3};

    /// A gain that changes evenly comes out of the image that is nothing else, oblique or not.
    #[test]
    fn a_gain_read_on_a_coarser_grid_is_divided_out() {
        let oblique = Matrix4::new_rotation(Vector3::new(0.3, -0.2, 0.5))
            * Matrix4::new_nonuniform_scaling(&Vector3::new(1.0, 1.2, 2.0));
        let grid = Grid::<Native>::new([48, 40, 24], oblique).unwrap();
        let image = Volume::from_voxels(grid, |[i, j, k]| 10.0 + 0.2 * i as f32 - 0.1 * j as f32 + 0.3 * k as f32);
        let flat = divided_by(&image, &reduced_to(&image, 4.0));
        for (n, x) in flat.data.iter().enumerate() {
            let voxel = grid.voxel(n);
            if (0..3).all(|a| (8..grid.dims[a] - 8).contains(&voxel[a])) {
                assert!((x - 1.0).abs() < 1e-4, "{voxel:?} {x}");
            }
        }
    }
}

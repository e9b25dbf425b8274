//! The post-operative intensities on the pre-operative scale.

use crate::geometry::Mni;
use crate::image::blocks::{block_means, on_finer_grid};
use crate::image::gaussian::gaussian;
use crate::image::{Mask, Volume};

/// Divides `post` by the smooth ratio post/pre seen over `tissue`, so that what has not changed has the pre-operative
/// intensity and thresholds learnt on `pre` hold: scanner gain, bias of either coil and contrast in one step.
///
/// The ratio is averaged (as logarithms, with a Gaussian of `sigma_mm`) twice: the second time without the voxels
/// that lie far from the first average, which the cavity and the sulci would pull down.
pub fn on_the_scale_of(
    pre: &Volume<f32, Mni>,
    post: &Volume<f32, Mni>,
    tissue: &Mask<Mni>,
    sigma_mm: f64,
) -> Volume<f32, Mni> {
    let log_ratio = Volume::from_fn(pre.grid, |n| (post.data[n].max(1e-3) / pre.data[n].max(1e-3)).ln()).data;
    let mut usable: Vec<f32> =
        log_ratio.iter().zip(&tissue.data).filter(|(r, inside)| **inside && r.is_finite()).map(|(r, _)| *r).collect();
    if usable.is_empty() {
        return post.clone();
    }
    let middle = usable.len() / 2;
    let median = *usable.select_nth_unstable_by(middle, f32::total_cmp).1;
    let factor = (sigma_mm / (BLOCKS_PER_SIGMA * pre.grid.spacing_mm()[0])).max(1.0) as usize;
    let mut expected = Volume::filled(pre.grid, median);
    // Half and double are wide for a bias of 30 % either way; the second limit is what tissue contrast allows.
    for limit in [std::f32::consts::LN_2, 0.25] {
        let near = |n: usize| tissue.data[n] && (log_ratio[n] - expected.data[n]).abs() < limit;
        let weight = block_means(&pre.grid, factor, |n| f32::from(near(n)));
        let weighted = block_means(&pre.grid, factor, |n| if near(n) { log_ratio[n] - median } else { 0.0 });
        let [weight, weighted] = [weight, weighted].map(|v| gaussian(&v, sigma_mm));
        // The small weight draws places without tissue to the median.
        let smooth = Volume::from_fn(weight.grid, |n| median + weighted.data[n] / (weight.data[n] + 1e-3));
        expected = on_finer_grid(&smooth, &pre.grid);
    }
    Volume::from_fn(post.grid, |n| post.data[n] / expected.data[n].exp())
}

/// A Gaussian is smoothed on blocks this much smaller than its standard deviation.
const BLOCKS_PER_SIGMA: f64 = 6.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn gain_and_bias_are_taken_out_and_a_dark_hole_stays_dark() {
        let grid = Grid::axis_aligned([40, 40, 40], [2.0; 3], [0.0; 3]);
        let pre = Volume::filled(grid, 100.0f32);
        let hole = |v: [usize; 3]| (10..18).contains(&v[0]) && (10..18).contains(&v[1]) && (10..18).contains(&v[2]);
        let data = (0..grid.len()).map(|n| {
            let v = grid.voxel(n);
            let bias = 3.0 * (1.0 + 0.2 * (v[0] as f32 / 20.0 - 1.0));
            bias * if hole(v) { 20.0 } else { 100.0 }
        });
        let post = Volume::from_data(grid, data.collect());
        let corrected = on_the_scale_of(&pre, &post, &pre.map(|_| true), 20.0);
        assert!((corrected.at(30, 30, 30) - 100.0).abs() < 4.0, "{}", corrected.at(30, 30, 30));
        assert!((corrected.at(14, 14, 14) - 20.0).abs() < 2.0, "{}", corrected.at(14, 14, 14));
    }
}

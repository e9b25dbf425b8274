//! Noise, taken down where there is too much of it to tell tissue from fluid voxel by voxel.
//!
//! The brain's mask asks every voxel whether it may be tissue, and cuts what hangs together by too little. In a coil's
//! shadow the scan's noise has been made brighter with the rest: so many voxels of the cortex then fall out of the window
//! that nothing hangs together, and the crown would be lost in a scan that shows it plainly.

use super::coil::in_blocks;
use super::mixture::Mixture;
use super::priors::AtlasPriors;
use crate::geometry::Mni;
use crate::image::blocks::on_finer_grid;
use crate::image::gaussian::gaussian;
use crate::image::{Mask, Volume};

/// White matter as the template expects it: there differences between neighbours are noise.
const WHITE: f32 = 0.85;
const DEPTH_MM: f32 = 2.0;
/// Noise is read over this neighbourhood (standard deviation): as wide as a coil's gain changes.
const SIGMA_MM: f64 = 15.0;
/// So many standard deviations of noise between grey matter and the border to fluid leave one voxel of a hundred on the
/// wrong side.
const CLEAR: f64 = 2.5;
/// From so many times that much noise on, the average stands in full.
const FULL: f32 = 1.25;
/// The neighbourhood that is averaged where there are fewer (standard deviation): narrower than the cortex.
const AVERAGED_MM: f64 = 1.2;

/// The image, averaged over neighbours where noise would decide what is tissue; `None` where there is none of that much.
pub(super) fn calmed(
    t1: &Volume<f32, Mni>,
    known: &Mask<Mni>,
    priors: &AtlasPriors,
    model: &Mixture,
) -> Option<Volume<f32, Mni>> {
    let grid = t1.grid;
    let white = |n: usize| known.data[n] && priors.brain_mm.data[n] < -DEPTH_MM && priors.tissue[2].data[n] > WHITE;
    let averaged = gaussian(t1, AVERAGED_MM);
    // What averaging takes away, whatever the scan's own voxels were: neighbours on this grid may have been interpolated.
    let variance = |n: usize| (t1.data[n] - averaged.data[n]).powi(2);
    let seen = gaussian(&in_blocks(&grid, |n| if white(n) { variance(n) } else { 0.0 }), SIGMA_MM);
    let count = gaussian(&in_blocks(&grid, |n| f32::from(u8::from(white(n)))), SIGMA_MM);
    let least = 1e-4 * count.data.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let limit = ((model.means[1] - model.csf_grey_border()) / CLEAR).max(1e-6) as f32;
    let excess = Volume::from_fn(seen.grid, |n| {
        let noise = (seen.data[n] / count.data[n].max(least)).sqrt();
        ((noise / limit - 1.0) / (FULL - 1.0)).clamp(0.0, 1.0)
    });
    if excess.data.iter().all(|&x| x == 0.0) {
        return None;
    }
    let share = on_finer_grid(&excess, &grid);
    Some(Volume::from_fn(grid, |n| t1.data[n] + share.data[n] * (averaged.data[n] - t1.data[n])))
}

#[cfg(test)]
mod tests {
    use super::super::atlas;
    use super::super::brain::{BrainSettings, brain_mask};
    use super::super::mixture::{MixtureSettings, fit_mixture};
    use super::*;

    /// The template with independent noise of a standard deviation that grows towards the crown, from 0.
    fn noisy(most: f32) -> Volume<f32, Mni> {
        let template = atlas::template().t1_f32();
        let grid = template.grid;
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
        };
        let noise: Vec<f32> =
            (0..grid.len()).map(|_| (uniform() + uniform() + uniform() + uniform()) * 3f32.sqrt()).collect();
        Volume::from_fn(grid, |n| {
            let height = (grid.voxel(n)[2] as f32 / grid.dims[2] as f32).clamp(0.0, 1.0);
            template.data[n] + most * height * noise[n]
        })
    }

    fn model(t1: &Volume<f32, Mni>, priors: &AtlasPriors) -> Mixture {
        let settings = MixtureSettings {
            iterations: 10,
            bias_order: 0,
            bias_starts_at: 5,
            neighbour_weight: 0.0,
            disbelief: 0.3,
            stride: 2,
        };
        fit_mixture(t1, &priors.brain_mm.map(|mm| mm < -4.0), priors, &settings, None).unwrap()
    }

    #[test]
    fn less_of_the_brain_is_lost_in_noise() {
        let template = atlas::template().t1_f32();
        let (known, priors) = (template.map(|_| true), AtlasPriors::rigid(&template.grid));
        let brain_cc = |t1: &Volume<f32, Mni>, model: &Mixture| {
            brain_mask(t1, &known, model, &priors, &BrainSettings::default()).volume_cc()
        };
        let scan = noisy(90.0);
        let (clear, noisy) = (model(&template, &priors), model(&scan, &priors));
        let own_cc = brain_cc(&template, &clear);
        let calm = calmed(&scan, &known, &priors, &noisy).unwrap();
        let (found_cc, lost_cc) = (brain_cc(&calm, &noisy), brain_cc(&scan, &noisy));
        assert!((found_cc / own_cc - 1.0).abs() < 0.03, "{found_cc} of {own_cc}");
        assert!((own_cc - found_cc).abs() < own_cc - lost_cc, "{found_cc} and {lost_cc} of {own_cc}");
    }

    #[test]
    fn noise_is_taken_down_where_it_would_decide_and_nothing_else_is_touched() {
        let template = atlas::template().t1_f32();
        let (grid, known, priors) = (template.grid, template.map(|_| true), AtlasPriors::rigid(&template.grid));
        assert!(calmed(&template, &known, &priors, &model(&template, &priors)).is_none());
        let scan = noisy(60.0);
        let calm = calmed(&scan, &known, &priors, &model(&scan, &priors)).unwrap();
        let error = |v: &Volume<f32, Mni>, heights: std::ops::Range<usize>| {
            let inside = |n: usize| heights.contains(&grid.voxel(n)[2]) && priors.brain_mm.data[n] < -2.0;
            let squares: Vec<f32> =
                (0..grid.len()).filter(|&n| inside(n)).map(|n| (v.data[n] - template.data[n]).powi(2)).collect();
            (squares.iter().map(|&x| f64::from(x)).sum::<f64>() / squares.len() as f64).sqrt()
        };
        let crown = grid.dims[2] * 3 / 4..grid.dims[2];
        assert!(error(&calm, crown.clone()) < 0.4 * error(&scan, crown), "the crown");
        let base = 0..grid.dims[2] / 8;
        assert!(error(&calm, base.clone()) <= error(&scan, base), "the base");
    }
}

//! Blood in the cavity: as bright as tissue, but without the folds that were there.

use super::cavity::{CavitySettings, grow, settled, with_fluid_of};
use super::sets::{both, either};
use super::window::Window;
use crate::geometry::Mni;
use crate::image::morphology::{dilate, open};
use crate::image::{Mask, Volume};

/// Windows in which the folds of both scans are compared, standard deviation in mm.
const WINDOW_MM: f64 = 2.5;
/// Noise is smoothed with this first, mm; folds are wider.
const NOISE_MM: f64 = 1.0;

/// Both scans where the post-operative one was taken, the pre-operative one moved with the sag.
#[derive(Clone, Copy, Debug)]
pub(super) struct SaggedPair<'a> {
    /// Pre-operative intensities, carried along.
    pub pre: &'a Volume<f32, Mni>,
    /// Pre-operative grey and white matter, carried along.
    pub tissue: &'a Mask<Mni>,
    /// Pre-operative brain, carried along.
    pub brain: &'a Mask<Mni>,
    /// Post-operative intensities on the pre-operative scale.
    pub post: &'a Volume<f32, Mni>,
    /// Where the post-operative scan looked.
    pub post_known: &'a Mask<Mni>,
    /// Intensity between CSF and grey matter.
    pub csf_grey_border: f64,
    /// White matter's mean intensity less grey matter's.
    pub grey_white_contrast: f64,
}

/// The cavity with the blood that lies in it, found where the folds next to the dark part are gone.
///
/// Sagging tissue has moved with the sag, so its folds correlate; blood has none. Windows whose folds had less than a sixth
/// of the contrast between grey and white matter (as standard deviation) had nothing to lose and say nothing.
pub(super) fn with_blood(cavity: &Mask<Mni>, pair: &SaggedPair<'_>, settings: &CavitySettings) -> Mask<Mni> {
    let dark = pair.post.map(|x| f64::from(x) < pair.csf_grey_border);
    let edge_of_dark = dilate(&dark, 1.0);
    let comparable =
        Mask::from_fn(dark.grid, |n| pair.brain.data[n] && pair.post_known.data[n] && !edge_of_dark.data[n]);
    let least = (pair.grey_white_contrast / 6.0).powi(2) as f32;
    let lost = open(&folds_lost(pair.pre, pair.post, &comparable, least, settings.folds_kept as f32), 1.5);
    // Between the dark part and the blood lies a rim of mixed voxels.
    let passable = either(&dilate(&lost, 1.0), &edge_of_dark);
    let start = dilate(cavity, 1.0);
    let grown = grow(&both(&start, &passable), &both(&passable, pair.brain), settings.blood_mm);
    let blood = both(&grown, &dilate(&lost, 1.5));
    if blood.volume_cc() < settings.smallest_cc {
        return cavity.clone();
    }
    let found = either(&blood, cavity);
    let found = settled(&found, pair.brain, settings.closing_mm);
    both(&with_fluid_of(&found, pair.tissue, settings.surroundings_mm), pair.brain)
}

/// Comparable voxels whose window has a pattern on `pre` (variance of at least `least`) that correlates with `post` by
/// less than `kept`.
fn folds_lost(
    pre: &Volume<f32, Mni>,
    post: &Volume<f32, Mni>,
    comparable: &Mask<Mni>,
    least: f32,
    kept: f32,
) -> Mask<Mni> {
    let window = Window::new(comparable, WINDOW_MM);
    let noise = Window::new(comparable, NOISE_MM);
    let (a, b) = (noise.mean(pre), noise.mean(post));
    let product = |x: &Volume<f32, Mni>, y: &Volume<f32, Mni>| Volume::from_fn(x.grid, |n| x.data[n] * y.data[n]);
    let (mean_a, mean_b) = (window.mean(&a), window.mean(&b));
    let (aa, bb, ab) = (window.mean(&product(&a, &a)), window.mean(&product(&b, &b)), window.mean(&product(&a, &b)));
    let lost = |n: usize| {
        let (ma, mb) = (mean_a.data[n], mean_b.data[n]);
        let (var_a, var_b) = (aa.data[n] - ma * ma, bb.data[n] - mb * mb);
        comparable.data[n] && var_a > least && ab.data[n] - ma * mb < kept * (var_a * var_b.max(0.1 * least)).sqrt()
    };
    Mask::from_fn(pre.grid, lost)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;

    #[test]
    fn a_smooth_pool_is_told_from_folds_that_are_still_there() {
        let grid = Grid::axis_aligned([50, 40, 40], [1.0; 3], [0.0; 3]);
        let fold = |v: [usize; 3]| 100.0 + 40.0 * (v[0] as f32 * 0.7 + v[2] as f32 * 0.3).sin().signum();
        let image = |f: &dyn Fn([usize; 3]) -> f32| {
            Volume::from_data(grid, (0..grid.len()).map(|n| f(grid.voxel(n))).collect())
        };
        let pre = image(&fold);
        let post = image(&|v| if v[0] >= 25 { 135.0 + (v[1] % 3) as f32 } else { 1.2 * fold(v) + 5.0 });
        let lost = folds_lost(&pre, &post, &pre.map(|_| true), 200.0, 0.4);
        assert!(lost.at(38, 20, 20) && lost.at(32, 10, 25));
        assert!(!lost.at(10, 20, 20) && !lost.at(15, 10, 25));
    }
}

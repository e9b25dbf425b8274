//! Whether two scans show one head: one brain has the same folds twice, two brains do not.

use crate::geometry::{AffineTransform, Frame, Mni, RigidTransform};
use crate::image::gaussian::{gaussian, gaussian_along_axes};
use crate::image::morphology::erode;
use crate::image::resample::{Interpolation, grid_with_spacing, resample, resample_nearest};
use crate::image::{Mask, Volume};
use crate::register::deformable::{DeformableSettings, fit_atlas};
use crate::segment::atlas;
use serde::{Deserialize, Serialize};

/// Folds are wider than this, mm; scans of 1 mm and of 5 mm are compared alike.
const SPACING_MM: f64 = 2.0;
/// Windows in which the scans are compared, standard deviation in mm: a gyrus with its sulci.
const WINDOW_MM: f64 = 4.0;
/// How wide the gain of a coil varies, standard deviation of a window in mm.
const COIL_MM: f64 = 15.0;
/// The mean head's brain less a rim in which a patient's skull may lie, mm.
const RIM_MM: f64 = 5.0;
/// Tissue that sinks hardly changes its volume; a movement that swells or shrinks it by more than this makes one head of
/// another.
const MOST_SWELLING: f64 = 1.15;
/// With fewer windows than this on either side nothing is said about that side (200 cc of folds are 25 000).
const FEWEST: usize = 2500;

/// How alike the folds of two scans are once one lies on the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Likeness {
    /// Median over the windows of a hemisphere of the correlation within a window; of the two hemispheres the better one,
    /// since an operation changes one of them. Where a rigid motion does not bring the folds together, after the smooth
    /// movement that does so best: a brain that has sunk by a sulcus' width is still the same brain.
    pub folds: f64,
    /// Windows looked at.
    pub windows: usize,
}

impl Likeness {
    /// Below this the scans do not show one head, or one does not lie on the other.
    ///
    /// Between what one head has shown under other gains, noise and slices of 5 mm, and what two heads have, even two that are
    /// warped from one template; a pose that is off by the width of a sulcus falls below it, too. `./run bench pairs` looks at it
    /// again.
    pub const ONE_HEAD: f64 = 0.8;

    /// Folds that follow each other upside down this far are one head's: what is bright in one scan is dark in the other. What two
    /// T1 scans of two heads have in common is the right way up.
    const REVERSED: f64 = -0.5;

    /// Whether bright and dark tissue have changed places: another weighting, not another head.
    pub fn is_reversed(&self) -> bool {
        self.folds <= Self::REVERSED
    }

    /// Whether this is one head.
    pub fn is_one_head(&self) -> bool {
        self.folds >= Self::ONE_HEAD
    }
}

/// Compares the folds of two scans of one contrast, over the middle of where the template has its brain; `None` where too
/// little of the brain is seen in both.
///
/// Correlation within small windows asks neither for the same gain nor for the same bias, and noise or slices of 5 mm lower
/// it far less than other folds do.
pub fn likeness<A: Frame, B: Frame>(
    pre: &Volume<f32, A>,
    post: &Volume<f32, B>,
    mni_from_pre: &RigidTransform<A, Mni>,
    mni_from_post: &RigidTransform<B, Mni>,
) -> Option<Likeness> {
    // The mean head's brain, since the template's own is larger than people are.
    let brain = &atlas::mean_head().brain;
    let grid = grid_with_spacing(&brain.grid, [SPACING_MM; 3]);
    let inner = resample_nearest(&erode(brain, RIM_MM).map(u8::from), &grid, &AffineTransform::identity(), 0);
    let a = resample(&smoothed(pre), &grid, &mni_from_pre.inverse().to_affine(), Interpolation::Linear, 0.0);
    let b = resample(&smoothed(post), &grid, &mni_from_post.inverse().to_affine(), Interpolation::Linear, 0.0);
    // Zeros are what defacing, padding and masks leave: no tissue is exactly black in both.
    let seen = |n: usize| a.inside.data[n] && b.inside.data[n] && a.volume.data[n] > 0.0 && b.volume.data[n] > 0.0;
    let known = Mask::from_fn(grid, |n| inner.data[n] > 0 && seen(n));
    let rigid = compared(&a.volume, &b.volume, &known)?;
    if rigid.is_one_head() {
        return Some(rigid);
    }
    let whole = resample_nearest(&brain.map(u8::from), &grid, &AffineTransform::identity(), 0);
    // Without the gain of coils, which the fit would take for movement.
    let brain_in = |inside: &Mask<Mni>| Mask::from_fn(grid, |n| whole.data[n] > 0 && inside.data[n]);
    let shown = brain_in(&a.inside);
    let (level_a, level_b) = (levelled(&a.volume, &shown), levelled(&b.volume, &brain_in(&b.inside)));
    let before = Volume::from_fn(grid, |n| if shown.data[n] { level_a.data[n].max(1e-3) } else { 0.0 });
    let after = Volume::from_fn(grid, |n| if b.inside.data[n] { level_b.data[n] } else { f32::NAN });
    let Ok(fit) = fit_atlas(&after, &before, &AffineTransform::identity(), None, &smooth_movement()) else {
        return Some(rigid);
    };
    if fit.quality.smallest_jacobian < 1.0 / MOST_SWELLING || fit.quality.largest_jacobian > MOST_SWELLING {
        return Some(rigid);
    }
    let [back] = fit.subject_from_atlas.warp([&b.volume], &grid);
    let moved = compared(&a.volume, &back, &known)?;
    Some(if moved.folds > rigid.folds { moved } else { rigid })
}

/// As brains sink: smooth over centimetres. No such movement lays one person's folds on another's.
fn smooth_movement() -> DeformableSettings {
    DeformableSettings {
        levels_mm: vec![8.0, 4.0],
        iterations: vec![30, 30],
        update_sigma_voxels: 5.0,
        margin_mm: 4.0,
        affine: false,
        ..DeformableSettings::default()
    }
}

/// Thin voxels averaged to about the spacing they are read at.
fn smoothed<F: Frame>(scan: &Volume<f32, F>) -> Volume<f32, F> {
    let sigma = |size_mm: f64| 0.5 * (SPACING_MM * SPACING_MM - size_mm * size_mm).max(0.0).sqrt();
    gaussian_along_axes(scan, scan.grid.spacing_mm().map(sigma))
}

/// The scan over the mean of its brain within a wide window: without the gain of a coil that is near to one side.
fn levelled(scan: &Volume<f32, Mni>, brain: &Mask<Mni>) -> Volume<f32, Mni> {
    let weight = gaussian(&brain.map(f32::from), COIL_MM);
    let sum = gaussian(&Volume::from_fn(scan.grid, |n| if brain.data[n] { scan.data[n] } else { 0.0 }), COIL_MM);
    Volume::from_fn(scan.grid, |n| scan.data[n] * weight.data[n].max(1e-6) / sum.data[n].max(1e-6))
}

fn compared(a: &Volume<f32, Mni>, b: &Volume<f32, Mni>, known: &Mask<Mni>) -> Option<Likeness> {
    let weight = gaussian(&known.map(f32::from), WINDOW_MM);
    let mean = |value: &(dyn Fn(usize) -> f32 + Sync)| {
        let sum = gaussian(&Volume::from_fn(known.grid, |n| if known.data[n] { value(n) } else { 0.0 }), WINDOW_MM);
        Volume::from_fn(known.grid, |n| sum.data[n] / weight.data[n].max(1e-4))
    };
    let (mean_a, mean_b) = (mean(&|n| a.data[n]), mean(&|n| b.data[n]));
    // About the local mean, or squares of bright images lose the small differences in 32 bits.
    let (da, db) = (|n: usize| a.data[n] - mean_a.data[n], |n: usize| b.data[n] - mean_b.data[n]);
    let (aa, bb, ab) = (mean(&|n| da(n) * da(n)), mean(&|n| db(n) * db(n)), mean(&|n| da(n) * db(n)));
    // Half of the windows have folds to speak of, relative to the brightness there.
    let contrast = |n: usize| aa.data[n] / (mean_a.data[n] * mean_a.data[n]).max(1e-6);
    let mut contrasts: Vec<f32> =
        (0..known.data.len()).filter(|&n| known.data[n]).map(contrast).filter(|c| c.is_finite()).collect();
    if contrasts.is_empty() {
        return None;
    }
    let middle = contrasts.len() / 2;
    let least = *contrasts.select_nth_unstable_by(middle, f32::total_cmp).1;
    let mut sides: [Vec<f32>; 2] = [Vec::new(), Vec::new()];
    for n in (0..known.data.len()).filter(|&n| known.data[n] && contrast(n) > least) {
        let x_mm = known.grid.position(known.grid.voxel(n).map(|v| v as f64).into()).mm.x;
        let correlation = ab.data[n] / (aa.data[n] * bb.data[n]).sqrt().max(1e-12);
        sides[usize::from(x_mm > 0.0)].push(correlation.clamp(-1.0, 1.0));
    }
    let windows = sides.iter().map(Vec::len).sum();
    let median = |mut side: Vec<f32>| {
        let middle = side.len() / 2;
        (side.len() >= FEWEST).then(|| f64::from(*side.select_nth_unstable_by(middle, f32::total_cmp).1))
    };
    let folds = sides.into_iter().filter_map(median).max_by(f64::total_cmp)?;
    Some(Likeness { folds, windows })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use nalgebra::Vector3;

    fn template() -> Volume<f32, Mni> {
        atlas::template().t1_f32()
    }

    fn folds(a: &Volume<f32, Mni>, b: &Volume<f32, Mni>) -> f64 {
        let same = RigidTransform::<Mni, Mni>::identity();
        likeness(a, b, &same, &same).unwrap().folds
    }

    #[test]
    fn another_gain_and_bias_leave_one_head_one_head_and_mirroring_does_not() {
        let one = template();
        let other = Volume::from_fn(one.grid, |n| {
            let v = one.grid.voxel(n).map(|v| v as f32);
            let noise = ((n as u32).wrapping_mul(2_654_435_761) >> 16) as f32 / 65_536.0 - 0.5;
            (3.0 * one.data[n] * (1.0 + 0.3 * (v[0] / 90.0 - 1.0)) * (1.0 + 0.3 * (v[2] / 90.0 - 1.0)) + 90.0 * noise)
                .max(0.0)
        });
        assert!(folds(&one, &other) > 0.9, "{}", folds(&one, &other));
        // The head moved by a gyrus' width is another pattern of folds in the same skull.
        let same = RigidTransform::<Mni, Mni>::identity();
        let moved = RigidTransform::<Mni, Mni>::about(
            nalgebra::Point3::origin(),
            Vector3::zeros(),
            Vector3::new(0.0, 12.0, 6.0),
        );
        let off = likeness(&one, &one, &same, &moved).unwrap();
        assert!(!off.is_one_head() && off.folds < 0.7, "{off:?}");
    }

    #[test]
    fn one_head_in_another_weighting_is_told_from_another_head() {
        let one = template();
        let brightest = one.data.iter().copied().fold(0.0f32, f32::max);
        let reversed = one.map(|t1| if t1 > 0.0 { 1.2 * brightest - t1 } else { 0.0 });
        let same = RigidTransform::<Mni, Mni>::identity();
        let found = likeness(&one, &reversed, &same, &same).unwrap();
        assert!(found.is_reversed() && !found.is_one_head(), "{found:?}");
        let moved = RigidTransform::<Mni, Mni>::about(
            nalgebra::Point3::origin(),
            Vector3::zeros(),
            Vector3::new(0.0, 12.0, 6.0),
        );
        assert!(!likeness(&one, &one, &same, &moved).unwrap().is_reversed());
    }

    /// The template's brain sunk by up to so much, as smoothly as brains do.
    fn sunk(one: &Volume<f32, Mni>, most_mm: f64) -> Volume<f32, Mni> {
        Volume::from_fn(one.grid, |n| {
            let p = one.grid.position(one.grid.voxel(n).map(|v| v as f64).into());
            let off = p.mm.coords - Vector3::new(20.0, -20.0, 40.0);
            let by = most_mm * (-0.5 * off.norm_squared() / (50.0 * 50.0)).exp();
            let from = crate::geometry::Position::from_point(p.mm + Vector3::new(0.0, 0.5 * by, by));
            one.trilinear(from).unwrap_or(0.0)
        })
    }

    #[test]
    fn a_brain_that_has_sunk_by_the_width_of_a_sulcus_is_one_head() {
        let one = template();
        let folds = folds(&one, &sunk(&one, 9.0));
        assert!(folds > 0.9, "{folds}");
    }

    #[test]
    fn a_sunk_brain_beside_a_surface_coil_is_one_head() {
        let one = template();
        let coil = |scan: Volume<f32, Mni>, axis: usize, per_mm: f64| {
            Volume::from_fn(scan.grid, |n| {
                let p = scan.grid.position(scan.grid.voxel(n).map(|v| v as f64).into());
                scan.data[n] * (per_mm * p.mm[axis]).exp() as f32
            })
        };
        // Four times as bright on the left as on the right, and at the back as in front.
        let (pre, post) = (coil(one.clone(), 1, -4.0f64.ln() / 170.0), coil(sunk(&one, 6.0), 0, -4.0f64.ln() / 140.0));
        let folds = folds(&pre, &post);
        assert!(folds > 0.9, "{folds}");
    }

    #[test]
    fn a_hemisphere_taken_out_leaves_one_head_and_nothing_in_common_says_nothing() {
        let one = template();
        let half = Volume::from_fn(one.grid, |n| if one.grid.voxel(n)[0] < 95 { 20.0 } else { one.data[n] });
        assert!(folds(&one, &half) > 0.95);
        let far: RigidTransform<Pre, Mni> =
            RigidTransform::new(nalgebra::UnitQuaternion::identity(), Vector3::new(0.0, 0.0, 500.0));
        let pre: Volume<f32, Pre> = one.clone().relabelled();
        assert_eq!(likeness(&pre, &one, &far, &RigidTransform::identity()), None);
    }
}

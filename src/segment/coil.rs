//! The gain of a surface coil, taken out before tissues are told apart.
//!
//! Where a coil sees the crown twice as bright as the brainstem, classes of intensity mean nothing until that is known, and
//! the gain that the mixture finds beside its classes is found from wrong ones. The carried template knows how bright the
//! brain should be on average around each point: what the scan shows there instead is the gain.

use super::priors::AtlasPriors;
use crate::geometry::Mni;
use crate::image::blocks::{block_means, on_finer_grid};
use crate::image::gaussian::gaussian;
use crate::image::{Grid, Mask, Volume};
use nalgebra::{Matrix4, Vector3, Vector4};
use rayon::prelude::*;

/// Brightness of CSF, grey and white matter on a T1-weighted scan, over white matter's. Differences between scanners are the
/// same everywhere and average out.
const BRIGHTNESS: [f32; 3] = [0.35, 0.7, 1.0];
/// Averages are taken over this neighbourhood (standard deviation): wider than a lobe's own tissue, narrower than a coil's
/// reach.
const SIGMA_MM: f64 = 15.0;
/// Voxels along each axis of the blocks that are averaged first.
const BLOCK: usize = 4;
/// Standard deviation over the brain of the logarithm of the gain below which nothing is taken out: head coils and the
/// template's own misfit stay below; the mixture finds that much by itself.
const STRONG: f64 = 0.2;
/// A neighbourhood's average holds half of what changes within its width, the next round half of the rest (twicing: Tukey
/// 1977): coils that lie around the head make a bright shell hardly wider than the neighbourhood.
const ROUNDS: usize = 3;
/// Far outside the brain, where only the slope speaks, the gain stays within this and one over this of the usual one.
const LEAST_GAIN: f64 = 0.2;
/// Two coordinates of six, whose products make a moment.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];
/// The surface itself is left out: how much CSF lies there is the patient's.
const DEPTH_MM: f32 = 2.0;

/// The logarithm of a strong gain on a coarse grid, and how many times brighter than its dark parts (each a sixth of the brain or
/// so) it makes the bright ones; without it the brain is as bright as before on average. `None` where it is not strong.
pub(super) fn strong_gain(
    t1: &Volume<f32, Mni>,
    known: &Mask<Mni>,
    priors: &AtlasPriors,
) -> Option<(Volume<f32, Mni>, f64)> {
    let inside = |n: usize| known.data[n] && priors.brain_mm.data[n] < -DEPTH_MM;
    let expected = |n: usize| (0..3).map(|k| BRIGHTNESS[k] * priors.tissue[k].data[n]).sum::<f32>();
    let (grid, share) = (t1.grid, in_blocks(&t1.grid, |n| f32::from(u8::from(inside(n)))));
    let seen = gaussian(&in_blocks(&grid, |n| if inside(n) { t1.data[n] } else { 0.0 }), SIGMA_MM);
    let wanted = gaussian(&in_blocks(&grid, |n| if inside(n) { expected(n) } else { 0.0 }), SIGMA_MM);
    let sum = |v: &Volume<f32, Mni>| v.data.iter().map(|&x| f64::from(x)).sum::<f64>();
    let usual = (sum(&seen) / sum(&wanted).max(1e-9)) as f32;
    if usual <= 0.0 {
        return None;
    }
    // Far from the brain there is nothing to compare: the gain becomes the usual one.
    let floor = 0.01 * wanted.data.iter().copied().fold(0.0, f32::max);
    let log_gain =
        Volume::from_fn(seen.grid, |n| ((seen.data[n] / usual + floor) / (wanted.data[n] + floor)).max(1e-3).ln());
    let moment = |power: i32, about: f64| {
        let total: f64 = (share.data.iter().zip(&log_gain.data))
            .map(|(&w, &g)| f64::from(w) * (f64::from(g) - about).powi(power))
            .sum();
        total / sum(&share).max(1.0)
    };
    let mean = moment(1, 0.0);
    let spread = moment(2, mean).sqrt();
    if spread < STRONG {
        return None;
    }
    let mut found = Volume::filled(seen.grid, -mean as f32);
    for _ in 0..ROUNDS {
        let more = sloping(&evened(t1, &found), &grid, usual * (mean as f32).exp(), inside, expected);
        found.data.iter_mut().zip(&more.data).for_each(|(found, more)| *found += more);
    }
    // One standard deviation to either side of a Gaussian leaves 16 % beyond each.
    Some((found, (2.0 * spread).exp()))
}

/// A scan with a gain taken out whose logarithm is known on a coarser grid.
pub(super) fn evened(t1: &Volume<f32, Mni>, log_gain: &Volume<f32, Mni>) -> Volume<f32, Mni> {
    let mut out = on_finer_grid(log_gain, &t1.grid);
    out.data.par_iter_mut().zip(&t1.data).for_each(|(gain, value)| *gain = value * (-*gain).exp());
    out
}

/// The logarithm of the gain over the usual one, found at every point with its slope there.
///
/// An average over a neighbourhood that ends at the surface is the gain some millimetres inside. Just where a surface coil
/// sees most, the rim then stays too bright, and fluid and dura pass for cortex. With the slope the gain is carried on to
/// what lies around the brain (local linear regression: Cleveland 1979; Fan 1993).
fn sloping(
    t1: &Volume<f32, Mni>,
    grid: &Grid<Mni>,
    usual: f32,
    inside: impl Fn(usize) -> bool + Sync,
    expected: impl Fn(usize) -> f32 + Sync,
) -> Volume<f32, Mni> {
    /// What a slope is held to: the template's own misfit in so many independent places, and the reach of coils.
    const RIDGE_MM2: f64 = 4.0;
    /// Weight of the usual gain, over the largest weight of a neighbourhood.
    const FLOOR: f64 = 1e-3;
    let seen = in_blocks(grid, |n| if inside(n) { t1.data[n] / usual } else { 0.0 });
    let wanted = in_blocks(grid, |n| if inside(n) { expected(n) } else { 0.0 });
    let blocks = seen.grid;
    let place = |n: usize| blocks.centre(blocks.voxel(n)).mm.coords;
    let sum = |value: &(dyn Fn(usize, &Vector3<f64>) -> f64 + Sync)| {
        gaussian(&Volume::from_fn(blocks, |n| value(n, &place(n)) as f32), SIGMA_MM)
    };
    let (square, both) =
        (|n: usize| f64::from(wanted.data[n]).powi(2), |n: usize| f64::from(wanted.data[n]) * f64::from(seen.data[n]));
    let weight = sum(&|n, _| square(n));
    let first = [0, 1, 2].map(|a| sum(&|n, p| square(n) * p[a]));
    let second = PAIRS.map(|[a, b]| sum(&|n, p| square(n) * p[a] * p[b]));
    let level = sum(&|n, _| both(n));
    let sloped = [0, 1, 2].map(|a| sum(&|n, p| both(n) * p[a]));
    let floor = FLOOR * f64::from(weight.data.iter().copied().fold(0.0, f32::max));
    Volume::from_fn(blocks, |n| {
        let (x, w, r) = (place(n), f64::from(weight.data[n]), f64::from(level.data[n]));
        let about = Vector3::from_fn(|a, _| f64::from(first[a].data[n]) - x[a] * w);
        let right = Vector3::from_fn(|a, _| f64::from(sloped[a].data[n]) - x[a] * r);
        let mut normal = Matrix4::zeros();
        normal[(0, 0)] = w + floor;
        for (pair, [a, b]) in PAIRS.into_iter().enumerate() {
            let moment = f64::from(second[pair].data[n]) - x[a] * f64::from(first[b].data[n]) - x[b] * about[a];
            normal[(a + 1, b + 1)] = moment;
            normal[(b + 1, a + 1)] = moment;
        }
        for a in 0..3 {
            normal[(a + 1, a + 1)] += RIDGE_MM2 * w + floor;
            normal[(0, a + 1)] = about[a];
            normal[(a + 1, 0)] = about[a];
        }
        let right = Vector4::new(r + floor, right[0], right[1], right[2]);
        let gain = normal.cholesky().map_or(1.0, |c| c.solve(&right)[0]);
        gain.clamp(LEAST_GAIN, 1.0 / LEAST_GAIN).ln() as f32
    })
}

/// Means of a function of the voxel over blocks.
pub(super) fn in_blocks(grid: &Grid<Mni>, value: impl Fn(usize) -> f32 + Sync + Send) -> Volume<f32, Mni> {
    block_means(grid, BLOCK, value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::atlas;

    #[test]
    fn a_surface_coil_is_taken_out_and_a_head_coil_is_left_to_the_mixture() {
        let template = atlas::template().t1_f32();
        let (grid, known) = (template.grid, template.map(|_| true));
        let priors = AtlasPriors::rigid(&grid);
        // Four times as bright 90 mm above as at the middle.
        let coil = |strength: f64| {
            Volume::from_fn(grid, |n| {
                let p = grid.centre(grid.voxel(n)).mm;
                template.data[n] * (strength * p.z / 90.0).exp() as f32
            })
        };
        assert!(strong_gain(&template, &known, &priors).is_none());
        assert!(strong_gain(&coil(0.2), &known, &priors).is_none());
        let strong = coil(4f64.ln());
        let (gain, times) = strong_gain(&strong, &known, &priors).unwrap();
        let flat = evened(&strong, &gain);
        assert!((1.8..6.0).contains(&times), "{times}");
        let ratio = |z: f64| {
            let n = |x: f64| grid.voxel_at(crate::geometry::Position::new(x, -20.0, z)).map(|v| v.round() as usize);
            let mean =
                |v: &Volume<f32, Mni>| (15..40).map(|x| n(f64::from(x))).map(|v3| v.at(v3.x, v3.y, v3.z)).sum::<f32>();
            mean(&flat) / mean(&template)
        };
        let (above, below) = (ratio(55.0), ratio(-15.0));
        assert!((above / below - 1.0).abs() < 0.15, "{above} {below}");
    }

    #[test]
    fn the_gain_is_known_at_the_surface_where_a_coil_sees_most_and_just_outside_it() {
        let template = atlas::template().t1_f32();
        let (grid, known) = (template.grid, template.map(|_| true));
        let priors = AtlasPriors::rigid(&grid);
        // e times as bright 50 mm above, and something of one brightness around the brain.
        let gain = |n: usize| (grid.centre(grid.voxel(n)).mm.z / 50.0).exp() as f32;
        let around = Volume::from_fn(grid, |n| if template.data[n] > 0.0 { template.data[n] } else { 100.0 });
        let seen = Volume::from_fn(grid, |n| around.data[n] * gain(n));
        let flat = evened(&seen, &strong_gain(&seen, &known, &priors).unwrap().0);
        let left = |wanted: &dyn Fn(f32, f64) -> bool| {
            let (mut sum, mut count) = (0.0, 0.0);
            for n in 0..grid.len() {
                let z = grid.centre(grid.voxel(n)).mm.z;
                if wanted(priors.brain_mm.data[n], z) {
                    sum += f64::from(flat.data[n] / around.data[n]).ln();
                    count += 1.0;
                }
            }
            sum / count
        };
        let deep = left(&|mm, _| mm < -10.0);
        for crown in
            [left(&|mm, z| (-3.0..0.0).contains(&mm) && z > 55.0), left(&|mm, z| (2.0..5.0).contains(&mm) && z > 60.0)]
        {
            // The template's own fluid is not quite as dark as a scan's is expected to be.
            assert!((crown - deep).abs() < 0.15, "{crown} {deep}");
        }
    }
}

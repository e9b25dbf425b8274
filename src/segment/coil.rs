//! The gain of a surface coil, taken out before tissues are told apart.
//!
//! Where a coil sees the crown twice as bright as the brainstem, classes of intensity mean nothing until that is known, and
//! the gain that the mixture finds beside its classes is found from wrong ones. The carried template knows how bright the
//! brain should be on average around each point: what the scan shows there instead is the gain.

use super::priors::AtlasPriors;
use crate::geometry::Mni;
use crate::image::gaussian::gaussian;
use crate::image::{Grid, Mask, Volume};
use nalgebra::{Matrix4, Point3, Vector3};

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
/// The surface itself is left out: how much CSF lies there is the patient's.
const DEPTH_MM: f32 = 2.0;

/// The scan with its gain taken out where that is strong, and how many times brighter than its dark parts (each a sixth of
/// the brain or so) the bright ones were; the mean over the brain stays. `None` where it is not strong.
pub(super) fn without_strong_gain(
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
    let flat = Volume::from_fn(grid, |n| t1.data[n] * (mean as f32 - clamped(&log_gain, &grid, n)).exp());
    // One standard deviation to either side of a Gaussian leaves 16 % beyond each.
    Some((flat, (2.0 * spread).exp()))
}

/// Means of a function of the voxel over blocks.
fn in_blocks(grid: &Grid<Mni>, value: impl Fn(usize) -> f32 + Sync) -> Volume<f32, Mni> {
    let dims = grid.dims.map(|n| n.div_ceil(BLOCK));
    let half = 0.5 * (BLOCK as f64 - 1.0);
    let to_fine = Matrix4::new_translation(&Vector3::repeat(half)) * Matrix4::new_scaling(BLOCK as f64);
    let coarse = Grid::new(dims, grid.mm_from_voxel * to_fine).expect("a scaled grid is a grid");
    Volume::from_fn(coarse, |n| {
        let first = coarse.voxel(n).map(|v| v * BLOCK);
        let end = [0, 1, 2].map(|a| (first[a] + BLOCK).min(grid.dims[a]));
        let mut sum = 0.0;
        for k in first[2]..end[2] {
            for j in first[1]..end[1] {
                sum += (first[0]..end[0]).map(|i| value(grid.index(i, j, k))).sum::<f32>();
            }
        }
        sum / (BLOCK * BLOCK * BLOCK) as f32
    })
}

/// The coarse volume at a voxel of the fine grid, linearly; its border is repeated outwards.
fn clamped(coarse: &Volume<f32, Mni>, grid: &Grid<Mni>, n: usize) -> f32 {
    let voxel = coarse.grid.voxel_at(grid.position(Point3::from(grid.voxel(n).map(|v| v as f64))));
    let inside = Point3::from([0, 1, 2].map(|a| voxel[a].clamp(0.0, coarse.grid.dims[a] as f64 - 1.0)));
    coarse.trilinear(coarse.grid.position(inside)).unwrap_or(0.0)
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
                let p = grid.position(Point3::from(grid.voxel(n).map(|v| v as f64))).mm;
                template.data[n] * (strength * p.z / 90.0).exp() as f32
            })
        };
        assert!(without_strong_gain(&template, &known, &priors).is_none());
        assert!(without_strong_gain(&coil(0.2), &known, &priors).is_none());
        let (flat, times) = without_strong_gain(&coil(4f64.ln()), &known, &priors).unwrap();
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
}

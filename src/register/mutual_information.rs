//! Mutual information of samples of one image and the interpolated other one, with its analytic gradient.
//!
//! After Mattes et al. (2003): a joint histogram with a box window on the sampled image's axis and a cubic B-spline
//! window on the interpolated image's axis, so that the measure is a smooth function of the transform. Points that fall
//! outside the interpolated image are unknown: they are left out, never counted as background.

use super::bspline;
use super::sample::Samples;
use crate::geometry::Native;
use crate::image::{Mask, Volume};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Samples in one chunk of work; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 8192;

/// `x -> linear (x - centre) + target`: any affine map between the two images, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pub linear: Matrix3<f64>,
    pub centre: Vector3<f64>,
    pub target: Vector3<f64>,
}

/// The image that is interpolated.
pub(super) struct Interpolated<'a> {
    /// Spline coefficients.
    pub image: &'a Volume<f32, Native>,
    /// Points outside it are unknown.
    pub mask: Option<&'a Mask<Native>>,
    /// Values that map to the first and last bin; beyond them a value counts as the nearest of the two.
    pub range: [f32; 2],
}

/// Mutual information at a pose, in nats.
#[derive(Clone, Debug)]
pub(super) struct Similarity {
    pub mutual_information: f64,
    /// The smaller of the two marginal entropies: the largest mutual information these histograms could have.
    pub entropy: f64,
    /// Fraction of the samples that are known in both images and inside the mask.
    pub known: f64,
    /// Fraction of the samples inside the mask that lie in the other image's field of view.
    pub overlap: f64,
    /// Derivative with respect to `target`, in nats per mm; zero when not asked for.
    pub force: Vector3<f64>,
    /// Derivative with respect to `linear`.
    pub moment: Matrix3<f64>,
}

/// What interpolation found for one sample. `position` is the place on the histogram axis, NaN for unknown and infinite
/// outside the mask.
#[derive(Clone, Copy)]
struct Seen {
    position: f32,
    gradient: [f32; 3],
    /// Sum over the slice profile of offset times gradient, in mm times value per voxel.
    spread: [f32; 3],
}

/// The joint histogram's geometry.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bins {
    pub sampled: usize,
    pub interpolated: usize,
}

/// Evaluates mutual information, and its gradient when asked for.
pub(super) fn similarity(
    samples: &Samples,
    other: &Interpolated<'_>,
    bins: Bins,
    pose: &Pose,
    with_gradient: bool,
) -> Similarity {
    let (rows, columns) = (bins.sampled, bins.interpolated);
    let to_voxel = other.image.grid.voxel_from_mm();
    let voxel_linear: Matrix3<f64> = to_voxel.fixed_view::<3, 3>(0, 0).into_owned();
    let linear = voxel_linear * pose.linear;
    let origin = voxel_linear * pose.target + to_voxel.fixed_view::<3, 1>(0, 3);
    let scale = (columns - 4) as f32 / (other.range[1] - other.range[0]);
    let profile: Vec<(f32, Vector3<f64>)> =
        samples.profile.iter().map(|o| (o.norm().copysign(o.dot(&samples.slice_axis)) as f32, linear * o)).collect();

    let look = |n: usize| -> Seen {
        let unknown = Seen { position: f32::NAN, gradient: [0.0; 3], spread: [0.0; 3] };
        let x = samples.offsets_mm[n];
        let v = linear * Vector3::new(f64::from(x[0]), f64::from(x[1]), f64::from(x[2])) + origin;
        if other
            .mask
            .is_some_and(|m| !m.get(v.x.round() as isize, v.y.round() as isize, v.z.round() as isize).unwrap_or(false))
        {
            return Seen { position: f32::INFINITY, ..unknown };
        }
        let (mut value, mut gradient, mut spread) = (0f32, [0f32; 3], [0f32; 3]);
        for (offset_mm, step) in &profile {
            let p = v + step;
            let Some((f, g)) = bspline::value_and_gradient(other.image, [p.x, p.y, p.z]) else { return unknown };
            value += f;
            for a in 0..3 {
                gradient[a] += g[a];
                spread[a] += offset_mm * g[a];
            }
        }
        let share = 1.0 / profile.len() as f32;
        let along = (value * share - other.range[0]) * scale;
        let clamped = along.clamp(0.0, (columns - 4) as f32);
        // A value beyond the range does not change with the pose.
        let share = if along == clamped { share } else { 0.0 };
        Seen { position: 1.5 + clamped, gradient: gradient.map(|g| g * share), spread: spread.map(|g| g * share) }
    };

    let chunks: Vec<(Vec<Seen>, Vec<f64>, usize)> = (0..samples.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|c| {
            let range = c * CHUNK..((c + 1) * CHUNK).min(samples.len());
            let mut histogram = vec![0f64; rows * columns];
            let mut unknown = 0;
            let mut seen = Vec::with_capacity(if with_gradient { range.len() } else { 0 });
            for n in range {
                let s = look(n);
                unknown += usize::from(s.position.is_nan());
                if s.position.is_finite() {
                    let knot = s.position.floor();
                    let w = bspline::weights(s.position - knot);
                    let o = usize::from(samples.bins[n]) * columns + knot as usize - 1;
                    for (h, w) in histogram[o..o + 4].iter_mut().zip(w) {
                        *h += f64::from(w);
                    }
                }
                if with_gradient {
                    seen.push(s);
                }
            }
            (seen, histogram, unknown)
        })
        .collect();

    let mut joint = vec![0f64; rows * columns];
    for (_, part, _) in &chunks {
        joint.iter_mut().zip(part).for_each(|(a, b)| *a += b);
    }
    let known: f64 = joint.iter().sum();
    let unknown: usize = chunks.iter().map(|c| c.2).sum();
    let mut out = Similarity {
        mutual_information: 0.0,
        entropy: 0.0,
        known: known / samples.len().max(1) as f64,
        overlap: known / (known + unknown as f64).max(1.0),
        force: Vector3::zeros(),
        moment: Matrix3::zeros(),
    };
    if known < 64.0 {
        return out;
    }
    for p in &mut joint {
        *p /= known;
    }
    let row_sum: Vec<f64> = joint.chunks(columns).map(|r| r.iter().sum()).collect();
    let column_sum: Vec<f64> = (0..columns).map(|m| (0..rows).map(|f| joint[f * columns + m]).sum()).collect();
    // log p(m | f) + constant, per cell: what a sample gains by moving weight into the cell.
    let mut gain = vec![0f32; rows * columns];
    for f in 0..rows {
        for m in 0..columns {
            let p = joint[f * columns + m];
            if p > 1e-15 {
                out.mutual_information += p * (p / (row_sum[f] * column_sum[m])).ln();
                gain[f * columns + m] = (p / column_sum[m]).ln() as f32;
            }
        }
    }
    let entropy = |sums: &[f64]| -sums.iter().filter(|&&p| p > 0.0).map(|p| p * p.ln()).sum::<f64>();
    out.entropy = entropy(&row_sum).min(entropy(&column_sum));
    if !with_gradient {
        return out;
    }

    let sums: Vec<[f64; 15]> = chunks
        .par_iter()
        .enumerate()
        .map(|(c, (seen, _, _))| {
            let mut sum = [0f64; 15];
            for (i, s) in seen.iter().enumerate().filter(|(_, s)| s.position.is_finite()) {
                let n = c * CHUNK + i;
                let knot = s.position.floor();
                let d = bspline::derivatives(s.position - knot);
                let o = usize::from(samples.bins[n]) * columns + knot as usize - 1;
                let g = &gain[o..o + 4];
                let slope = d[0] * g[0] + d[1] * g[1] + d[2] * g[2] + d[3] * g[3];
                let x = samples.offsets_mm[n];
                for a in 0..3 {
                    let along = slope * s.gradient[a];
                    sum[a] += f64::from(along);
                    for b in 0..3 {
                        sum[3 + 3 * a + b] += f64::from(along * x[b]);
                    }
                    sum[12 + a] += f64::from(slope * s.spread[a]);
                }
            }
            sum
        })
        .collect();
    let mut sum = [0f64; 15];
    for part in &sums {
        sum.iter_mut().zip(part).for_each(|(a, b)| *a += b);
    }
    let per_value = f64::from(scale) / known;
    let back = voxel_linear.transpose() * per_value;
    out.force = back * Vector3::new(sum[0], sum[1], sum[2]);
    out.moment = back
        * (Matrix3::from_row_slice(&sum[3..12])
            + Vector3::new(sum[12], sum[13], sum[14]) * samples.slice_axis.transpose());
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use crate::register::sample::{Draw, draw};
    use nalgebra::Rotation3;

    #[test]
    fn gradient_is_the_derivative_of_the_information_also_across_thick_slices() {
        let blob = |x: f64, y: f64, z: f64| {
            100.0 * (-(x * x + 0.5 * y * y + 2.0 * z * z) / 300.0).exp()
                + 20.0 * (0.3 * x).sin() * (0.2 * y + 0.1 * z).cos()
        };
        let image = |dims: [usize; 3], spacing: [f64; 3]| {
            let origin = std::array::from_fn(|a| -0.5 * spacing[a] * (dims[a] - 1) as f64);
            let grid = Grid::<Native>::axis_aligned(dims, spacing, origin);
            let data = (0..grid.len()).map(|n| {
                let v: Vector3<f64> = Vector3::from(grid.voxel(n).map(|i| i as f64));
                let p = grid.position(v.into()).mm;
                blob(p.x, p.y, p.z) as f32
            });
            Volume::from_data(grid, data.collect())
        };
        let fine = image([60, 60, 60], [1.0; 3]);
        for thick in [[1.5, 1.5, 1.4], [1.2, 1.2, 4.0]] {
            let sampled = image([26, 26, 9], thick);
            let request = Draw {
                most: 1_000_000,
                other_spacing_mm: 1.0,
                bins: 24,
                range: [-10.0, 110.0],
                centre_mm: Vector3::zeros(),
                seed: 3,
            };
            let samples = draw(&sampled, &Volume::filled(sampled.grid, true), &request);
            let other = Interpolated { image: &fine, mask: None, range: [-30.0, 130.0] };
            let bins = Bins { sampled: 24, interpolated: 28 };
            let base = Pose {
                linear: *Rotation3::from_euler_angles(0.1, -0.05, 0.08).matrix(),
                centre: Vector3::zeros(),
                target: Vector3::new(1.3, -0.7, 0.9),
            };
            let at = similarity(&samples, &other, bins, &base, true);
            let h = 1e-3;
            for a in 0..3 {
                let value = |h: f64| {
                    let mut pose = base;
                    pose.target[a] += h;
                    similarity(&samples, &other, bins, &pose, false).mutual_information
                };
                let difference = (value(h) - value(-h)) / (2.0 * h);
                assert!((difference - at.force[a]).abs() < 2e-3 * at.force.norm(), "{difference} {}", at.force);
                for b in 0..3 {
                    let value = |h: f64| {
                        let mut pose = base;
                        pose.linear[(a, b)] += h / 20.0;
                        similarity(&samples, &other, bins, &pose, false).mutual_information
                    };
                    let difference = (value(h) - value(-h)) / (2.0 * h) * 20.0;
                    assert!(
                        (difference - at.moment[(a, b)]).abs() < 2e-3 * at.moment.norm(),
                        "{difference} {}",
                        at.moment
                    );
                }
            }
        }
    }
}

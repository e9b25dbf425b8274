//! Images over their own neighbourhoods, and how well two of them agree: a local correlation that has a gradient.
//!
//! Every point of an image less the mean around it, over the deviation around it (Gaussian windows, so that turning the image
//! changes nothing). Gain, bias fields, clipped intensities and hard edges of what was cut away drop out; what is left is
//! anatomy, bright or dark as in the other image. The cosine of two such images is a smooth function of the pose.

use super::bspline;
use super::mutual_information::{Interpolated, Pose, Similarity};
use super::sample::Samples;
use crate::geometry::Native;
use crate::image::gaussian::gaussian;
use crate::image::{Mask, Volume};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Samples in one chunk of work; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 8192;
/// Deviations beyond this count as this much.
pub(super) const LARGEST: f32 = 2.5;
/// Variance (of 1) that an image without anatomy is still granted: it agrees with nothing.
const FLAT: f64 = 0.1;

/// The image less its local mean over its local deviation, within +-[`LARGEST`]; contrast below `noise` means nothing, and
/// voxels outside `known` count for no neighbour.
pub(super) fn normalised(
    image: &Volume<f32, Native>,
    known: Option<&Mask<Native>>,
    window_mm: f64,
    noise: f32,
) -> Volume<f32, Native> {
    let weight = Volume::from_fn(image.grid, |n| f32::from(u8::from(known.is_none_or(|k| k.data[n]))));
    let share = gaussian(&weight, window_mm);
    let mean = gaussian(&Volume::from_fn(image.grid, |n| weight.data[n] * image.data[n]), window_mm);
    let mean = Volume::from_fn(image.grid, |n| mean.data[n] / share.data[n].max(1e-3));
    // About the local mean: squares of large values would lose what is small.
    let spread = Volume::from_fn(image.grid, |n| weight.data[n] * (image.data[n] - mean.data[n]).powi(2));
    let variance = gaussian(&spread, window_mm);
    Volume::from_fn(image.grid, |n| {
        let deviation = (variance.data[n] / share.data[n].max(1e-3) + noise * noise).sqrt();
        let x = (image.data[n] - mean.data[n]) / deviation.max(f32::MIN_POSITIVE);
        if weight.data[n] > 0.0 { x.clamp(-LARGEST, LARGEST) } else { 0.0 }
    })
}

/// Value and gradient of the other image at a sample, where it is known.
type Seen = Option<(f64, [f32; 3])>;

/// Sums over the samples that are known.
#[derive(Clone, Copy, Default)]
struct Sums {
    known: f64,
    unknown: f64,
    aa: f64,
    ab: f64,
    bb: f64,
}

/// The cosine of two normalised images at a pose in the place of mutual information. `bins` and `range` say what the samples'
/// bins stand for.
pub(super) fn agreement(
    samples: &Samples,
    other: &Interpolated<'_>,
    bins: usize,
    range: [f32; 2],
    pose: &Pose,
    with_gradient: bool,
) -> Similarity {
    let to_voxel = other.image.grid.voxel_from_mm();
    let voxel_linear: Matrix3<f64> = to_voxel.fixed_view::<3, 3>(0, 0).into_owned();
    let linear = voxel_linear * pose.linear;
    let origin = voxel_linear * pose.target + to_voxel.fixed_view::<3, 1>(0, 3);
    let value_of = |bin: u8| f64::from(range[0] + (f32::from(bin) + 0.5) * (range[1] - range[0]) / bins as f32);
    // What is seen at a sample, and whether it lies in the other image's field of view.
    let look = |n: usize| -> (Seen, bool) {
        let x = samples.offsets_mm[n];
        let v = linear * Vector3::new(f64::from(x[0]), f64::from(x[1]), f64::from(x[2])) + origin;
        let inside =
            |m: &Mask<Native>| m.get(v.x.round() as isize, v.y.round() as isize, v.z.round() as isize).unwrap_or(false);
        if other.mask.is_some_and(|m| !inside(m)) {
            return (None, true);
        }
        let found = bspline::value_and_gradient(other.image, [v.x, v.y, v.z]).map(|(f, g)| (f64::from(f), g));
        (found, found.is_some())
    };
    let chunks = samples.len().div_ceil(CHUNK);
    let range_of = |c: usize| c * CHUNK..((c + 1) * CHUNK).min(samples.len());
    let parts: Vec<(Vec<Seen>, Sums)> = (0..chunks)
        .into_par_iter()
        .map(|c| {
            let mut sums = Sums::default();
            let mut seen = Vec::with_capacity(if with_gradient { CHUNK } else { 0 });
            for n in range_of(c) {
                let (found, in_view) = look(n);
                sums.unknown += f64::from(u8::from(!in_view));
                if let Some((b, _)) = found {
                    let a = value_of(samples.bins[n]);
                    sums.known += 1.0;
                    sums.aa += a * a;
                    sums.ab += a * b;
                    sums.bb += b * b;
                }
                if with_gradient {
                    seen.push(found);
                }
            }
            (seen, sums)
        })
        .collect();
    let s = parts.iter().fold(Sums::default(), |t, (_, p)| Sums {
        known: t.known + p.known,
        unknown: t.unknown + p.unknown,
        aa: t.aa + p.aa,
        ab: t.ab + p.ab,
        bb: t.bb + p.bb,
    });
    let mut out = Similarity {
        mutual_information: 0.0,
        entropy: 1.0,
        known: s.known / samples.len().max(1) as f64,
        overlap: s.known / (s.known + s.unknown).max(1.0),
        force: Vector3::zeros(),
        moment: Matrix3::zeros(),
    };
    if s.known < 64.0 {
        return out;
    }
    let length_a = (s.aa + FLAT * s.known).sqrt();
    let square_b = s.bb + FLAT * s.known;
    let length_b = square_b.sqrt();
    let cosine = s.ab / (length_a * length_b);
    out.mutual_information = cosine;
    if !with_gradient {
        return out;
    }
    let sums: Vec<(Vector3<f64>, Matrix3<f64>)> = parts
        .par_iter()
        .enumerate()
        .map(|(c, (seen, _))| {
            let (mut force, mut moment) = (Vector3::zeros(), Matrix3::zeros());
            for (n, found) in range_of(c).zip(seen) {
                let Some((b, g)) = found else { continue };
                let slope = value_of(samples.bins[n]) / (length_a * length_b) - cosine * b / square_b;
                let along = Vector3::from(g.map(f64::from)) * slope;
                force += along;
                moment += along * Vector3::from(samples.offsets_mm[n].map(f64::from)).transpose();
            }
            (force, moment)
        })
        .collect();
    let back = voxel_linear.transpose();
    let (force, moment) = sums.iter().fold((Vector3::zeros(), Matrix3::zeros()), |(f, m), (df, dm)| (f + df, m + dm));
    out.force = back * force;
    out.moment = back * moment;
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Grid;
    use crate::register::sample::{Draw, draw};
    use nalgebra::{Point3, Rotation3};

    fn image(value: impl Fn(Point3<f64>) -> f64) -> Volume<f32, Native> {
        let grid = Grid::<Native>::axis_aligned([40, 40, 40], [3.0; 3], [-58.5; 3]);
        let data = (0..grid.len())
            .map(|n| value(grid.position(Point3::from(grid.voxel(n).map(|i| i as f64))).mm) as f32)
            .collect();
        Volume::from_data(grid, data)
    }

    fn waves(p: Point3<f64>) -> f64 {
        100.0 + 30.0 * (0.09 * p.x).sin() * (0.07 * p.y + 0.05 * p.z).cos() + 20.0 * (0.08 * p.z).sin()
    }

    #[test]
    fn a_gain_of_ten_changes_a_normalised_image_little() {
        let plain = normalised(&image(waves), None, 12.0, 0.5);
        let shaded = normalised(&image(|p| waves(p) * (0.02 * p.x).exp()), None, 12.0, 0.5);
        let product: f32 = plain.data.iter().zip(&shaded.data).map(|(a, b)| a * b).sum();
        let length = |v: &Volume<f32, Native>| v.data.iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!(product / (length(&plain) * length(&shaded)) > 0.8);
    }

    #[test]
    fn the_slope_of_the_agreement_is_its_derivative() {
        let still = normalised(&image(waves), None, 12.0, 0.5);
        let moving = normalised(&image(|p| waves(p + Vector3::new(3.0, -2.0, 1.0))), None, 12.0, 0.5);
        let region = Volume::from_fn(still.grid, |n| still.grid.voxel(n).iter().all(|i| (8..32).contains(i)));
        let range = [-LARGEST, LARGEST];
        let request =
            Draw { most: 100_000, other_spacing_mm: 3.0, bins: 40, range, centre_mm: Vector3::zeros(), seed: 3 };
        let samples = draw(&still, &region, &request);
        let other = Interpolated { image: &moving, mask: None, range };
        let base = Pose {
            linear: *Rotation3::from_euler_angles(0.1, -0.05, 0.08).matrix(),
            centre: Vector3::zeros(),
            target: Vector3::new(1.3, -0.7, 0.9),
        };
        let value = |pose: &Pose| agreement(&samples, &other, 40, range, pose, false).mutual_information;
        let at = agreement(&samples, &other, 40, range, &base, true);
        let h = 1e-4;
        for a in 0..3 {
            let moved = |h: f64| {
                let mut pose = base;
                pose.target[a] += h;
                value(&pose)
            };
            let difference = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((difference - at.force[a]).abs() < 2e-3 * at.force.norm(), "{difference} {}", at.force);
            for b in 0..3 {
                let turned = |h: f64| {
                    let mut pose = base;
                    pose.linear[(a, b)] += h / 20.0;
                    value(&pose)
                };
                let difference = (turned(h) - turned(-h)) / (2.0 * h) * 20.0;
                assert!((difference - at.moment[(a, b)]).abs() < 2e-3 * at.moment.norm(), "{difference} {}", at.moment);
            }
        }
    }
}

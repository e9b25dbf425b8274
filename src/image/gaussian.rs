//! Separable Gaussian smoothing.

use super::pieces::each_piece;
use super::volume::Volume;
use crate::geometry::Frame;

/// Taps reach this many standard deviations; beyond lies 5e-4 of the weight, which the normalisation gives back.
const REACH: f64 = 3.5;

/// Half of a normalised, sampled Gaussian: `w[0] + 2 (w[1] + w[2] + ...) = 1`.
fn half_kernel(sigma_voxels: f64) -> Vec<f32> {
    let radius = (REACH * sigma_voxels).ceil() as usize;
    let weight: Vec<f64> = (0..=radius).map(|n| (-0.5 * (n as f64 / sigma_voxels).powi(2)).exp()).collect();
    let total = weight[0] + 2.0 * weight[1..].iter().sum::<f64>();
    weight.iter().map(|w| (w / total) as f32).collect()
}

/// Smooths with a Gaussian of standard deviation `sigma_mm`, the same in every direction of the grid's axes.
///
/// Beyond the border the outermost value is repeated, so a constant stays constant. A standard deviation of zero (or
/// far below the voxel size) changes nothing along that axis. The result does not depend on the number of threads.
#[must_use]
pub fn gaussian<F: Frame>(volume: &Volume<f32, F>, sigma_mm: f64) -> Volume<f32, F> {
    gaussian_along_axes(volume, [sigma_mm; 3])
}

/// [`gaussian`] with a standard deviation in mm for each of the axes i, j, k.
#[must_use]
pub fn gaussian_along_axes<F: Frame>(volume: &Volume<f32, F>, sigma_mm: [f64; 3]) -> Volume<f32, F> {
    let spacing_mm = volume.grid.spacing_mm();
    let [nx, ny, nz] = volume.grid.dims;
    let mut data = volume.data.clone();
    for axis in 0..3 {
        let sigma = sigma_mm[axis] / spacing_mm[axis];
        // Below a tenth of a voxel the neighbours' weight is under 1e-21: nothing to do.
        if sigma.is_nan() || sigma <= 0.1 || volume.grid.dims[axis] < 2 {
            continue;
        }
        let kernel = half_kernel(sigma);
        data = match axis {
            0 => along_rows(&data, nx, &kernel),
            1 => along_columns(&data, nx, ny, &kernel),
            _ => across_planes(&data, nx * ny, nz, &kernel),
        };
    }
    Volume::from_data(volume.grid, data)
}

fn along_rows(data: &[f32], n: usize, kernel: &[f32]) -> Vec<f32> {
    let radius = kernel.len() - 1;
    let mut out = vec![0.0; data.len()];
    // Many rows at a time: a padded row is small, a task must not be.
    let rows = 256;
    each_piece(&mut out, n * rows, &|first, out| {
        let data = &data[first..];
        let mut padded = vec![0f32; n + 2 * radius];
        for (out, row) in out.chunks_exact_mut(n).zip(data.chunks_exact(n)) {
            padded[..radius].fill(row[0]);
            padded[radius..radius + n].copy_from_slice(row);
            padded[radius + n..].fill(row[n - 1]);
            for (o, x) in out.iter_mut().zip(row) {
                *o = kernel[0] * x;
            }
            for (t, &w) in kernel.iter().enumerate().skip(1) {
                let (before, after) = (&padded[radius - t..][..n], &padded[radius + t..][..n]);
                for ((o, a), b) in out.iter_mut().zip(before).zip(after) {
                    *o += w * (a + b);
                }
            }
        }
    });
    out
}

/// One output row (or plane piece) as the weighted sum of the same piece of the neighbours at `at(-t)` and `at(+t)`.
fn weighted_sum<'a>(out: &mut [f32], kernel: &[f32], piece: impl Fn(isize) -> &'a [f32]) {
    for (o, x) in out.iter_mut().zip(piece(0)) {
        *o = kernel[0] * x;
    }
    for (t, &w) in kernel.iter().enumerate().skip(1) {
        let (before, after) = (piece(-(t as isize)), piece(t as isize));
        for ((o, a), b) in out.iter_mut().zip(before).zip(after) {
            *o += w * (a + b);
        }
    }
}

fn along_columns(data: &[f32], nx: usize, ny: usize, kernel: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; data.len()];
    each_piece(&mut out, nx * ny, &|first, out| {
        let plane = &data[first..][..nx * ny];
        for (j, out) in out.chunks_exact_mut(nx).enumerate() {
            weighted_sum(out, kernel, |t| {
                let j = (j as isize + t).clamp(0, ny as isize - 1) as usize;
                &plane[j * nx..][..nx]
            });
        }
    });
    out
}

fn across_planes(data: &[f32], plane: usize, nz: usize, kernel: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; data.len()];
    // Pieces of a plane short enough that the accumulator stays in the first-level cache.
    let piece = 2048;
    each_piece(&mut out, plane, &|first, out| {
        let k = first / plane;
        for (p, out) in out.chunks_mut(piece).enumerate() {
            let n = out.len();
            weighted_sum(out, kernel, |t| {
                let k = (k as isize + t).clamp(0, nz as isize - 1) as usize;
                &data[k * plane + p * piece..][..n]
            });
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::Grid;

    fn grid() -> Grid<Pre> {
        Grid::axis_aligned([33, 31, 29], [1.0, 1.5, 2.0], [0.0; 3])
    }

    #[test]
    fn an_impulse_becomes_a_gaussian_of_the_asked_width_in_mm() {
        let grid = grid();
        let mut volume = Volume::filled(grid, 0.0);
        volume.data[grid.index(16, 15, 14)] = 1.0;
        let smooth = gaussian(&volume, 2.5);
        let total: f64 = smooth.data.iter().map(|&x| f64::from(x)).sum();
        assert!((total - 1.0).abs() < 1e-4, "{total}");
        for axis in 0..3 {
            let variance: f64 = (0..grid.len())
                .map(|n| {
                    let offset = grid.voxel(n)[axis] as f64 - [16.0, 15.0, 14.0][axis];
                    f64::from(smooth.data[n]) * (offset * grid.spacing_mm()[axis]).powi(2)
                })
                .sum();
            assert!((variance.sqrt() - 2.5).abs() < 0.03, "axis {axis}: {}", variance.sqrt());
        }
    }

    #[test]
    fn a_constant_and_a_zero_width_change_nothing() {
        let constant = Volume::filled(grid(), 7.0);
        assert!(gaussian(&constant, 4.0).data.iter().all(|x| (x - 7.0).abs() < 1e-5));
        let ramp = Volume::from_data(grid(), (0..grid().len()).map(|n| n as f32).collect());
        assert_eq!(gaussian(&ramp, 0.0), ramp);
    }
}

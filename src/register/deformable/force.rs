//! The force of locally normalised demons.
//!
//! Both images are brought to zero mean and unit variance in a moving window, which makes the measure a local correlation
//! (Cachier et al. 2003; Avants et al. 2008): bias fields, contrast and gain drop out. The step is that of symmetric demons
//! (Vercauteren et al. 2009), bounded by half a voxel: u = (F - M) g / (|g|^2 + (F - M)^2), with g the mean of both gradients.

use super::velocity::VectorField;
use crate::geometry::Native;
use crate::image::Grid;
use crate::image::pieces::each_piece;
use rayon::prelude::*;

/// Half width of the window in voxels.
const REACH: usize = 2;
/// Share of the window that must be known.
const LEAST_KNOWN: f32 = 0.25;

/// Sums over windows of `2 REACH + 1` voxels along each axis; beyond the border there is nothing.
fn window_sums(data: Vec<f32>, dims: [usize; 3]) -> Vec<f32> {
    let [nx, ny, nz] = dims;
    let plane = nx * ny;
    let mut rows = vec![0f32; data.len()];
    each_piece(&mut rows, plane, &|first, out| {
        let data = &data[first..];
        let mut padded = vec![0f32; nx + 2 * REACH];
        for (out, row) in out.chunks_mut(nx).zip(data.chunks(nx)) {
            padded[REACH..REACH + nx].copy_from_slice(row);
            for t in 0..=2 * REACH {
                out.iter_mut().zip(&padded[t..]).for_each(|(o, x)| *o += x);
            }
        }
    });
    let mut columns = data;
    each_piece(&mut columns, plane, &|first, out| {
        let rows = &rows[first..];
        for (j, out) in out.chunks_mut(nx).enumerate() {
            out.fill(0.0);
            for t in j.saturating_sub(REACH)..=(j + REACH).min(ny - 1) {
                out.iter_mut().zip(&rows[t * nx..]).for_each(|(o, x)| *o += x);
            }
        }
    });
    let mut out = rows;
    each_piece(&mut out, plane, &|first, out| {
        let k = first / plane;
        out.fill(0.0);
        for t in k.saturating_sub(REACH)..=(k + REACH).min(nz - 1) {
            out.iter_mut().zip(&columns[t * plane..]).for_each(|(o, x)| *o += x);
        }
    });
    out
}

/// The mean local correlation alone; arguments as those of [`force`].
pub(in crate::register) fn local_correlation(
    grid: &Grid<Native>,
    fixed: &[f32],
    moving: &[f32],
    weight: &[f32],
    noise: [f32; 2],
) -> f64 {
    force(grid, fixed, moving, weight, None, noise).1
}

/// The update that brings the moving image (already seen through the present map) closer to the fixed one, in voxels, and
/// the mean local correlation over the known voxels that are `judged`.
///
/// `weight` is 1 where both images are known, else 0; `noise` is the standard deviation below which contrast in a window
/// means nothing, for the fixed and the moving image. Without `judged` every voxel is.
pub(super) fn force(
    grid: &Grid<Native>,
    fixed: &[f32],
    moving: &[f32],
    weight: &[f32],
    judged: Option<&[bool]>,
    noise: [f32; 2],
) -> (VectorField, f64) {
    let dims = grid.dims;
    let [nx, ny, _] = dims;
    let plane = nx * ny;
    let sums = |data: Vec<f32>| window_sums(data, dims);
    let weighted = |a: &[f32]| weight.par_iter().zip(a).map(|(w, a)| w * a).collect::<Vec<f32>>();
    let count = sums(weight.to_vec());
    let (known_f, known_m) = (weighted(fixed), weighted(moving));
    let product = |a: &[f32], b: &[f32]| sums(a.par_iter().zip(b).map(|(a, b)| a * b).collect());
    let (sum_ff, sum_mm) = (product(&known_f, fixed), product(&known_m, moving));
    let sum_fm = product(&known_f, moving);
    let (sum_f, sum_m) = (sums(known_f), sums(known_m));

    let full = ((2 * REACH + 1) * (2 * REACH + 1) * (2 * REACH + 1)) as f32;
    let mut out = VectorField::zeros(grid);
    let [ox, oy, oz] = &mut out.components;
    let slices = ox.par_chunks_mut(plane).zip(oy.par_chunks_mut(plane)).zip(oz.par_chunks_mut(plane));
    let correlation: Vec<(f64, f64)> = slices
        .enumerate()
        .map(|(k, ((ox, oy), oz))| {
            let mut total = (0.0, 0.0);
            for o in 0..plane {
                let n = o + k * plane;
                if weight[n] == 0.0 || count[n] < LEAST_KNOWN * full {
                    continue;
                }
                let c = 1.0 / count[n];
                let (mean_f, mean_m) = (sum_f[n] * c, sum_m[n] * c);
                let var_f = (sum_ff[n] * c - mean_f * mean_f).max(0.0) + noise[0] * noise[0];
                let var_m = (sum_mm[n] * c - mean_m * mean_m).max(0.0) + noise[1] * noise[1];
                let both = sum_fm[n] * c - mean_f * mean_m;
                let (scale_f, scale_m) = (1.0 / var_f.sqrt(), 1.0 / var_m.sqrt());
                let r = both * scale_f * scale_m;
                if judged.is_none_or(|judged| judged[n]) {
                    total.0 += f64::from(r);
                    total.1 += 1.0;
                }
                if r <= 0.0 {
                    continue;
                }
                let voxel = [o % nx, o / nx, k];
                let stride = [1, nx, plane];
                let mut g = [0f32; 3];
                for a in 0..3 {
                    if voxel[a] == 0 || voxel[a] + 1 == dims[a] {
                        continue;
                    }
                    let (before, after) = (n - stride[a], n + stride[a]);
                    // An edge towards something unknown is no edge.
                    if weight[before] != 0.0 && weight[after] != 0.0 {
                        g[a] = 0.25
                            * ((moving[after] - moving[before]) * scale_m + (fixed[after] - fixed[before]) * scale_f);
                    }
                }
                let difference = (fixed[n] - mean_f) * scale_f - (moving[n] - mean_m) * scale_m;
                let g2 = g[0] * g[0] + g[1] * g[1] + g[2] * g[2];
                // Where the windows do not correlate, the difference says little about a shift.
                let step = r * difference / (g2 + difference * difference + 1e-6);
                (ox[o], oy[o], oz[o]) = (step * g[0], step * g[1], step * g[2]);
            }
            total
        })
        .collect();
    let (sum, known) = correlation.iter().fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
    (out, if known > 0.0 { sum / known } else { 0.0 })
}

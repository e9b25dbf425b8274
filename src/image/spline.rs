//! The cubic B-spline through the values of a volume, mirrored at its border: sharp, may overshoot by a few percent at edges.

use super::pieces::each_piece;
use super::volume::Volume;
use crate::geometry::Frame;

/// Weights of the cubic B-spline on the four centres around a point at `t` in 0..1 past the second.
#[inline]
fn weights(t: f64) -> [f32; 4] {
    let s = 1.0 - t;
    let sixth = 1.0 / 6.0;
    [
        (s * s * s * sixth) as f32,
        (2.0 / 3.0 - 0.5 * t * t * (2.0 - t)) as f32,
        (2.0 / 3.0 - 0.5 * s * s * (2.0 - s)) as f32,
        (t * t * t * sixth) as f32,
    ]
}

/// The spline at a point within the outermost centres.
pub(super) fn value_at<F: Frame>(coefficients: &Volume<f32, F>, v: [f64; 3]) -> f32 {
    let dims = coefficients.grid.dims;
    // By way of 32 bits: the cheaper cast (docs/evidence/choices.md).
    let base = v.map(|x| x as u32 as isize - 1);
    let weight: [[f32; 4]; 3] = std::array::from_fn(|a| weights(v[a] - (base[a] + 1) as f64));
    // Mirrored at the outermost centres, as the coefficients were found.
    let place = |a: usize, t: usize| {
        let n = dims[a] as isize;
        let p = (base[a] + t as isize).abs();
        let p = if p >= n { 2 * n - 2 - p } else { p };
        p.clamp(0, n - 1) as usize
    };
    let within = (0..3).all(|a| base[a] >= 0 && base[a] + 4 <= dims[a] as isize);
    // Four neighbours along x at a time, closed along x at the end.
    let mut sums = [0f32; 4];
    for (c, wz) in weight[2].iter().enumerate() {
        for (b, wy) in weight[1].iter().enumerate() {
            let row = coefficients.grid.index(0, place(1, b), place(2, c));
            let four: [f32; 4] = if within {
                let first = row + base[0] as usize;
                coefficients.data[first..first + 4].try_into().expect("four of them")
            } else {
                std::array::from_fn(|t| coefficients.data[row + place(0, t)])
            };
            let w = wy * wz;
            sums.iter_mut().zip(four).for_each(|(sum, x)| *sum += w * x);
        }
    }
    sums.iter().zip(weight[0]).map(|(sum, w)| w * sum).sum()
}

/// Coefficients of the cubic B-spline that passes through the values, mirrored at the border.
///
/// M. Unser, "Splines: a perfect fit for signal and image processing", IEEE Signal Processing Magazine 16(6), 1999:
/// a causal and an anticausal recursion with the pole sqrt(3) - 2 along each axis.
pub(super) fn coefficients<F: Frame>(volume: &Volume<f32, F>) -> Volume<f32, F> {
    let [nx, ny, nz] = volume.grid.dims;
    let mut out = volume.clone();
    each_piece(&mut out.data, nx * ny, &|_, plane| {
        for row in plane.chunks_exact_mut(nx) {
            prefilter(row, 1);
        }
        prefilter(plane, nx);
    });
    if nz > 1 {
        // Lines along k: gathered by j into contiguous (k, i) slabs, each filtered by one task.
        let mut slabs = vec![0f32; out.data.len()];
        each_piece(&mut slabs, nx * nz, &|first, slab| {
            let j = first / (nx * nz);
            for (k, row) in slab.chunks_exact_mut(nx).enumerate() {
                row.copy_from_slice(&out.data[(k * ny + j) * nx..][..nx]);
            }
            prefilter(slab, nx);
        });
        each_piece(&mut out.data, nx * ny, &|first, plane| {
            let k = first / (nx * ny);
            for (j, row) in plane.chunks_exact_mut(nx).enumerate() {
                row.copy_from_slice(&slabs[(j * nz + k) * nx..][..nx]);
            }
        });
    }
    out
}

/// Zero for what has died away: far from anything bright, in air set to 0, the recursion would go on in numbers so small
/// that processors take a hundred times as long over each.
#[inline(always)]
fn settled(x: f64) -> f64 {
    if x.abs() < 1e-30 { 0.0 } else { x }
}

/// Filters along the slow axis of `data`, whose fast axis holds `width` independent lines.
fn prefilter(data: &mut [f32], width: usize) {
    let n = data.len() / width;
    if n < 2 {
        return;
    }
    let pole = 3f64.sqrt() - 2.0;
    let gain = (1.0 - pole) * (1.0 - 1.0 / pole);
    let mut first = vec![0f64; width];
    // The causal start: the mirrored signal's geometric sum; pole^30 is below f32 rounding.
    for (q, row) in data.chunks_exact(width).enumerate().take(30) {
        let weight = pole.powi(q as i32);
        first.iter_mut().zip(row).for_each(|(s, &x)| *s += weight * f64::from(x));
    }
    if n < 30 {
        // A short line: the sum goes on over the mirror image, period 2n - 2, which a closed form ends.
        let period = pole.powi(2 * n as i32 - 2);
        for q in n..2 * n - 2 {
            let weight = pole.powi(q as i32);
            let row = &data[(2 * n - 2 - q) * width..][..width];
            first.iter_mut().zip(row).for_each(|(s, &x)| *s += weight * f64::from(x));
        }
        for s in &mut first {
            *s /= 1.0 - period;
        }
    }
    let mut state: Vec<f64> = first.iter().map(|s| s * gain).collect();
    data[..width].iter_mut().zip(&state).for_each(|(x, &s)| *x = s as f32);
    for row in data.chunks_exact_mut(width).skip(1) {
        for (x, s) in row.iter_mut().zip(&mut state) {
            *s = settled(gain * f64::from(*x) + pole * *s);
            *x = *s as f32;
        }
    }
    let (head, last) = data.split_at_mut((n - 1) * width);
    let before = &head[(n - 2) * width..];
    for ((x, &b), s) in last.iter_mut().zip(before).zip(&mut state) {
        *s = pole / (pole * pole - 1.0) * (f64::from(*x) + pole * f64::from(b));
        *x = *s as f32;
    }
    for row in head.chunks_exact_mut(width).rev() {
        for (x, s) in row.iter_mut().zip(&mut state) {
            *s = settled(pole * (*s - f64::from(*x)));
            *x = *s as f32;
        }
    }
}

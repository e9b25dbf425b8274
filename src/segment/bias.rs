//! The smooth gain of the receive coil: a polynomial in space, in the logarithm of the intensity.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Monomials x^a y^b z^c with 1 <= a + b + c <= 3 in coordinates scaled to -1..1 over the image.
const TERMS: usize = 19;
/// Samples summed before partial sums are added in order: independent of the number of threads.
const CHUNK: usize = 8192;

/// The logarithm of the gain, up to third order, without a constant: the mean over the brain is kept at zero.
#[derive(Clone, Debug, PartialEq)]
pub struct LogBias {
    dims: [usize; 3],
    coefficients: [f64; TERMS],
    mean: f64,
}

/// One observation of the gain: voxel, logarithm of (intensity / expected intensity), weight.
pub(super) struct LogRatio {
    pub voxel: [usize; 3],
    pub log_ratio: f64,
    pub weight: f64,
}

impl LogBias {
    /// No gain anywhere on a grid of these dimensions.
    pub fn flat(dims: [usize; 3]) -> Self {
        Self { dims, coefficients: [0.0; TERMS], mean: 0.0 }
    }

    /// Logarithm of the gain at a voxel.
    #[inline]
    pub fn at(&self, voxel: [usize; 3]) -> f64 {
        let terms = monomials(self.dims, voxel);
        let mut sum = -self.mean;
        for n in 0..TERMS {
            sum += self.coefficients[n] * terms[n];
        }
        sum
    }

    /// Weighted least squares over the observations with a weak pull to zero; the field's mean over `region` becomes zero.
    ///
    /// The order is 1 to 3; higher terms stay zero.
    pub(super) fn fit(dims: [usize; 3], order: usize, observations: &[LogRatio], region: &[[usize; 3]]) -> Self {
        let used: Vec<usize> = (0..TERMS).filter(|&n| DEGREE[n] <= order).collect();
        let size = used.len() + 1;
        // Normal equations with a free constant: it takes up the error of the class means, and is dropped.
        let sums = observations.par_chunks(CHUNK).map(|chunk| {
            let mut normal = DMatrix::<f64>::zeros(size, size);
            let mut right = DVector::<f64>::zeros(size);
            for o in chunk {
                let terms = monomials(dims, o.voxel);
                let row = |a: usize| if a == 0 { 1.0 } else { terms[used[a - 1]] };
                for a in 0..size {
                    right[a] += o.weight * row(a) * o.log_ratio;
                    for b in 0..=a {
                        normal[(a, b)] += o.weight * row(a) * row(b);
                    }
                }
            }
            (normal, right)
        });
        let parts: Vec<_> = sums.collect();
        let (mut normal, mut right) = (DMatrix::<f64>::zeros(size, size), DVector::<f64>::zeros(size));
        for (n, r) in &parts {
            normal += n;
            right += r;
        }
        let total_weight = normal[(0, 0)].max(f64::MIN_POSITIVE);
        for a in 0..size {
            for b in a + 1..size {
                normal[(a, b)] = normal[(b, a)];
            }
            if a > 0 {
                // A gain of 30 % is common, one of 300 % is not: a prior of standard deviation about 1 on coefficients
                // against log ratios known to about 0.1 from some hundred independent patches.
                normal[(a, a)] += 1e-4 * total_weight;
            }
        }
        let mut field = Self::flat(dims);
        let Some(solution) = normal.cholesky().map(|c| c.solve(&right)) else { return field };
        for (a, &n) in used.iter().enumerate() {
            field.coefficients[n] = solution[a + 1];
        }
        let parts: Vec<f64> = region.par_chunks(CHUNK).map(|c| c.iter().map(|&v| field.at(v)).sum()).collect();
        field.mean = parts.iter().sum::<f64>() / (region.len().max(1)) as f64;
        field
    }
}

const DEGREE: [usize; TERMS] = [1, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3];

#[inline]
fn monomials(dims: [usize; 3], voxel: [usize; 3]) -> [f64; TERMS] {
    let [x, y, z] = [0, 1, 2].map(|a| 2.0 * voxel[a] as f64 / (dims[a].max(2) - 1) as f64 - 1.0);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        x,
        y,
        z,
        xx,
        yy,
        zz,
        x * y,
        x * z,
        y * z,
        xx * x,
        yy * y,
        zz * z,
        xx * y,
        xx * z,
        yy * x,
        yy * z,
        zz * x,
        zz * y,
        x * y * z,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_gain_comes_back_with_zero_mean() {
        let dims = [21, 31, 41];
        let mut truth = LogBias::flat(dims);
        for n in 0..TERMS {
            truth.coefficients[n] = 0.02 * (n as f64 - 9.0);
        }
        let region: Vec<[usize; 3]> =
            (0..21 * 31 * 41).map(|n| [n % 21, n / 21 % 31, n / (21 * 31)]).filter(|v| v[0] > 2 && v[2] < 35).collect();
        let observations: Vec<LogRatio> =
            region.iter().map(|&voxel| LogRatio { voxel, log_ratio: 0.7 + truth.at(voxel), weight: 2.0 }).collect();
        let found = LogBias::fit(dims, 3, &observations, &region);
        let mean = region.iter().map(|&v| found.at(v)).sum::<f64>() / region.len() as f64;
        assert!(mean.abs() < 1e-12);
        let offset = found.at(region[0]) - truth.at(region[0]);
        let worst = region.iter().map(|&v| (found.at(v) - truth.at(v) - offset).abs()).fold(0.0, f64::max);
        assert!(worst < 0.01, "{worst}");
    }
}

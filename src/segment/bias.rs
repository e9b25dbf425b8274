//! The smooth gain of the receive coil: a polynomial in space, in the logarithm of the intensity.

use nalgebra::DMatrix;
use rayon::prelude::*;

/// Monomials x^a y^b z^c with 1 <= a + b + c <= 3 in coordinates scaled to -1..1 over the image.
const TERMS: usize = 19;
/// A coil's gain varies by some 15 %: what each term of it is expected to change over the brain before anything is seen (standard
/// deviations, as a share of the intensity). Measured in docs/evidence/choices.md.
const USUAL_CHANGE: f64 = 0.15;
/// Regions of the brain whose tissue has a brightness of its own: four lobes, insula, basal ganglia, thalamus and
/// cerebellum of either side, and the brain stem. What all voxels of a region say of the gain is one observation. Counting
/// every voxel, the field takes up anatomy and calls twice as much grey matter of the template, which has no bias, white.
const REGIONS: f64 = 17.0;
/// A constant, the terms, the right side.
const ROW: usize = TERMS + 2;
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
    pub log_gain: f64,
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
        self.at_point(voxel.map(|v| v as f64))
    }

    /// Logarithm of the gain at a point in voxels; beyond the grid it is as at its border.
    #[inline]
    pub(super) fn at_point(&self, voxel: [f64; 3]) -> f64 {
        let terms = monomials(self.dims, voxel);
        let mut sum = -self.mean;
        for n in 0..TERMS {
            sum += self.coefficients[n] * terms[n];
        }
        sum
    }

    /// Weighted least squares over the observations with a pull to zero that grows with what the field leaves
    /// unexplained; the field's mean over `region` becomes zero.
    ///
    /// The order is 1 to 3; higher terms stay zero.
    pub(super) fn fit(dims: [usize; 3], order: usize, observations: &[LogRatio], region: &[[usize; 3]]) -> Self {
        let used: Vec<usize> = (0..TERMS).filter(|&n| DEGREE[n] <= order).collect();
        // Unknowns: a constant, which takes up the error of the class means and is dropped, then the coefficients.
        // The last row holds the right side and the sum of squares.
        let size = used.len() + 1;
        let parts: Vec<_> = observations.par_chunks(CHUNK).map(|chunk| products(dims, &used, chunk)).collect();
        let sums = parts.iter().fold(DMatrix::<f64>::zeros(size + 1, size + 1), |sum, part| {
            sum + DMatrix::from_fn(size + 1, size + 1, |a, b| part[a.max(b)][a.min(b)])
        });
        let right = sums.view((0, size), (size, 1)).into_owned();
        let total_weight = sums[(0, 0)].max(f64::MIN_POSITIVE);
        // How much a term differs over the brain: the higher its order the less, and its coefficient is the larger for it.
        let variance = |a: usize| sums[(a, a)] / total_weight - (sums[(a, 0)] / total_weight).powi(2);
        let solved = |ridge: f64| {
            let mut normal = sums.view((0, 0), (size, size)).into_owned();
            for a in 1..size {
                normal[(a, a)] += ridge * variance(a).max(1e-9);
            }
            normal.cholesky().map(|c| c.solve(&right))
        };
        // What even a free field leaves unexplained is the tissue's own variance.
        let unexplained = |free: DMatrix<f64>| (sums[(size, size)] - free.dot(&right)).max(0.0);
        let ridge = |unexplained: f64| unexplained / (REGIONS * USUAL_CHANGE.powi(2));
        let solution = solved(1e-9 * total_weight).and_then(|free| solved(ridge(unexplained(free))));
        let mut field = Self::flat(dims);
        let Some(solution) = solution else { return field };
        for (a, &n) in used.iter().enumerate() {
            field.coefficients[n] = solution[a + 1];
        }
        let parts: Vec<f64> = region.par_chunks(CHUNK).map(|c| c.iter().map(|&v| field.at(v)).sum()).collect();
        field.mean = parts.iter().sum::<f64>() / (region.len().max(1)) as f64;
        field
    }
}

/// Weighted products of the rows of a chunk of observations: 1, the used terms, the right side; the lower triangle counts.
/// Rows of a fixed length, the rest zeros, so that a row of products is a few vector instructions.
fn products(dims: [usize; 3], used: &[usize], chunk: &[LogRatio]) -> [[f64; ROW]; ROW] {
    let mut sums = [[0.0; ROW]; ROW];
    let size = used.len() + 1;
    for o in chunk {
        let terms = monomials(dims, o.voxel.map(|v| v as f64));
        let mut row = [0.0; ROW];
        row[0] = 1.0;
        for (a, &n) in used.iter().enumerate() {
            row[a + 1] = terms[n];
        }
        row[size] = o.log_gain;
        for (sums, a) in sums.iter_mut().zip(row) {
            let weighted = o.weight * a;
            sums.iter_mut().zip(row).for_each(|(sum, b)| *sum += weighted * b);
        }
    }
    sums
}

const DEGREE: [usize; TERMS] = [1, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3];

#[inline]
fn monomials(dims: [usize; 3], voxel: [f64; 3]) -> [f64; TERMS] {
    let [x, y, z] = [0, 1, 2].map(|a| (2.0 * voxel[a] / (dims[a].max(2) - 1) as f64 - 1.0).clamp(-1.0, 1.0));
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

    /// How much is found of a gain that changes by 15 % over the brain, beside tissue that differs by 12 % from voxel to voxel.
    #[test]
    fn a_gain_of_any_order_is_believed_alike() {
        let dims = [41; 3];
        // A brain: an ellipsoid some way inside the image.
        let within = |v: &[usize; 3]| (0..3).map(|a| (v[a] as f64 / 20.0 - 1.0).powi(2)).sum::<f64>() < 0.6;
        let region: Vec<[usize; 3]> =
            (0..41 * 41 * 41).map(|n| [n % 41, n / 41 % 41, n / (41 * 41)]).filter(within).collect();
        let share = |term: usize| {
            let mut truth = LogBias::flat(dims);
            truth.coefficients[term] = 1.0;
            let values: Vec<f64> = region.iter().map(|&v| truth.at(v)).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let sd = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
            let tissue = |n: usize| if n.is_multiple_of(2) { 0.12 } else { -0.12 };
            let seen = |(n, &voxel): (usize, &[usize; 3])| LogRatio {
                voxel,
                log_gain: 0.15 * (values[n] - mean) / sd + tissue(n),
                weight: 1.0,
            };
            let observations: Vec<LogRatio> = region.iter().enumerate().map(seen).collect();
            let found = LogBias::fit(dims, 3, &observations, &region);
            let along: f64 = region.iter().zip(&values).map(|(&v, x)| found.at(v) * (x - mean) / sd).sum();
            along / values.len() as f64 / 0.15
        };
        for term in 0..TERMS {
            assert!((0.9..1.02).contains(&share(term)), "{term}: {}", share(term));
        }
    }

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
            region.iter().map(|&voxel| LogRatio { voxel, log_gain: 0.7 + truth.at(voxel), weight: 2.0 }).collect();
        let found = LogBias::fit(dims, 3, &observations, &region);
        let mean = region.iter().map(|&v| found.at(v)).sum::<f64>() / region.len() as f64;
        assert!(mean.abs() < 1e-12);
        let offset = found.at(region[0]) - truth.at(region[0]);
        let worst = region.iter().map(|&v| (found.at(v) - truth.at(v) - offset).abs()).fold(0.0, f64::max);
        assert!(worst < 0.01, "{worst}");
    }
}

//! A Gaussian process over what a model leaves unexplained, its size and length by the most probable values.
//!
//! Rasmussen and Williams, "Gaussian Processes for Machine Learning", MIT Press 2006, chapters 2 and 5; the three
//! components are independent of each other and share size and length.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// What is left over at a point.
#[derive(Clone, Copy, Debug)]
pub struct Residual {
    /// Where, mm.
    pub x_mm: [f64; 3],
    /// How much, mm.
    pub value_mm: [f64; 3],
    /// Standard deviation of the noise of one component, mm.
    pub noise_mm: f64,
}

/// The process, conditioned on residuals.
#[derive(Clone, Debug)]
pub struct Process {
    /// Standard deviation of one component of the process, mm.
    pub size_mm: f64,
    /// Length over which it changes, mm.
    pub length_mm: f64,
    /// Factor on the noise that was stated, where the residuals show more.
    pub noise_factor: f64,
    points: Vec<[f64; 3]>,
    weights: [DVector<f64>; 3],
    factor: Cholesky<f64, Dyn>,
}

/// Lengths that are tried, mm: from what a registration resolves to half a brain.
const LENGTHS_MM: [f64; 6] = [8.0, 12.0, 18.0, 27.0, 40.0, 60.0];
/// Sizes that are tried, as shares of the residuals' own.
const SIZES: [f64; 6] = [0.25, 0.5, 0.75, 1.0, 1.4, 2.0];
/// Factors on the noise that are tried: more than was stated may show, less is not believed.
const NOISES: [f64; 4] = [1.0, 1.5, 2.2, 3.3];

/// Matern's covariance of smoothness 3/2.
fn covariance(a: [f64; 3], b: [f64; 3], length_mm: f64) -> f64 {
    let d2: f64 = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum();
    let r = 3f64.sqrt() * d2.sqrt() / length_mm;
    (1.0 + r) * (-r).exp()
}

impl Process {
    /// The most probable process behind the residuals; `None` without any, or when they are all zero.
    pub fn fitted(residuals: &[Residual]) -> Option<Self> {
        let rms = (residuals.iter().flat_map(|r| r.value_mm).map(|v| v * v).sum::<f64>()
            / (3 * residuals.len()).max(1) as f64)
            .sqrt();
        if !(rms > 1e-6 && rms.is_finite()) {
            return None;
        }
        let mut tried = Vec::new();
        for length_mm in LENGTHS_MM {
            for share in SIZES {
                tried.extend(NOISES.map(|noise| (length_mm, share * rms, noise)));
            }
        }
        let found: Vec<Option<f64>> =
            tried.par_iter().map(|&(l, s, n)| Self::with(residuals, l, s, n).map(|p| p.evidence(residuals))).collect();
        // The first of equals: the answer does not depend on how ties are broken.
        let mut best: Option<(f64, usize)> = None;
        for (n, evidence) in found.into_iter().enumerate() {
            if let Some(evidence) = evidence
                && best.is_none_or(|(most, _)| evidence > most)
            {
                best = Some((evidence, n));
            }
        }
        let (length_mm, size_mm, noise) = tried[best?.1];
        Self::with(residuals, length_mm, size_mm, noise)
    }

    fn with(residuals: &[Residual], length_mm: f64, size_mm: f64, noise_factor: f64) -> Option<Self> {
        let count = residuals.len();
        let k = DMatrix::from_fn(count, count, |a, b| {
            let noise = if a == b { (noise_factor * residuals[a].noise_mm).powi(2) } else { 0.0 };
            size_mm * size_mm * covariance(residuals[a].x_mm, residuals[b].x_mm, length_mm) + noise
        });
        let factor = k.cholesky()?;
        let weights =
            [0, 1, 2].map(|c| factor.solve(&DVector::from_iterator(count, residuals.iter().map(|r| r.value_mm[c]))));
        let points = residuals.iter().map(|r| r.x_mm).collect();
        Some(Self { size_mm, length_mm, noise_factor, points, weights, factor })
    }

    /// Logarithm of the residuals' probability, without its constant.
    fn evidence(&self, residuals: &[Residual]) -> f64 {
        let fit: f64 = residuals
            .iter()
            .enumerate()
            .map(|(n, r)| (0..3).map(|c| r.value_mm[c] * self.weights[c][n]).sum::<f64>())
            .sum();
        let log_determinant: f64 = self.factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        -0.5 * fit - 1.5 * log_determinant
    }

    /// Mean (mm) and standard deviation of one component (mm) at a point.
    pub fn at(&self, x_mm: [f64; 3]) -> ([f64; 3], f64) {
        let variance = self.size_mm * self.size_mm;
        let k = DVector::from_iterator(
            self.points.len(),
            self.points.iter().map(|p| variance * covariance(*p, x_mm, self.length_mm)),
        );
        let mean = [0, 1, 2].map(|c| k.dot(&self.weights[c]));
        let explained = self.factor.l_dirty().solve_lower_triangular(&k).map_or(0.0, |s| s.norm_squared());
        (mean, (variance - explained).max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::random::CounterRng;

    fn scattered(count: u64, value: impl Fn([f64; 3]) -> [f64; 3], noise_mm: f64) -> Vec<Residual> {
        (0..count)
            .map(|n| {
                let rng = CounterRng::new(3, n);
                let x = [0, 1, 2].map(|a| rng.between(a, -40.0, 40.0));
                let v = value(x);
                let noise = |a: u64| noise_mm * (0..12).map(|k| rng.uniform(100 + 12 * a + k) - 0.5).sum::<f64>();
                Residual { x_mm: x, value_mm: [v[0] + noise(0), v[1] + noise(1), v[2] + noise(2)], noise_mm }
            })
            .collect()
    }

    #[test]
    fn a_smooth_residual_is_found_again_between_its_points_and_the_spread_covers_the_error() {
        let smooth = |x: [f64; 3]| [(x[0] / 25.0).sin(), 0.5 * (x[1] / 30.0).cos(), 0.01 * x[2]];
        let process = Process::fitted(&scattered(180, smooth, 0.05)).unwrap();
        assert!(process.length_mm > 12.0, "{}", process.length_mm);
        let (mut squares, mut within, mut count) = (0.0, 0, 0);
        for n in 0..200 {
            let rng = CounterRng::new(9, n);
            let x = [0, 1, 2].map(|a| rng.between(a, -30.0, 30.0));
            let (mean, sd) = process.at(x);
            for c in 0..3 {
                let off = mean[c] - smooth(x)[c];
                squares += off * off;
                within += usize::from(off.abs() < 1.96 * sd);
                count += 1;
            }
        }
        assert!((squares / f64::from(count)).sqrt() < 0.08, "{}", (squares / f64::from(count)).sqrt());
        assert!(f64::from(within as u32) / f64::from(count) > 0.85, "{within} of {count}");
    }

    #[test]
    fn far_from_every_residual_the_process_knows_nothing() {
        let process = Process::fitted(&scattered(60, |x| [0.02 * x[0], 0.0, 1.0], 0.1)).unwrap();
        let (mean, sd) = process.at([1000.0, 0.0, 0.0]);
        assert!(mean.iter().all(|m| m.abs() < 1e-6) && (sd - process.size_mm).abs() < 1e-6);
    }

    #[test]
    fn no_residual_is_no_process() {
        assert!(Process::fitted(&[]).is_none());
        assert!(Process::fitted(&scattered(10, |_| [0.0; 3], 0.0)).is_none());
    }
}

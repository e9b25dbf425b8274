//! Intervals of the spreads by a short deterministic quadrature.
//!
//! In its logarithm a spread that the studies hardly bound has a long tail towards zero, which a normal approximation
//! misses. Each spread is therefore moved through a few points; the others follow to where the approximation expects
//! them, and the height they would still gain there is taken from the gradient (one Newton step of the profile). The
//! density along the points is integrated.

use super::fit::{StudyLevelFit, density};
use super::spreads::SPREADS;
use super::study::Studies;
use nalgebra::{DVector, linalg::Cholesky};

/// Where the density is looked at, in standard deviations of the approximation: further down than up.
const AT: [f64; 14] = [-6.0, -4.5, -3.3, -2.4, -1.6, -0.8, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.2, 4.0];
/// What a Newton step may promise at most, in log density: beyond, the approximation is not trusted.
const MOST_GAIN: f64 = 2.0;
/// Steps of the integration between two points.
const STEPS: usize = 40;
/// What lies below and above the interval.
const TAIL: f64 = 0.05;

/// The central 90 % interval of each spread about a fit; `None` where the studies do not bound them.
pub fn intervals(studies: &Studies, fit: &StudyLevelFit) -> Option<[[f64; 2]; SPREADS]> {
    let (curvature, at) = (&fit.curvature, fit.spreads.to_array().map(f64::ln));
    let covariance = Cholesky::new(curvature.clone())?.inverse();
    let mut found = [[0.0; 2]; SPREADS];
    for (n, interval) in found.iter_mut().enumerate() {
        let sd = covariance[(n, n)].sqrt();
        let others: Vec<usize> = (0..SPREADS).filter(|m| *m != n).collect();
        let inner = Cholesky::new(curvature.select_rows(&others).select_columns(&others))?;
        let height = |step: &f64| -> f64 {
            let moved: Vec<f64> =
                (0..SPREADS).map(|m| at[m] + step * sd * covariance[(m, n)] / covariance[(n, n)]).collect();
            let Some((value, slope)) = density(studies, &moved) else { return f64::NEG_INFINITY };
            let slope = DVector::from_fn(SPREADS - 1, |i, _| slope[others[i]]);
            value + (0.5 * slope.dot(&inner.solve(&slope))).min(MOST_GAIN)
        };
        let heights: Vec<f64> = AT.iter().map(height).collect();
        *interval = quantiles(&heights).map(|step| (at[n] + step * sd).exp());
    }
    Some(found)
}

/// Quantiles of a law whose log density is known at the points.
fn quantiles(heights: &[f64]) -> [f64; 2] {
    let top = heights.iter().fold(f64::NEG_INFINITY, |top, h| top.max(*h));
    let mut places = Vec::new();
    for window in AT.windows(2) {
        let step = (window[1] - window[0]) / STEPS as f64;
        places.extend((0..STEPS).map(|k| (window[0] + (k as f64 + 0.5) * step, step)));
    }
    let shares: Vec<f64> = places.iter().map(|(x, step)| step * (cubic(heights, *x) - top).exp()).collect();
    // Below the first point a spread that is not bounded away from zero has a density that falls like a power of it.
    let slope = (heights[1] - heights[0]) / (AT[1] - AT[0]);
    let tail = if slope > 0.0 { (heights[0] - top).exp() / slope } else { 0.0 };
    let all = tail + shares.iter().sum::<f64>();
    let below = |share: f64| {
        let mut sum = tail;
        if sum >= share * all {
            return AT[0] + (share * all / tail).ln() / slope;
        }
        for ((x, step), own) in places.iter().zip(&shares) {
            if sum + own >= share * all {
                return x + step * ((share * all - sum) / own - 0.5);
            }
            sum += own;
        }
        AT[AT.len() - 1]
    };
    [below(TAIL), below(1.0 - TAIL)]
}

/// The cubic through the four points about x.
fn cubic(heights: &[f64], x: f64) -> f64 {
    let next = AT.iter().position(|at| *at > x).unwrap_or(AT.len() - 1);
    let first = next.saturating_sub(2).min(AT.len() - 4);
    let weight =
        |i: usize| -> f64 { (first..first + 4).filter(|j| *j != i).map(|j| (x - AT[j]) / (AT[i] - AT[j])).product() };
    (first..first + 4).map(|i| weight(i) * heights[i].max(-1e6)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_normal_law_come_out() {
        let heights: Vec<f64> = AT.iter().map(|x| 3.0 - 0.5 * x * x).collect();
        let [low, high] = quantiles(&heights);
        assert!((low + 1.644_853_6).abs() < 2e-3 && (high - 1.644_853_6).abs() < 2e-3, "{low} {high}");
    }

    #[test]
    fn a_tail_towards_zero_widens_the_interval_on_that_side() {
        // A half-normal spread in its logarithm: t - exp(2 t) / 2, mode at 0, curvature 2.
        let at = |x: f64| x / 2f64.sqrt();
        let heights: Vec<f64> = AT.iter().map(|x| at(*x) - 0.5 * (2.0 * at(*x)).exp()).collect();
        let [low, high] = quantiles(&heights).map(at);
        // Quantiles of |z|: .0627 and 1.960.
        assert!((high - 1.960f64.ln()).abs() < 0.02, "{high}");
        assert!((low - 0.0627f64.ln()).abs() < 0.02, "{low}");
    }
}

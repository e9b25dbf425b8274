//! How far a point moves at most, of a mean displacement and an error that is alike in all directions.
//!
//! The size of a displacement is never negative: an error across the mean makes it longer as well, and where the mean is 0 every
//! error does. So the reach is the quantile of the size |u + e| itself (a noncentral chi of three degrees of freedom), not the
//! mean's length and the quantile of the error along it, which at rest holds of 72 % of the errors.

use statrs::function::erf::erf;
use std::f64::consts::{PI, SQRT_2};
use std::sync::LazyLock;

/// What part of the sizes the reach holds.
const SHARE: f64 = 0.95;
/// Steps of the table: linear between them, it is exact to a ten-thousandth of a standard deviation.
const STEPS: usize = 256;

/// By how much the reach is more than the mean's length, in standard deviations of a component, where that length is
/// x = t / (1 - t) of them: t runs from rest (0) to an error that is far smaller than the displacement (1).
static EXCESS: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let at = |step: usize| {
        let t = step as f64 / STEPS as f64;
        // The end of the table is the error along the mean alone: 1.645 standard deviations.
        let length = if step < STEPS { t / (1.0 - t) } else { 1e6 };
        excess(length)
    };
    (0..=STEPS).map(at).collect()
});

/// The size that 95 % of the displacements do not exceed, mm: around a mean of this length, of a standard deviation that is the
/// root of the trace of the covariance, alike in all directions.
pub fn reach_95(length_mm: f64, sd_mm: f64) -> f64 {
    let component_mm = sd_mm / 3f64.sqrt();
    if length_mm + component_mm == 0.0 {
        return 0.0;
    }
    let t = STEPS as f64 * length_mm / (length_mm + component_mm);
    let below = (t as usize).min(STEPS - 1);
    let along = t - below as f64;
    length_mm + component_mm * (EXCESS[below] * (1.0 - along) + EXCESS[below + 1] * along)
}

/// The same in standard deviations of a component, less the length.
fn excess(length: f64) -> f64 {
    let (mut low, mut high) = (0.0, 4.0);
    // A bit each.
    for _ in 0..52 {
        let middle = 0.5 * (low + high);
        if share_within(length + middle, length) < SHARE { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Share of the displacements around a mean of this length that are no longer than `size`, both in standard deviations of a
/// component.
fn share_within(size: f64, length: f64) -> f64 {
    let below = |z: f64| 0.5 * (1.0 + erf(z / SQRT_2));
    let density = |z: f64| (-0.5 * z * z).exp() / (2.0 * PI).sqrt();
    let across = if length < 1e-3 {
        2.0 * size * density(size)
    } else {
        (density(size - length) - density(size + length)) / length
    };
    below(size - length) - below(-size - length) - across
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::random::CounterRng;

    #[test]
    fn the_reach_holds_nineteen_of_twenty_sizes_wherever_the_mean_lies() {
        let count = 40_000u64;
        for (length, along_holds) in [(0.0, 0.72), (0.5, 0.87), (1.0, 0.92), (5.0, 0.96)] {
            // A component has a standard deviation of 0.4.
            let (sd_mm, u) = (0.4 * 3f64.sqrt(), 0.4 * length);
            let within = |reach: f64| {
                let size = |n: u64| {
                    let e = [0, 1, 2].map(|a| 0.4 * CounterRng::new(7, n).normal(10 * a));
                    ((u + e[0]).powi(2) + e[1] * e[1] + e[2] * e[2]).sqrt()
                };
                (0..count).filter(|&n| size(n) <= reach).count() as f64 / count as f64
            };
            let share = within(reach_95(u, sd_mm));
            assert!((share - 0.95).abs() < 4e-3, "{length}: {share}");
            // What the error along the mean alone would hold, at rest far too little.
            let before = within(u + 1.96 * 0.4);
            assert!((before - along_holds).abs() < 0.01, "{length}: {before}");
        }
    }

    #[test]
    fn the_table_is_the_quantile_itself_and_its_ends_are_known() {
        for length in [0.0, 0.0011, 0.03, 0.4, 1.7, 6.3, 41.0, 900.0] {
            let off = reach_95(length, 3f64.sqrt()) - length - excess(length);
            assert!(off.abs() < 1e-4, "{length}: {off}");
        }
        // The root of chi-squared's 95th percentile of three degrees of freedom, and the normal law's own 95th percentile.
        assert!((reach_95(0.0, 3f64.sqrt()) - 2.795_483).abs() < 1e-5);
        assert!((reach_95(1e5, 3f64.sqrt()) - 1e5 - 1.644_85).abs() < 1e-3);
        assert_eq!((reach_95(0.0, 0.0), reach_95(2.5, 0.0)), (0.0, 2.5));
    }
}

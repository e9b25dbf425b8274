//! Quantiles of a weighed sum of normal laws.

/// One of the laws: weight, mean, standard deviation.
pub(super) type Part = (f64, f64, f64);

/// The distribution function of the standard normal law, to 1.2e-7 of it: Chebyshev's fit to erfc of Press et al., Numerical
/// Recipes, section 6.2.
pub(super) fn normal(z: f64) -> f64 {
    const FIT: [f64; 10] = [
        0.170_872_77,
        -0.822_152_23,
        1.488_515_87,
        -1.135_203_98,
        0.278_868_07,
        -0.186_288_06,
        0.096_784_18,
        0.374_091_96,
        1.000_023_68,
        -1.265_512_23,
    ];
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.5 * x);
    let series = FIT.iter().fold(0.0, |sum, c| sum * t + c);
    let tail = 0.5 * t * (series - x * x).exp();
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// Mean and standard deviation of the mixture; the weights sum to 1.
pub(super) fn mean_and_sd(parts: &[Part]) -> (f64, f64) {
    let mean: f64 = parts.iter().map(|(w, m, _)| w * m).sum();
    let variance: f64 = parts.iter().map(|(w, m, s)| w * (s * s + (m - mean).powi(2))).sum();
    (mean, variance.sqrt())
}

/// Below which a share of the mixture lies, by bisection.
pub(super) fn quantile(parts: &[Part], share: f64) -> f64 {
    let below = |x: f64| parts.iter().map(|(w, m, s)| w * normal((x - m) / s)).sum::<f64>();
    let (mut low, mut high) = parts.iter().fold((f64::MAX, f64::MIN), |(low, high), (_, m, s)| {
        // No law has anything to speak of beyond nine standard deviations.
        (low.min(m - 9.0 * s), high.max(m + 9.0 * s))
    });
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if below(middle) < share { low = middle } else { high = middle }
    }
    f64::midpoint(low, high)
}

//! How sure the displacement of every node is, from how sure the parameters are.

use super::Posterior;

/// Standard deviation and 95 % reach of every node by linear propagation of the posterior.
pub(super) fn spread(
    mean: &[[f64; 3]],
    sensitivities: &[Vec<[f64; 3]>],
    posterior: &Posterior,
) -> (Vec<f64>, Vec<f64>) {
    let covariance = &posterior.log_covariance;
    let at = |n: usize, a: usize, b: usize| -> f64 {
        let mut sum = 0.0;
        for (p, row) in covariance.iter().enumerate() {
            for (q, c) in row.iter().enumerate() {
                sum += sensitivities[p][n][a] * c * sensitivities[q][n][b];
            }
        }
        sum
    };
    let sd = (0..mean.len()).map(|n| (0..3).map(|a| at(n, a, a)).sum::<f64>().max(0.0).sqrt()).collect();
    let reach = (0..mean.len()).map(|n| {
        let u = mean[n];
        let length = (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]).sqrt();
        if length < 1e-12 {
            return 0.0;
        }
        let mut variance = 0.0;
        for a in 0..3 {
            for b in 0..3 {
                variance += u[a] * at(n, a, b) * u[b] / (length * length);
            }
        }
        length + 1.96 * variance.max(0.0).sqrt()
    });
    (sd, reach.collect())
}

//! Matern 3/2 as a Markov process: f and f' lengthscale / sqrt(3) between neighbouring stretches.
//!
//! With u = sqrt(3) D / lengthscale and the scaled slope, the stationary covariance is the identity, the transition
//! e^-u [[1 + u, u], [-u, 1 - u]] and its noise I - A A^T (Hartikainen and Särkkä, MLSP 2010).

/// Transition over a gap, its noise, and the derivatives of both with respect to u.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transition {
    /// u = sqrt(3) D / lengthscale.
    pub u: f64,
    /// [a, b, c, d] of A = [[a, b], [c, d]].
    pub a: [f64; 4],
    /// [q11, q12, q22] of the noise.
    pub q: [f64; 3],
}

/// 4 (-2)^k / (k! (k + 3)): the series of q11 / u^3.
const SERIES: [f64; 10] = [
    4.0 / 3.0,
    -2.0,
    8.0 / 5.0,
    -8.0 / 9.0,
    8.0 / 21.0,
    -2.0 / 15.0,
    16.0 / 405.0,
    -16.0 / 1575.0,
    8.0 / 3465.0,
    -4.0 / 8505.0,
];

impl Transition {
    pub fn over(gap: f64, lengthscale: f64) -> Self {
        let u = 3.0_f64.sqrt() * gap / lengthscale;
        let decay = (-u).exp();
        let decay2 = decay * decay;
        let loss = -(-2.0 * u).exp_m1();
        // 1 - e^-2u (1 + 2u + 2u^2) cancels to 4u^3/3: a series where that leaves too few digits.
        let q11 = if u < 0.1 {
            u * u * u * SERIES.iter().rev().fold(0.0, |sum, coefficient| sum * u + coefficient)
        } else {
            loss - decay2 * 2.0 * u * (1.0 + u)
        };
        let q12 = 2.0 * u * u * decay2;
        let q22 = loss + decay2 * 2.0 * u * (1.0 - u);
        Self { u, a: [(1.0 + u) * decay, u * decay, -u * decay, (1.0 - u) * decay], q: [q11, q12, q22] }
    }

    /// dA/du and dQ/du.
    pub fn slopes(&self) -> ([f64; 4], [f64; 3]) {
        let (u, decay) = (self.u, (-self.u).exp());
        let decay2 = decay * decay;
        let a = [-u * decay, (1.0 - u) * decay, (u - 1.0) * decay, (u - 2.0) * decay];
        let q = [4.0 * u * u * decay2, 4.0 * u * (1.0 - u) * decay2, 4.0 * (1.0 - u) * (1.0 - u) * decay2];
        (a, q)
    }
}

/// (1 + u) e^-u, the correlation at a distance.
pub fn correlation(distance: f64, lengthscale: f64) -> f64 {
    let u = 3.0_f64.sqrt() * distance.abs() / lengthscale;
    (1.0 + u) * (-u).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_what_the_transition_loses_and_the_series_joins_smoothly() {
        for u in [1e-3, 0.02, 0.0999, 0.1001, 0.3, 2.0] {
            let t = Transition::over(u / 3.0_f64.sqrt(), 1.0);
            let [a, b, c, d] = t.a;
            let lost = [1.0 - a * a - b * b, -a * c - b * d, 1.0 - c * c - d * d];
            for (q, lost) in t.q.into_iter().zip(lost) {
                assert!((q - lost).abs() < 1e-15 + 1e-13 * lost.abs(), "u {u}: {q:e} {lost:e}");
            }
        }
        let [below, above] = [0.1 - 1e-12, 0.1 + 1e-12].map(|u| Transition::over(u / 3.0_f64.sqrt(), 1.0).q[0]);
        // Relative slope 3/u: the two sides differ by 6e-11, up to the rounding of the closed form.
        assert!((above / below - 1.0 - 6e-11).abs() < 1e-11, "{}", above / below - 1.0);
    }

    #[test]
    fn slopes_are_the_derivatives() {
        let at = |u: f64| Transition::over(u / 3.0_f64.sqrt(), 1.0);
        for u in [0.01, 0.7, 1.9] {
            let (da, dq) = at(u).slopes();
            let h = 1e-6;
            for i in 0..4 {
                assert!(((at(u + h).a[i] - at(u - h).a[i]) / (2.0 * h) - da[i]).abs() < 1e-9, "{u} {i}");
            }
            for i in 0..3 {
                assert!(((at(u + h).q[i] - at(u - h).q[i]) / (2.0 * h) - dq[i]).abs() < 1e-9, "{u} {i}");
            }
        }
    }
}

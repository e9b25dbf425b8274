//! Quasi-Newton minimisation of a smooth function of a few scaled variables (BFGS; Nocedal & Wright 2006, ch. 6).

use nalgebra::{DMatrix, DVector};

/// When to stop and how far to step; the variables are in mm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stopping {
    /// Longest step of one iteration in mm.
    pub longest_step_mm: f64,
    /// A step shorter than this ends the search.
    pub shortest_step_mm: f64,
    /// Most function evaluations.
    pub evaluations: usize,
}

/// Where the search ended.
#[derive(Clone, Debug)]
pub(super) struct Minimum {
    pub at: DVector<f64>,
    /// The last estimate of the inverse Hessian, worth keeping for a finer level.
    pub inverse_hessian: DMatrix<f64>,
    pub evaluations: usize,
}

/// Minimises `f` (value and gradient) from `start`. Without an inverse Hessian the first step has the longest length
/// allowed, along the steepest descent.
pub(super) fn minimise(
    start: DVector<f64>,
    inverse_hessian: Option<DMatrix<f64>>,
    stopping: Stopping,
    mut f: impl FnMut(&DVector<f64>) -> (f64, DVector<f64>),
) -> Minimum {
    let n = start.len();
    let mut at = start;
    let (mut value, mut gradient) = f(&at);
    let mut evaluations = 1;
    let scaled_identity =
        |g: &DVector<f64>| DMatrix::identity(n, n) * (stopping.longest_step_mm / g.norm().max(1e-300));
    let mut fresh = inverse_hessian.is_none();
    let mut h = inverse_hessian.unwrap_or_else(|| scaled_identity(&gradient));
    while evaluations < stopping.evaluations && gradient.norm() > 0.0 {
        let mut step = -(&h * &gradient);
        if step.dot(&gradient) >= 0.0 || !step.norm().is_finite() {
            h = scaled_identity(&gradient);
            fresh = true;
            step = -(&h * &gradient);
        }
        if step.norm() > stopping.longest_step_mm {
            step *= stopping.longest_step_mm / step.norm();
        }
        // Backtracking with quadratic interpolation until the value falls enough (Armijo, c = 1e-4).
        let slope = step.dot(&gradient);
        let mut scale = 1.0;
        let mut accepted = None;
        while evaluations < stopping.evaluations && scale * step.norm() >= stopping.shortest_step_mm {
            let there = &at + scale * &step;
            let (v, g) = f(&there);
            evaluations += 1;
            if v <= value + 1e-4 * scale * slope {
                accepted = Some((there, v, g));
                break;
            }
            let parabola = -slope * scale / (2.0 * (v - value - slope * scale));
            scale *= if parabola.is_finite() { parabola.clamp(0.1, 0.5) } else { 0.25 };
        }
        let Some((there, v, g)) = accepted else { break };
        let s = &there - &at;
        let y = &g - &gradient;
        let sy = s.dot(&y);
        if sy > 1e-10 * s.norm() * y.norm() {
            if fresh {
                // Scale the first guess to the curvature just seen (Nocedal & Wright, eq. 6.20).
                h = DMatrix::identity(n, n) * (sy / y.dot(&y));
                fresh = false;
            }
            let hy = &h * &y;
            h += &s * s.transpose() * ((1.0 + y.dot(&hy) / sy) / sy) - (&hy * s.transpose() + &s * hy.transpose()) / sy;
        }
        let moved = s.norm();
        (at, value, gradient) = (there, v, g);
        if moved < stopping.shortest_step_mm {
            break;
        }
    }
    Minimum { at, inverse_hessian: h, evaluations }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_of_a_curved_valley_is_found() {
        // Rosenbrock's function with a mild valley.
        let f = |x: &DVector<f64>| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            let gradient = DVector::from_vec(vec![-2.0 * a - 40.0 * b * x[0], 20.0 * b]);
            (a * a + 10.0 * b * b, gradient)
        };
        let stopping = Stopping { longest_step_mm: 1.0, shortest_step_mm: 1e-9, evaluations: 200 };
        let minimum = minimise(DVector::from_vec(vec![-1.2, 1.0]), None, stopping, f);
        assert!((minimum.at - DVector::from_vec(vec![1.0, 1.0])).norm() < 1e-5);
        assert!(minimum.evaluations < 100);
    }
}

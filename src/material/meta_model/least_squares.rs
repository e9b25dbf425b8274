//! Bounded non-linear least squares in a few parameters: the trust-region reflective method.
//!
//! Branch, Coleman and Li, "A subspace, interior, and conjugate gradient method for large-scale bound-constrained
//! minimization problems", SIAM J Sci Comput 21, 1999, with the exact trust-region step of More and Sorensen and the
//! stopping rules of MINPACK. Its course is that of the solver the published program used, because the published
//! neo-Hookean fits stop on the way (their Jacobian is wrong) and only the same course stops at the same place.

/// Residuals with their Jacobian.
pub(super) trait Residuals<const N: usize> {
    /// Residuals, appended to an empty vector.
    fn residuals(&self, parameters: &[f64; N], out: &mut Vec<f64>);
    /// Rows of d residual / d parameters, appended to an empty vector.
    fn jacobian(&self, parameters: &[f64; N], out: &mut Vec<[f64; N]>);
}

/// Lower and upper bounds, infinite where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds<const N: usize> {
    pub low: [f64; N],
    pub high: [f64; N],
}

/// Relative changes below which the search stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tolerances {
    pub cost: f64,
    pub step: f64,
    pub gradient: f64,
}

/// Where the search stopped.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Solution<const N: usize> {
    pub parameters: [f64; N],
    /// Half the sum of squared residuals.
    pub cost: f64,
    pub residuals: Vec<f64>,
    pub evaluations: usize,
    /// Whether a tolerance was met before the evaluations ran out.
    pub converged: bool,
}

type Matrix<const N: usize> = [[f64; N]; N];

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn norm<const N: usize>(a: &[f64; N]) -> f64 {
    dot(a, a).sqrt()
}

fn times<const N: usize>(a: &Matrix<N>, v: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| dot(&a[i], v))
}

fn scaled<const N: usize>(a: &[f64; N], d: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] * d[i])
}

/// Eigenvalues and eigenvectors (in columns) of a small symmetric matrix by Jacobi rotations.
fn symmetric_eigen<const N: usize>(matrix: &Matrix<N>) -> ([f64; N], Matrix<N>) {
    let mut a = *matrix;
    let mut vectors: Matrix<N> = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    for _sweep in 0..30 {
        let mut off = 0.0;
        for p in 0..N {
            for q in p + 1..N {
                off += a[p][q].abs();
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..N {
                    let (x, y) = (a[k][p], a[k][q]);
                    (a[k][p], a[k][q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..N {
                    let (x, y) = (a[p][k], a[q][k]);
                    (a[p][k], a[q][k]) = (c * x - s * y, s * x + c * y);
                    let (x, y) = (vectors[k][p], vectors[k][q]);
                    (vectors[k][p], vectors[k][q]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
        if off == 0.0 {
            break;
        }
    }
    (std::array::from_fn(|i| a[i][i]), vectors)
}

/// The quadratic model in scaled variables: g s + s (B + D) s / 2.
struct Model<const N: usize> {
    gradient: [f64; N],
    hessian: Matrix<N>,
}

impl<const N: usize> Model<N> {
    fn value(&self, s: &[f64; N]) -> f64 {
        dot(&self.gradient, s) + 0.5 * dot(s, &times(&self.hessian, s))
    }

    /// Least value along start + t direction, t in [low, high]: (t, value).
    fn along(&self, start: &[f64; N], direction: &[f64; N], low: f64, high: f64) -> (f64, f64) {
        let bent = times(&self.hessian, direction);
        let a = 0.5 * dot(direction, &bent);
        let b = dot(&self.gradient, direction) + dot(start, &bent);
        let c = self.value(start);
        let mut best = (low, low * (a * low + b) + c);
        let turning = -0.5 * b / a;
        for t in [high, turning] {
            let value = t * (a * t + b) + c;
            if t > low && t <= high && value < best.1 {
                best = (t, value);
            }
        }
        best
    }

    /// Least value within a radius; `damping` is the multiplier to start from and is left at the one found.
    fn within(&self, radius: f64, damping: &mut f64, rows: usize) -> [f64; N] {
        let (values, vectors) = symmetric_eigen(&self.hessian);
        let pull: [f64; N] = std::array::from_fn(|k| (0..N).map(|i| vectors[i][k] * self.gradient[i]).sum());
        let back = |weights: [f64; N]| -> [f64; N] {
            std::array::from_fn(|i| -(0..N).map(|k| vectors[i][k] * weights[k]).sum::<f64>())
        };
        let largest = values.iter().fold(0.0, |m: f64, v| m.max(*v));
        let smallest = values.iter().fold(f64::INFINITY, |m: f64, v| m.min(*v));
        let threshold = f64::EPSILON * rows as f64 * largest.sqrt();
        let full_rank = smallest > 0.0 && smallest.sqrt() > threshold;
        if full_rank {
            let step = back(std::array::from_fn(|k| pull[k] / values[k]));
            if norm(&step) <= radius {
                *damping = 0.0;
                return step;
            }
        }
        // phi(alpha) = |p(alpha)| - radius and its slope.
        let excess = |alpha: f64| {
            let weights: [f64; N] = std::array::from_fn(|k| pull[k] / (values[k] + alpha));
            let length = norm(&weights);
            let bend: f64 = (0..N).map(|k| pull[k] * pull[k] / (values[k] + alpha).powi(3)).sum();
            (length - radius, -bend / length)
        };
        let mut upper = norm(&pull) / radius;
        let mut lower = 0.0;
        if full_rank {
            let (phi, slope) = excess(0.0);
            lower = -phi / slope;
        }
        let mut alpha = *damping;
        let restart = |lower: f64, upper: f64| (0.001 * upper).max((lower * upper).sqrt());
        if !full_rank && alpha == 0.0 {
            alpha = restart(lower, upper);
        }
        for _ in 0..10 {
            if alpha < lower || alpha > upper {
                alpha = restart(lower, upper);
            }
            let (phi, slope) = excess(alpha);
            if phi < 0.0 {
                upper = alpha;
            }
            let ratio = phi / slope;
            lower = lower.max(alpha - ratio);
            alpha -= (phi + radius) * ratio / radius;
            if phi.abs() < 0.01 * radius {
                break;
            }
        }
        *damping = alpha;
        let step = back(std::array::from_fn(|k| pull[k] / (values[k] + alpha)));
        let stretch = radius / norm(&step);
        step.map(|s| s * stretch)
    }
}

impl<const N: usize> Bounds<N> {
    fn contain(&self, x: &[f64; N]) -> bool {
        (0..N).all(|i| self.low[i] <= x[i] && x[i] <= self.high[i])
    }

    /// Largest t with x + t s inside, and which bounds stop it.
    fn room(&self, x: &[f64; N], s: &[f64; N]) -> (f64, [bool; N]) {
        let steps: [f64; N] = std::array::from_fn(|i| {
            if s[i] == 0.0 { f64::INFINITY } else { ((self.low[i] - x[i]) / s[i]).max((self.high[i] - x[i]) / s[i]) }
        });
        let least = steps.iter().fold(f64::INFINITY, |m: f64, v| m.min(*v));
        (least, std::array::from_fn(|i| steps[i] == least && s[i] != 0.0))
    }

    /// A start strictly inside: on or beyond a bound it moves in by a relative 1e-10.
    fn pull_in(&self, x: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|i| {
            let (low, high) = (self.low[i], self.high[i]);
            let margin = |bound: f64| 1e-10 * bound.abs().max(1.0);
            let mut inside = x[i];
            if low.is_finite() && x[i] - low <= (high - x[i]).min(margin(low)) {
                inside = low + margin(low);
            } else if high.is_finite() && high - x[i] <= (x[i] - low).min(margin(high)) {
                inside = high - margin(high);
            }
            if inside < low || inside > high { 0.5 * (low + high) } else { inside }
        })
    }

    /// A step that lands on a bound moves to the next number inside.
    fn next_inside(&self, x: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|i| {
            if x[i] <= self.low[i] {
                self.low[i].next_up()
            } else if x[i] >= self.high[i] {
                self.high[i].next_down()
            } else {
                x[i]
            }
        })
    }

    /// Distance to the bound that the gradient pushes to, and its slope (Coleman and Li's scaling).
    fn scaling(&self, x: &[f64; N], gradient: &[f64; N]) -> ([f64; N], [f64; N]) {
        let mut v = [1.0; N];
        let mut slope = [0.0; N];
        for i in 0..N {
            if gradient[i] < 0.0 && self.high[i].is_finite() {
                (v[i], slope[i]) = (self.high[i] - x[i], -1.0);
            } else if gradient[i] > 0.0 && self.low[i].is_finite() {
                (v[i], slope[i]) = (x[i] - self.low[i], 1.0);
            }
        }
        (v, slope)
    }
}

/// The best of three steps that stay inside: towards the trust-region step, reflected at the bound, and along the
/// gradient. Returns the step, the scaled step and the reduction the model promises.
fn choose_step<const N: usize>(
    model: &Model<N>,
    bounds: &Bounds<N>,
    x: &[f64; N],
    d: &[f64; N],
    newton: [f64; N],
    radius: f64,
    theta: f64,
) -> ([f64; N], [f64; N], f64) {
    let plain = scaled(&newton, d);
    let moved = |s: &[f64; N]| std::array::from_fn(|i| x[i] + s[i]);
    if bounds.contain(&moved(&plain)) {
        return (plain, newton, -model.value(&newton));
    }
    let (to_bound, hits) = bounds.room(x, &plain);
    let reflected: [f64; N] = std::array::from_fn(|i| if hits[i] { -newton[i] } else { newton[i] });
    let on_bound_h = newton.map(|s| s * to_bound);
    let on_bound = moved(&plain.map(|s| s * to_bound));
    // Where the reflected ray leaves the trust region.
    let (a, b, c) =
        (dot(&reflected, &reflected), dot(&on_bound_h, &reflected), dot(&on_bound_h, &on_bound_h) - radius * radius);
    let q = -(b + (b * b - a * c).max(0.0).sqrt().copysign(b));
    let to_region = (q / a).max(c / q);
    let (to_next_bound, _) = bounds.room(&on_bound, &scaled(&reflected, d));
    let stride = to_next_bound.min(to_region);
    let mut candidates = Vec::with_capacity(3);
    let shortened = on_bound_h.map(|s| s * theta);
    candidates.push((shortened, model.value(&shortened)));
    if stride > 0.0 {
        let low = (1.0 - theta) * to_bound / stride;
        let high = if stride == to_next_bound { theta * to_next_bound } else { to_region };
        if low <= high {
            let (t, value) = model.along(&on_bound_h, &reflected, low, high);
            candidates.push((std::array::from_fn(|i| on_bound_h[i] + t * reflected[i]), value));
        }
    }
    let down = model.gradient.map(|g| -g);
    let to_region = radius / norm(&down);
    let (to_bound, _) = bounds.room(x, &scaled(&down, d));
    let limit = if to_bound < to_region { theta * to_bound } else { to_region };
    let (t, value) = model.along(&[0.0; N], &down, 0.0, limit);
    candidates.push((down.map(|s| s * t), value));
    let mut best = candidates[0];
    for candidate in &candidates[1..] {
        if candidate.1 <= best.1 {
            best = *candidate;
        }
    }
    (scaled(&best.0, d), best.0, -best.1)
}

/// Least squares from a start, inside bounds.
pub(super) fn minimise<const N: usize>(
    problem: &impl Residuals<N>,
    start: &[f64; N],
    bounds: &Bounds<N>,
    tolerances: &Tolerances,
    evaluations_limit: usize,
) -> Solution<N> {
    let half_square = |r: &[f64]| 0.5 * r.iter().map(|v| v * v).sum::<f64>();
    let mut x = bounds.pull_in(start);
    let (mut residuals, mut trial, mut jacobian) = (Vec::new(), Vec::new(), Vec::new());
    problem.residuals(&x, &mut residuals);
    let mut cost = half_square(&residuals);
    let mut evaluations = 1;
    let mut damping = 0.0;
    let mut radius = None;
    loop {
        jacobian.clear();
        problem.jacobian(&x, &mut jacobian);
        let mut gradient = [0.0; N];
        let mut normal = [[0.0; N]; N];
        for (row, r) in jacobian.iter().zip(&residuals) {
            for i in 0..N {
                gradient[i] += row[i] * r;
                for j in 0..N {
                    normal[i][j] += row[i] * row[j];
                }
            }
        }
        let (v, slope) = bounds.scaling(&x, &gradient);
        let steepness = scaled(&gradient, &v).iter().fold(0.0, |m: f64, g| m.max(g.abs()));
        let done = |converged, x, cost, residuals| Solution { parameters: x, cost, residuals, evaluations, converged };
        if !steepness.is_finite() || steepness < tolerances.gradient {
            return done(steepness.is_finite(), x, cost, residuals);
        }
        if evaluations >= evaluations_limit {
            return done(false, x, cost, residuals);
        }
        let d = v.map(f64::sqrt);
        let mut reach = radius.unwrap_or_else(|| {
            let first = norm::<N>(&std::array::from_fn(|i| x[i] / d[i]));
            if first == 0.0 { 1.0 } else { first }
        });
        let mut hessian: Matrix<N> = std::array::from_fn(|i| std::array::from_fn(|j| d[i] * normal[i][j] * d[j]));
        for i in 0..N {
            hessian[i][i] += gradient[i] * slope[i];
        }
        let model = Model { gradient: scaled(&gradient, &d), hessian };
        let theta = (1.0 - steepness).max(0.995);
        // Whether it is at an end, and met a tolerance there.
        let (finished, met) = loop {
            let newton = model.within(reach, &mut damping, residuals.len());
            let (step, step_h, promised) = choose_step(&model, bounds, &x, &d, newton, reach, theta);
            let next = bounds.next_inside(&std::array::from_fn(|i| x[i] + step[i]));
            trial.clear();
            problem.residuals(&next, &mut trial);
            evaluations += 1;
            let length_h = norm(&step_h);
            let new_cost = half_square(&trial);
            if !new_cost.is_finite() {
                reach = 0.25 * length_h;
                if evaluations >= evaluations_limit || reach == 0.0 {
                    break (true, false);
                }
                continue;
            }
            let reduction = cost - new_cost;
            let ratio = if promised > 0.0 { reduction / promised } else { 0.0 };
            let mut new_reach = reach;
            if ratio < 0.25 {
                new_reach = 0.25 * length_h;
            } else if ratio > 0.75 && length_h > 0.95 * reach {
                new_reach = 2.0 * reach;
            }
            let flat = reduction < tolerances.cost * cost && ratio > 0.25;
            let short = norm(&step) < tolerances.step * (tolerances.step + norm(&x));
            let finished = flat || short;
            if !finished {
                damping *= reach / new_reach;
                reach = new_reach;
            }
            if reduction > 0.0 {
                x = next;
                cost = new_cost;
                std::mem::swap(&mut residuals, &mut trial);
                break (finished, finished);
            }
            if finished || evaluations >= evaluations_limit {
                break (finished, finished);
            }
        };
        radius = Some(reach);
        if finished {
            return Solution { parameters: x, cost, residuals, evaluations, converged: met };
        }
    }
}

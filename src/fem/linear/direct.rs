//! Direct solution that keeps its factor: while the tangent changes little, the old factor is a preconditioner of
//! conjugate gradients that need a few iterations; when they need more, the tangent is factored again.

use super::super::reduce;
use super::factor::{Factor, Symbolic};
use super::system::{LinearReport, LinearSolver, Tangent, Within};
use std::sync::Arc;

/// Iterations with an old factor that cost about as much as a new one.
const PATIENCE: usize = 12;

/// LL^T, kept.
pub(in super::super) struct Direct {
    symbolic: Arc<Symbolic>,
    factor: Option<Factor>,
    /// The factor is that of the tangent taken up last.
    fresh: bool,
    /// The last tangent is not positive definite.
    indefinite: bool,
}

impl Direct {
    pub(in super::super) fn new(symbolic: Arc<Symbolic>) -> Self {
        Self { symbolic, factor: None, fresh: false, indefinite: false }
    }

    fn refactor(&mut self, tangent: &Tangent) {
        self.fresh = true;
        match Factor::new(&self.symbolic, tangent) {
            Some(factor) => self.factor = Some(factor),
            None => self.indefinite = true,
        }
    }
}

impl LinearSolver for Direct {
    fn prepare(&mut self, tangent: &Tangent) {
        (self.fresh, self.indefinite) = (false, false);
        if self.factor.is_none() {
            self.refactor(tangent);
        }
    }

    fn solve(&mut self, tangent: &Tangent, rhs: &[[f64; 3]], x: &mut [[f64; 3]], within: Within) -> LinearReport {
        let tolerance = within.residual();
        let mut report = LinearReport::default();
        loop {
            let Some(factor) = self.factor.as_mut().filter(|_| !self.indefinite) else {
                x.copy_from_slice(rhs);
                return LinearReport { negative_curvature: true, ..report };
            };
            let most = if self.fresh { 50 } else { PATIENCE };
            let run = conjugate_gradients(tangent, factor, rhs, x, tolerance, most);
            report.iterations += run.iterations;
            if run.reached || self.fresh {
                return LinearReport { iterations: report.iterations, ..run };
            }
            self.refactor(tangent);
        }
    }
}

/// Preconditioned by a factor, in double precision; the first step of a fresh factor is the direct solution.
fn conjugate_gradients(
    tangent: &Tangent,
    factor: &mut Factor,
    b: &[[f64; 3]],
    x: &mut [[f64; 3]],
    tolerance: f64,
    most_iterations: usize,
) -> LinearReport {
    let add = |a: &mut [[f64; 3]], factor: f64, b: &[[f64; 3]]| {
        a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a += factor * b);
    };
    let goal = tolerance * reduce::norm(b);
    let (mut r, mut z, mut q) = (b.to_vec(), vec![[0.0; 3]; b.len()], vec![[0.0; 3]; b.len()]);
    x.fill([0.0; 3]);
    factor.solve(&r, &mut z);
    let mut p = z.clone();
    let mut rho = reduce::dot(&r, &z);
    let mut report = LinearReport { reached: goal == 0.0, ..LinearReport::default() };
    while !report.reached && report.iterations < most_iterations {
        tangent.product(&p, &mut q);
        let curvature = reduce::dot(&p, &q);
        report.iterations += 1;
        if curvature.is_nan() || curvature <= 0.0 {
            if report.iterations == 1 {
                x.copy_from_slice(&p);
            }
            report.negative_curvature = true;
            break;
        }
        let alpha = rho / curvature;
        add(x, alpha, &p);
        add(&mut r, -alpha, &q);
        if reduce::norm(&r) <= goal {
            report.reached = true;
            break;
        }
        factor.solve(&r, &mut z);
        let next = reduce::dot(&r, &z);
        let beta = next / rho;
        rho = next;
        p.iter_mut().flatten().zip(z.iter().flatten()).for_each(|(p, z)| *p = z + beta * *p);
    }
    report
}

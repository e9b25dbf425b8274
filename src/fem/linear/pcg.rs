//! Preconditioned conjugate gradients (Hestenes and Stiefel, 1952), in single precision inside a double-precision
//! refinement: the matrix is read in half the bytes, and the residual that decides is the double-precision one. Larger
//! systems have a coarse correction besides the blocks of the diagonal.

use super::super::reduce::{self, by_row_pairs};
use super::block_jacobi::BlockJacobi;
use super::coarse::{Coarse, Rows};
use super::operator::{Lanes, Operator, Real, dot};
use super::system::{LinearReport, LinearSolver, Tangent, Within};

/// Conjugate gradients with a Jacobi or block-Jacobi preconditioner.
pub(in super::super) struct Pcg {
    /// 3 x 3 blocks of the diagonal, or its entries only.
    blocks: bool,
    /// Give up after this many iterations.
    most_iterations: usize,
    /// The rows, where a coarse correction is wanted.
    rows: Option<Rows>,
    /// The coarse correction, made of the first tangent, or of the last where tangents change.
    coarse: Option<Coarse>,
    /// The tangent in single precision.
    single: Option<Packed<f32>>,
    /// The tangent in double precision, once a solve has needed it.
    double: Option<Packed<f64>>,
}

/// The tangent and its preconditioner in one precision.
struct Packed<T> {
    operator: Operator<T>,
    preconditioner: BlockJacobi<T>,
    /// Relative residual that rounding lets one run reach.
    finest: f64,
}

/// Jacobi, and the coarse correction on top.
struct Preconditioner<'a, T> {
    jacobi: &'a BlockJacobi<T>,
    coarse: Option<&'a mut Coarse>,
}

impl<T: Real> Preconditioner<'_, T> {
    /// r -= alpha q and z = M^-1 r; returns r . r and r . z.
    fn advance(&mut self, alpha: T, q: &[Lanes<T>], r: &mut [Lanes<T>], z: &mut [Lanes<T>]) -> [f64; 2] {
        let jacobi = self.jacobi;
        let [square, product] = by_row_pairs(r, z, |first, r, z| {
            for (r, q) in r.iter_mut().zip(&q[first..]) {
                for lane in 0..4 {
                    r[lane] = r[lane] - alpha * q[lane];
                }
            }
            jacobi.apply(first, r, z);
            [dot(r, r), dot(r, z)]
        });
        [square, self.coarse.as_mut().map_or(product, |coarse| coarse.add(r, z))]
    }
}

/// One inner run that solves A x = b to `tolerance` |b|.
struct Inner {
    iterations: usize,
    reached: bool,
    negative_curvature: bool,
}

/// M being the preconditioner, the energy of an error is r . M^-1 r of its residual.
fn conjugate_gradients<T: Real>(
    operator: &mut Operator<T>,
    preconditioner: &mut Preconditioner<T>,
    b: &[Lanes<T>],
    x: &mut [Lanes<T>],
    within: Within,
    most_iterations: usize,
) -> Inner {
    let n = operator.rows();
    let zero = vec![[T::default(); 4]; n];
    let (mut r, mut z, mut q) = (b.to_vec(), zero.clone(), zero);
    let [square, mut rho] = preconditioner.advance(T::default(), &q, &mut r, &mut z);
    let [enough, enough_energy] = match within {
        Within::Residual(part) => [part * part * square, f64::NEG_INFINITY],
        Within::Energy(part) => [0.0, part * part * rho],
    };
    let mut p = z.clone();
    let mut best = f64::INFINITY;
    let mut since_best = 0;
    for iteration in 0..most_iterations {
        let end = |reached, negative_curvature| Inner { iterations: iteration + 1, reached, negative_curvature };
        let curvature = operator.apply(&p, &mut q);
        if curvature.is_nan() || curvature <= 0.0 {
            if iteration == 0 {
                // The preconditioned residual is still a descent direction.
                x.copy_from_slice(&p);
            }
            return end(false, true);
        }
        let step = T::of(rho / curvature);
        let [square, next] = preconditioner.advance(step, &q, &mut r, &mut z);
        let beta = T::of(next / rho);
        rho = next;
        // x += step p and p = z + beta p in one pass.
        by_row_pairs(x, &mut p, |first, x, p| {
            for ((x, p), z) in x.iter_mut().zip(p).zip(&z[first..]) {
                for lane in 0..4 {
                    x[lane] += step * p[lane];
                    p[lane] = z[lane] + beta * p[lane];
                }
            }
            []
        });
        if square <= enough || rho <= enough_energy {
            return end(true, false);
        }
        // Rounding has eaten the iteration when the residual has not fallen for long.
        if square < 0.81 * best {
            best = square;
            since_best = 0;
        } else {
            since_best += 1;
            if since_best > 400 + n / 20 {
                return end(false, false);
            }
        }
    }
    Inner { iterations: most_iterations, reached: false, negative_curvature: false }
}

/// So many times a vector, in an iteration's arithmetic; to about one, so that single precision keeps its range.
fn scaled<T: Real>(vector: &[[f64; 3]], by: f64) -> Vec<Lanes<T>> {
    vector.iter().map(|v| [T::of(v[0] * by), T::of(v[1] * by), T::of(v[2] * by), T::default()]).collect()
}

impl<T: Real> Packed<T> {
    fn new(tangent: &Tangent, blocks: bool, finest: f64) -> Self {
        Self { operator: Operator::new(tangent), preconditioner: BlockJacobi::new(tangent, blocks), finest }
    }

    /// One run, refined by nothing.
    fn once(
        &mut self,
        coarse: Option<&mut Coarse>,
        most_iterations: usize,
        within: Within,
        rhs: &[[f64; 3]],
        x: &mut [[f64; 3]],
    ) -> LinearReport {
        x.fill([0.0; 3]);
        let size = reduce::norm(rhs);
        if size == 0.0 {
            return LinearReport { reached: true, ..LinearReport::default() };
        }
        let preconditioner = &mut Preconditioner { jacobi: &self.preconditioner, coarse };
        let mut step = vec![[T::default(); 4]; rhs.len()];
        let b = scaled(rhs, 1.0 / size);
        let inner = conjugate_gradients(&mut self.operator, preconditioner, &b, &mut step, within, most_iterations);
        for (x, s) in x.iter_mut().zip(&step) {
            *x = [0, 1, 2].map(|i| size * s[i].wide());
        }
        LinearReport {
            iterations: inner.iterations,
            reached: inner.reached,
            negative_curvature: inner.negative_curvature,
        }
    }

    fn refine(
        &mut self,
        coarse: Option<&mut Coarse>,
        most_iterations: usize,
        tangent: &Tangent,
        rhs: &[[f64; 3]],
        x: &mut [[f64; 3]],
        tolerance: f64,
    ) -> LinearReport {
        let finest = self.finest;
        let Self { operator, preconditioner, .. } = self;
        let preconditioner = &mut Preconditioner { jacobi: preconditioner, coarse };
        let mut report = LinearReport::default();
        let whole = reduce::norm(rhs);
        let mut residual = rhs.to_vec();
        let mut product = vec![[0.0; 3]; rhs.len()];
        x.fill([0.0; 3]);
        let mut size = whole;
        while size > 0.0 && report.iterations < most_iterations {
            let b = scaled(&residual, 1.0 / size);
            let mut step = vec![[T::default(); 4]; rhs.len()];
            let wanted = (tolerance * whole / size).max(finest);
            let most = most_iterations - report.iterations;
            let inner = conjugate_gradients(operator, preconditioner, &b, &mut step, Within::Residual(wanted), most);
            report.iterations += inner.iterations;
            for (x, s) in x.iter_mut().zip(&step) {
                (0..3).for_each(|i| x[i] += size * s[i].wide());
            }
            if inner.negative_curvature {
                report.negative_curvature = true;
                return report;
            }
            if inner.reached && wanted * size <= tolerance * whole && wanted > 50.0 * finest {
                report.reached = true;
                return report;
            }
            tangent.product(x, &mut product);
            for ((r, b), ax) in residual.iter_mut().zip(rhs).zip(&product) {
                *r = [b[0] - ax[0], b[1] - ax[1], b[2] - ax[2]];
            }
            let next = reduce::norm(&residual);
            if next <= tolerance * whole {
                report.reached = true;
                return report;
            }
            if next.is_nan() || next >= 0.5 * size {
                return report;
            }
            size = next;
        }
        report.reached = size == 0.0;
        report
    }
}

impl Pcg {
    pub(in super::super) fn new(blocks: bool, most_iterations: usize, rows: Option<Rows>) -> Self {
        Self { blocks, most_iterations, rows, coarse: None, single: None, double: None }
    }
}

impl LinearSolver for Pcg {
    fn prepare(&mut self, tangent: &Tangent) {
        if let Some(rows) = self.rows.as_ref().filter(|rows| rows.change || self.coarse.is_none()) {
            let coarse = self.coarse.take().and_then(|coarse| coarse.before_walls(tangent));
            self.coarse = coarse.or_else(|| Coarse::new(tangent, rows));
        }
        match &mut self.single {
            Some(single) => {
                single.operator.take_up(tangent);
                single.preconditioner = BlockJacobi::new(tangent, self.blocks);
            }
            None => self.single = Some(Packed::new(tangent, self.blocks, 1e-5)),
        }
        self.double = None;
    }

    fn take_up(&mut self, tangent: &Tangent, anew: bool) {
        match &mut self.single {
            // Walls push or do not: what was made before one pushed is no preconditioner.
            Some(single) if !anew && self.rows.as_ref().is_none_or(|rows| !rows.change) => {
                single.operator.take_up(tangent);
                self.double = None;
            }
            _ => {
                if anew {
                    self.coarse = self.coarse.take().and_then(|coarse| coarse.renewed(tangent));
                }
                self.prepare(tangent);
            }
        }
    }

    fn solve(&mut self, tangent: &Tangent, rhs: &[[f64; 3]], x: &mut [[f64; 3]], within: Within) -> LinearReport {
        let (blocks, most, tolerance) = (self.blocks, self.most_iterations, within.residual());
        let single = self.single.get_or_insert_with(|| Packed::new(tangent, blocks, 1e-5));
        if let Within::Energy(_) = within {
            let report = single.once(self.coarse.as_mut(), most, within, rhs, x);
            if report.reached {
                return report;
            }
        }
        let single = single.refine(self.coarse.as_mut(), most, tangent, rhs, x, tolerance);
        if single.reached {
            return single;
        }
        // Too ill-conditioned for single precision, or truly indefinite: double precision decides.
        let double = self.double.get_or_insert_with(|| Packed::new(tangent, blocks, 1e-13));
        let mut double = double.refine(self.coarse.as_mut(), most, tangent, rhs, x, tolerance);
        double.iterations += single.iterations;
        double
    }
}

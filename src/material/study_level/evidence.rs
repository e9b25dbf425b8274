//! The exact likelihood of the spreads, its gradient, and what the studies say of the tasks' means.
//!
//! With v_c = d w_c and u_p = r w_p for standard normal w, and a curve's points reduced to T and Q^T y ([`StudyCurve`]), its
//! own part is integrated out in the form of an information matrix over m + u, G = T^T (nugget^2 + T d^2 T^T)^-1 T: no
//! difference of large numbers. A publication's information over the means follows by eliminating w_p, and the means
//! (12 tasks times the functions) by one Cholesky factor. The cost is linear in the curves and does not depend on their
//! points; curves of one grid share their matrices.
//!
//! The gradient is Fisher's identity: d ln p(y) / d ln s is the posterior mean of d ln p(y, w) / d ln s, which is w^2 - 1
//! summed over the parts that s scales (Louis, J. R. Stat. Soc. B 44, 1982).

use super::basis::{LEVEL, SIZE};
use super::spreads::{
    LEVEL_MEAN, LINEAR_SCALE, MEAN_KIND, MEAN_REGION, MEAN_SHAPE_SCALE, MEAN_TASK, NUGGET, Part, SPREADS, Spreads,
};
use super::study::{Coefficients, Square, Studies, StudyCurve};
use crate::material::task::{Region, StudyKind, TASKS, Task};
use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector, SMatrix};

/// Functions of all tasks' means.
const MEANS: usize = TASKS * SIZE;

type Tasks = SMatrix<f64, TASKS, TASKS>;

/// ln p(curves | spreads) with its gradient in the spreads' logarithms.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// Log likelihood.
    pub log_likelihood: f64,
    /// Its gradient in ln of each spread, in the order of their list.
    pub gradient: [f64; SPREADS],
    /// The tasks' means given the curves.
    pub means: MeanPosterior,
}

/// Coefficients of the tasks' mean functions given the curves.
#[derive(Clone, Debug)]
pub struct MeanPosterior {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl MeanPosterior {
    /// Covariance of the coefficients of two tasks.
    pub(super) fn between(&self, one: Task, other: Task) -> Square {
        self.covariance.fixed_view::<SIZE, SIZE>(one.index() * SIZE, other.index() * SIZE).into_owned()
    }

    /// Mean and covariance of one task's coefficients.
    pub(super) fn of(&self, task: Task) -> (Coefficients, Square) {
        let at = task.index() * SIZE;
        (self.mean.fixed_rows::<SIZE>(at).into_owned(), self.covariance.fixed_view::<SIZE, SIZE>(at, at).into_owned())
    }
}

/// What curves of one grid and one kind of spread have in common once their own part is integrated out.
struct Grid {
    /// Whether abnormal, whether scaled: what the deviations hang on.
    kind: (bool, bool),
    root: Square,
    /// d, and the spread behind each.
    deviations: Coefficients,
    behind: [usize; SIZE],
    /// L^-1 / nugget and half the logarithm of |L|^2, where L L^T = I + T d^2 T^T / nugget^2.
    whitener: Square,
    half_log: f64,
    /// G over m + u.
    outer: Square,
}

/// The curves of one task and one grid in a publication: they differ by their scores alone.
struct Alike {
    task: Task,
    grid: usize,
    /// h over m + u of each curve, and of all.
    scores: Vec<Coefficients>,
    score: Coefficients,
}

/// A publication with its part eliminated.
struct Published {
    curves: Vec<Alike>,
    kind: StudyKind,
    deviations: Coefficients,
    behind: [usize; SIZE],
    /// (I + r G r)^-1 and r h.
    shrunk: Square,
    score: Coefficients,
    /// r G of each task's curves.
    by_task: Vec<(usize, Square)>,
}

fn scaled_rows(d: &Coefficients, m: &Square) -> Square {
    Square::from_fn(|i, j| d[i] * m[(i, j)])
}

fn scaled(d: &Coefficients, m: &Square) -> Square {
    Square::from_fn(|i, j| d[i] * m[(i, j)] * d[j])
}

/// Inverse of I + m and half the logarithm of its determinant; `None` where rounding has the better of it.
fn shrink(m: &Square) -> Option<(Square, f64)> {
    let factor = Cholesky::new(Square::identity() + m)?;
    let half_log = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
    Some((factor.inverse(), half_log))
}

/// Curves of one grid and one kind of spread share their matrices, which is most of the work.
#[derive(Default)]
struct Grids(Vec<Grid>);

impl Grids {
    /// Place of a curve's grid; `None` where rounding has the better of it.
    fn place(&mut self, curve: &StudyCurve, spreads: &Spreads) -> Option<usize> {
        let kind = (curve.task.region == Region::Abnormal, curve.task.kind == StudyKind::Hyperelastic);
        let known = self.0.iter().position(|grid| grid.kind == kind && grid.root == curve.root);
        if known.is_some() {
            return known;
        }
        let (d, behind) = spreads.deviations(Part::Curve, curve.task);
        let (deviations, root) = (Coefficients::from(d), curve.root);
        let spread = Square::from_fn(|i, j| root[(i, j)] * deviations[j] / NUGGET);
        let factor = Cholesky::new(Square::identity() + spread * spread.transpose())?;
        let half_log = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        let whitener = factor.l().solve_lower_triangular(&Square::identity())? / NUGGET;
        let half = whitener * root;
        let outer = half.transpose() * half;
        self.0.push(Grid { kind, root, deviations, behind, whitener, half_log, outer });
        Some(self.0.len() - 1)
    }
}

/// The task that tells how widely a publication may differ, whatever the order of its curves: in its level as healthy tissue where it
/// speaks of any, in its shape as hyperelastic studies where it has a curve of them. Its curves of elastography and linear elasticity
/// then share that shape unscaled: what one laboratory does is one function here ([`super::predict_jointly`] scales it by the task).
pub(super) fn leading_task(curves: &[StudyCurve]) -> Task {
    let tasks = || curves.iter().map(|curve| curve.task);
    let hyperelastic = tasks().find(|task| task.kind == StudyKind::Hyperelastic);
    let healthy = tasks().find(|task| task.region != Region::Abnormal);
    let first = curves[0].task;
    Task { kind: hyperelastic.unwrap_or(first).kind, region: healthy.unwrap_or(first).region }
}

fn read_publication(
    curves: &[StudyCurve],
    spreads: &Spreads,
    grids: &mut Grids,
    log_likelihood: &mut f64,
) -> Option<Published> {
    let noise = NUGGET * NUGGET;
    let mut groups: Vec<Alike> = Vec::new();
    for curve in curves {
        let place = grids.place(curve, spreads)?;
        let grid = &grids.0[place];
        let whitened = grid.whitener * curve.turned;
        let points = curve.strains.len() as f64;
        *log_likelihood -= 0.5 * points * (std::f64::consts::TAU * noise).ln() + grid.half_log;
        *log_likelihood -= 0.5 * (curve.unexplained / noise + whitened.norm_squared());
        let score = (grid.whitener * grid.root).tr_mul(&whitened);
        match groups.iter_mut().find(|group| group.task == curve.task && group.grid == place) {
            Some(group) => {
                group.scores.push(score);
                group.score += score;
            }
            None => groups.push(Alike { task: curve.task, grid: place, scores: vec![score], score }),
        }
    }
    let task = leading_task(curves);
    let (r, behind) = spreads.deviations(Part::Publication, task);
    let deviations = Coefficients::from(r);
    let (mut all, mut score) = (Square::zeros(), Coefficients::zeros());
    let mut by_task: Vec<(usize, Square)> = Vec::new();
    for group in &groups {
        let outer = grids.0[group.grid].outer * group.scores.len() as f64;
        all += outer;
        score += group.score;
        let part = scaled_rows(&deviations, &outer);
        match by_task.iter_mut().find(|(task, _)| *task == group.task.index()) {
            Some((_, sum)) => *sum += part,
            None => by_task.push((group.task.index(), part)),
        }
    }
    let (shrunk, half_log) = shrink(&scaled(&deviations, &all))?;
    let score = deviations.component_mul(&score);
    *log_likelihood += 0.5 * score.dot(&(shrunk * score)) - half_log;
    Some(Published { curves: groups, kind: task.kind, deviations, behind, shrunk, score, by_task })
}

/// The prior of the means as M = mu + S w with w standard normal: one lower triangular 12 x 12 block per function.
struct MeanPrior {
    factors: Vec<Tasks>,
    scales: Vec<[f64; TASKS]>,
}

impl MeanPrior {
    fn new(spreads: &Spreads) -> Option<Self> {
        let factor = |f: usize| {
            let covariance = spreads.mean_covariance(f);
            Cholesky::new(Tasks::from_fn(|i, j| covariance[i][j])).map(|factor| factor.l())
        };
        let factors = (0..SIZE).map(factor).collect::<Option<_>>()?;
        Some(Self { factors, scales: (0..SIZE).map(|f| spreads.task_scales(f)).collect() })
    }

    /// S X.
    fn apply(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(MEANS, x.ncols());
        for column in 0..x.ncols() {
            for f in 0..SIZE {
                for i in 0..TASKS {
                    let sum: f64 = (0..=i).map(|j| self.factors[f][(i, j)] * x[(j * SIZE + f, column)]).sum();
                    out[(i * SIZE + f, column)] = self.scales[f][i] * sum;
                }
            }
        }
        out
    }

    /// S^T X.
    fn apply_transposed(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(MEANS, x.ncols());
        for column in 0..x.ncols() {
            for f in 0..SIZE {
                for j in 0..TASKS {
                    let term = |i: usize| self.factors[f][(i, j)] * self.scales[f][i] * x[(i * SIZE + f, column)];
                    out[(j * SIZE + f, column)] = (j..TASKS).map(term).sum();
                }
            }
        }
        out
    }
}

impl Evidence {
    /// Of spreads, given studies; `None` where the spreads are so far apart that rounding leaves no answer.
    pub fn new(studies: &Studies, spreads: &Spreads) -> Option<Self> {
        let mut log_likelihood = 0.0;
        let mut grids = Grids::default();
        let publications: Vec<Published> = studies
            .publications
            .iter()
            .map(|(_, curves)| read_publication(curves, spreads, &mut grids, &mut log_likelihood))
            .collect::<Option<_>>()?;
        let (information, score) = about_means(&publications, &grids);

        let prior = MeanPrior::new(spreads)?;
        let centre = DVector::from_fn(MEANS, |i, _| if i % SIZE == LEVEL { LEVEL_MEAN } else { 0.0 });
        let at_centre = &information * &centre;
        log_likelihood += centre.dot(&score) - 0.5 * centre.dot(&at_centre);
        let moved = prior.apply_transposed(&DMatrix::from_column_slice(MEANS, 1, (score - at_centre).as_slice()));
        let half = prior.apply_transposed(&information);
        let whitened = prior.apply_transposed(&half.transpose()) + DMatrix::identity(MEANS, MEANS);
        let factor = Cholesky::new(whitened)?;
        let whitened_covariance = inverse(&factor);
        let whitened_mean = &whitened_covariance * &moved;
        log_likelihood += 0.5 * moved.dot(&whitened_mean);
        log_likelihood -= factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();

        let mean = centre + prior.apply(&whitened_mean).column(0);
        let half = prior.apply(&whitened_covariance);
        let covariance = prior.apply(&half.transpose());
        let means = MeanPosterior { mean, covariance };

        let mut gradient = [0.0; SPREADS];
        slope_of_means(&prior, spreads, &whitened_mean, &whitened_covariance, &mut gradient);
        for publication in &publications {
            slope_of_publication(publication, &grids, &means, &mut gradient);
        }
        log_likelihood.is_finite().then_some(Self { log_likelihood, gradient, means })
    }
}

/// The inverse behind a factor, as W^T W with W = L^-1: both columns by columns, which lie together in memory.
fn inverse(factor: &Cholesky<f64, nalgebra::Dyn>) -> DMatrix<f64> {
    let lower = factor.l_dirty();
    let n = lower.nrows();
    let mut turned = DMatrix::zeros(n, n);
    for column in 0..n {
        let mut x = turned.column_mut(column);
        x[column] = 1.0;
        for i in column..n {
            x[i] /= lower[(i, i)];
            let along = -x[i];
            x.rows_mut(i + 1, n - i - 1).axpy(along, &lower.column(i).rows(i + 1, n - i - 1), 1.0);
        }
    }
    let mut inverse = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in i..n {
            let value = turned.column(i).rows(j, n - j).dot(&turned.column(j).rows(j, n - j));
            inverse[(i, j)] = value;
            inverse[(j, i)] = value;
        }
    }
    inverse
}

/// What all publications say of the means: information matrix and score.
fn about_means(publications: &[Published], grids: &Grids) -> (DMatrix<f64>, DVector<f64>) {
    let (mut information, mut score) = (DMatrix::zeros(MEANS, MEANS), DVector::zeros(MEANS));
    for publication in publications {
        for group in &publication.curves {
            let at = group.task.index() * SIZE;
            let mut block = information.fixed_view_mut::<SIZE, SIZE>(at, at);
            block += grids.0[group.grid].outer * group.scores.len() as f64;
            let mut rows = score.fixed_rows_mut::<SIZE>(at);
            rows += group.score;
        }
        let mean = publication.shrunk * publication.score;
        for (task, part) in &publication.by_task {
            let mut rows = score.fixed_rows_mut::<SIZE>(task * SIZE);
            rows -= part.transpose() * mean;
            let half = part.transpose() * publication.shrunk;
            for (other, right) in &publication.by_task {
                let mut block = information.fixed_view_mut::<SIZE, SIZE>(task * SIZE, other * SIZE);
                block -= half * right;
            }
        }
    }
    // The eliminations are symmetric but for rounding.
    let information = 0.5 * (&information + information.transpose());
    (information, score)
}

fn slope_of_means(
    prior: &MeanPrior,
    spreads: &Spreads,
    mean: &DMatrix<f64>,
    covariance: &DMatrix<f64>,
    gradient: &mut [f64; SPREADS],
) {
    let tasks: Vec<Task> = Task::all().collect();
    for f in 0..SIZE {
        let place = |t: usize| t * SIZE + f;
        let second = Tasks::from_fn(|i, j| covariance[(place(i), place(j))] + mean[place(i)] * mean[place(j)]);
        let lower = &prior.factors[f];
        // Triangular with a positive diagonal: the inverse is there.
        let inverse = lower.solve_lower_triangular(&Tasks::identity()).unwrap_or_else(Tasks::zeros);
        if f == LEVEL {
            let excess = inverse.transpose() * (second - Tasks::identity()) * inverse;
            for (i, a) in tasks.iter().enumerate() {
                for (j, b) in tasks.iter().enumerate() {
                    let add = |place: usize, sd: f64, yes: bool, gradient: &mut [f64; SPREADS]| {
                        if yes {
                            gradient[place] += sd * sd * excess[(i, j)];
                        }
                    };
                    add(MEAN_KIND, spreads.mean_kind, a.kind == b.kind, gradient);
                    add(MEAN_REGION, spreads.mean_region, a.region == b.region, gradient);
                    add(MEAN_TASK, spreads.mean_task, i == j, gradient);
                }
            }
        } else {
            gradient[MEAN_SHAPE_SCALE] += second.trace() - TASKS as f64;
            let turned = lower * second * inverse;
            let linear = tasks.iter().filter(|task| task.kind != StudyKind::Hyperelastic);
            gradient[LINEAR_SCALE] += linear.map(|task| turned[(task.index(), task.index())] - 1.0).sum::<f64>();
        }
    }
}

/// Adds the mean of w^2 - 1 of one part to the spreads behind it; `excess` is its variance less one.
fn add_part(
    mean: &Coefficients,
    excess: &Coefficients,
    behind: &[usize; SIZE],
    kind: StudyKind,
    slope: &mut [f64; SPREADS],
) {
    for f in 0..SIZE {
        let excess = mean[f] * mean[f] + excess[f];
        slope[behind[f]] += excess;
        if f != LEVEL && kind != StudyKind::Hyperelastic {
            slope[LINEAR_SCALE] += excess;
        }
    }
}

fn slope_of_publication(publication: &Published, grids: &Grids, means: &MeanPosterior, gradient: &mut [f64; SPREADS]) {
    let Published { shrunk, deviations, by_task, .. } = publication;
    let block = |i: usize, j: usize| means.covariance.fixed_view::<SIZE, SIZE>(i * SIZE, j * SIZE).into_owned();
    let mean_of = |t: usize| means.mean.fixed_rows::<SIZE>(t * SIZE).into_owned();
    let mut left = publication.score;
    for (task, part) in by_task {
        left -= part * mean_of(*task);
    }
    let mean = shrunk * left;
    // Cov(w, M_t) = -J^-1 sum_s U_s Cov(M_s, M_t).
    let with_mean = |t: usize| -> Square {
        let sum = by_task.iter().fold(Square::zeros(), |sum, (s, part)| sum + part * block(*s, t));
        -(shrunk * sum)
    };
    let crossed: Vec<(usize, Square)> = by_task.iter().map(|(t, _)| (*t, with_mean(*t))).collect();
    let mut covariance = *shrunk;
    for ((_, part), (_, cross)) in by_task.iter().zip(&crossed) {
        covariance -= cross * part.transpose() * shrunk;
    }
    add_part(&mean, &covariance.diagonal().add_scalar(-1.0), &publication.behind, publication.kind, gradient);

    let shared = scaled(deviations, &covariance);
    for group in &publication.curves {
        let (t, grid) = (group.task.index(), &grids.0[group.grid]);
        let cross = crossed.iter().find(|(s, _)| *s == t).map_or_else(Square::zeros, |(_, cross)| *cross);
        let cross = scaled_rows(deviations, &cross);
        let outer_mean = mean_of(t) + deviations.component_mul(&mean);
        let outer = block(t, t) + shared + cross + cross.transpose();
        // Given m + u, w = d (h - G (m + u)) with covariance I - d G d.
        let seen = grid.outer - grid.outer * outer * grid.outer;
        let excess = Coefficients::from_fn(|f, _| -grid.deviations[f].powi(2) * seen[(f, f)]);
        let expected = grid.outer * outer_mean;
        for score in &group.scores {
            let own_mean = grid.deviations.component_mul(&(score - expected));
            add_part(&own_mean, &excess, &grid.behind, group.task.kind, gradient);
        }
    }
}

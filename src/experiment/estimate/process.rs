//! Errors that neighbours share: Gaussian processes over space, and residuals seen through their covariance.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, Par};
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A Gaussian process of displacements with Matern's covariance of order 3/2 (Rasmussen and Williams, "Gaussian Processes
/// for Machine Learning", 4.2): continuous, once differentiable, no smoother than an error need be. The three components
/// are independent of each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Process {
    /// Standard deviation of one component, mm.
    pub sd_mm: f64,
    /// Length over which errors are alike, mm.
    pub length_mm: f64,
}

impl Process {
    /// Covariance of one component at two places this far apart, mm2.
    pub fn covariance_mm2(&self, distance_mm: f64) -> f64 {
        let r = 3f64.sqrt() * distance_mm / self.length_mm;
        self.sd_mm * self.sd_mm * (1.0 + r) * (-r).exp()
    }
}

/// Share of the variance that every place has to itself: it keeps the factor of places close together.
const OWN: f64 = 1e-6;

/// The Cholesky factor of a covariance of places.
pub struct Factor {
    lower: Mat<f64>,
    /// Logarithm of the covariance's determinant, one component.
    pub log_determinant: f64,
}

impl Factor {
    /// Of the sum of independent processes at these places (mm); `None` when it is not positive in numbers.
    pub fn new(places_mm: &[[f64; 3]], processes: &[Process]) -> Option<Self> {
        let n = places_mm.len();
        let variance: f64 = processes.iter().map(|p| p.sd_mm * p.sd_mm).sum();
        let with = |c: usize, r: usize| -> f64 {
            let distance = (Vector3::from(places_mm[r]) - Vector3::from(places_mm[c])).norm();
            processes.iter().map(|p| p.covariance_mm2(distance)).sum()
        };
        let columns: Vec<Vec<f64>> = (0..n).into_par_iter().map(|c| (c..n).map(|r| with(c, r)).collect()).collect();
        let mut lower = Mat::<f64>::zeros(n, n);
        for (c, column) in columns.iter().enumerate() {
            for (r, covariance) in (c..n).zip(column) {
                lower[(r, c)] = *covariance;
            }
            lower[(c, c)] += OWN * variance;
        }
        // One thread: the bytes do not depend on their number.
        let (params, regular) = (faer::Spec::default(), LltRegularization::default());
        let mut memory = MemBuffer::try_new(cholesky_in_place_scratch::<f64>(n, Par::Seq, params)).ok()?;
        cholesky_in_place(lower.as_mut(), regular, Par::Seq, MemStack::new(&mut memory), params).ok()?;
        let log_determinant = 2.0 * (0..n).map(|i| lower[(i, i)].ln()).sum::<f64>();
        log_determinant.is_finite().then_some(Self { lower, log_determinant })
    }

    /// L^-1 of every column, component by component: what is independent and of standard deviation 1. Rows are places,
    /// three components each.
    pub fn whiten(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, columns) = (self.lower.nrows(), rows.ncols());
        let mut parts = Mat::from_fn(n, 3 * columns, |place, k| rows[(3 * place + k % 3, k / 3)]);
        solve_lower_triangular_in_place(self.lower.as_ref(), parts.as_mut(), Par::Seq);
        DMatrix::from_fn(rows.nrows(), columns, |row, column| parts[(row / 3, 3 * column + row % 3)])
    }

    /// The inverse covariance times every column, component by component.
    pub fn solve(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, columns) = (self.lower.nrows(), rows.ncols());
        let mut parts = Mat::from_fn(n, 3 * columns, |place, k| rows[(3 * place + k % 3, k / 3)]);
        solve_lower_triangular_in_place(self.lower.as_ref(), parts.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(self.lower.transpose(), parts.as_mut(), Par::Seq);
        DMatrix::from_fn(rows.nrows(), columns, |row, column| parts[(row / 3, 3 * column + row % 3)])
    }

    /// How much of the variance of one component at each of some points is known from the places (mm2): `covariance_mm2` of
    /// a place (by its number) with a point.
    pub fn known_mm2(&self, points: usize, covariance_mm2: impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut parts = Mat::from_fn(self.lower.nrows(), points, covariance_mm2);
        solve_lower_triangular_in_place(self.lower.as_ref(), parts.as_mut(), Par::Seq);
        parts.col_iter().map(|column| column.squared_norm_l2()).collect()
    }

    /// L^T of every column, component by component: the square of its length is the variance of that sum of errors.
    pub fn lower_transposed_times(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.lower.nrows();
        DMatrix::from_fn(rows.nrows(), rows.ncols(), |row, column| {
            let (place, axis) = (row / 3, row % 3);
            (place..n).map(|below| self.lower[(below, place)] * rows[(3 * below + axis, column)]).sum()
        })
    }
}

/// `count` of the places, each as far from those before it as can be: an even cover that depends on nothing but the
/// places (Gonzalez, Theoretical Computer Science 38, 1985). Their numbers in rising order.
pub fn spread_out(places_mm: &[[f64; 3]], count: usize) -> Vec<usize> {
    if places_mm.len() <= count {
        return (0..places_mm.len()).collect();
    }
    let centre = places_mm.iter().map(|x| Vector3::from(*x)).sum::<Vector3<f64>>() / places_mm.len() as f64;
    // The first is the one nearest to the middle; the first of equals.
    let mut away: Vec<f64> = vec![f64::INFINITY; places_mm.len()];
    let nearest = |best: usize, n: usize| {
        let squared = |n: usize| (Vector3::from(places_mm[n]) - centre).norm_squared();
        if squared(n) < squared(best) { n } else { best }
    };
    let mut next = (0..places_mm.len()).fold(0, nearest);
    let mut chosen = Vec::with_capacity(count);
    for _ in 0..count {
        chosen.push(next);
        let from = Vector3::from(places_mm[next]);
        for (away, x) in away.iter_mut().zip(places_mm) {
            *away = away.min((Vector3::from(*x) - from).norm_squared());
        }
        next = (0..away.len()).fold(0, |best, n| if away[n] > away[best] { n } else { best });
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::random::CounterRng;

    fn scattered(count: u64) -> Vec<[f64; 3]> {
        let rng = CounterRng::new(3, 1);
        (0..count).map(|n| [0, 1, 2].map(|a| rng.between(3 * n + a, -60.0, 60.0))).collect()
    }

    #[test]
    fn whitened_errors_of_a_process_are_independent_and_of_unit_size() {
        let places = scattered(120);
        let process = Process { sd_mm: 0.3, length_mm: 40.0 };
        let factor = Factor::new(&places, &[process]).unwrap();
        // Whitening the columns of C gives L^T, whose squares add up to the variance.
        let covariance = DMatrix::from_fn(360, 120, |row, c| {
            let distance = (Vector3::from(places[row / 3]) - Vector3::from(places[c])).norm();
            if row % 3 == 1 { process.covariance_mm2(distance) } else { 0.0 }
        });
        let white = factor.whiten(&covariance);
        let again = factor.solve(&covariance);
        let known = factor.known_mm2(120, |place, c| covariance[(3 * place + 1, c)]);
        for c in [0, 50, 119] {
            let variance: f64 = white.column(c).norm_squared();
            assert!((variance / 0.09 - 1.0).abs() < 1e-4, "{variance}");
            assert!((known[c] - variance).abs() < 1e-9);
            // The covariance's own columns come back as unit vectors, but for what a place has to itself.
            assert!((again[(3 * c + 1, c)] - 1.0).abs() < 1e-3, "{}", again[(3 * c + 1, c)]);
        }
    }

    #[test]
    fn the_determinant_of_two_places_is_the_textbooks() {
        let process = Process { sd_mm: 2.0, length_mm: 10.0 };
        let factor = Factor::new(&[[0.0; 3], [5.0, 0.0, 0.0]], &[process]).unwrap();
        let c = process.covariance_mm2(5.0);
        let own = 4.0 * (1.0 + OWN);
        assert!((factor.log_determinant - (own * own - c * c).ln()).abs() < 1e-12);
    }

    #[test]
    fn chosen_places_cover_all_others_and_are_the_same_however_often_asked() {
        let places = scattered(2000);
        let chosen = spread_out(&places, 200);
        assert_eq!(chosen, spread_out(&places, 200));
        assert_eq!(chosen.len(), 200);
        let gap = |x: &[f64; 3], skip: Option<usize>| {
            let others = chosen.iter().filter(|&&c| Some(c) != skip);
            others.map(|&c| (Vector3::from(places[c]) - Vector3::from(*x)).norm()).fold(f64::INFINITY, f64::min)
        };
        let cover = places.iter().map(|x| gap(x, None)).fold(0.0, f64::max);
        let apart = chosen.iter().map(|&c| gap(&places[c], Some(c))).fold(f64::INFINITY, f64::min);
        assert!(cover <= apart + 1e-9, "every place is nearer to a chosen one than chosen ones to each other");
    }
}

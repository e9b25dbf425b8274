//! What is held against a model that is not exact: of all that was seen, the part that the model itself could do.
//!
//! A discrepancy that is alike over a head pays for the size of a whole movement more cheaply than for its details, and
//! details are what a registration smooths away: the most probable parameters under such a covariance come out too stiff
//! (1330 Pa for 1000 on a patient made by another solver). So the parameters are those of the least squares over the volume,
//! and the covariance says how far a discrepancy can have carried them. Tuo and Wu, "Efficient calibration for imperfect
//! computer models", Annals of Statistics 43, 2015; the covariance is that of an estimator whose weights are not the
//! errors' own (White, Econometrica 48, 1980).

use super::process::Factor;
use nalgebra::{Cholesky, DMatrix, Dyn};

/// Directions of the model's own movements that are this small beside the largest say nothing.
const FLAT: f64 = 1e-7;

/// The movements a model can do about a point, orthonormal over the places, and the factor of what errors do to their
/// amounts.
pub struct Projection {
    movements: DMatrix<f64>,
    errors: Cholesky<f64, Dyn>,
}

impl Projection {
    /// Of the sensitivities at a point (rows are places, three components each; one column per parameter) under errors of
    /// this covariance; `None` when it is not positive in numbers or nothing moves anything.
    pub fn new(jacobian_mm: &DMatrix<f64>, errors: &Factor) -> Option<Self> {
        let mut unit = jacobian_mm.clone();
        for mut column in unit.column_iter_mut() {
            let length = column.norm();
            column.scale_mut(if length > 0.0 { length.recip() } else { 0.0 });
        }
        let parts = unit.svd(true, false);
        let directions = parts.u?;
        let least = FLAT * parts.singular_values.max();
        let told: Vec<usize> = (0..directions.ncols()).filter(|&k| parts.singular_values[k] > least).collect();
        if told.is_empty() {
            return None;
        }
        let movements = directions.select_columns(&told);
        let half = errors.lower_transposed_times(&movements);
        let errors = (half.transpose() * half).cholesky()?;
        Some(Self { movements, errors })
    }

    /// The amounts of every column, made independent and of standard deviation 1.
    pub fn whiten(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let amounts = self.movements.transpose() * rows;
        let white = self.errors.l_dirty().solve_lower_triangular(&amounts);
        // A Cholesky factor has no zero on its diagonal.
        white.unwrap_or(amounts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::Process;
    use crate::material::random::CounterRng;

    fn places() -> Vec<[f64; 3]> {
        let rng = CounterRng::new(11, 2);
        (0..80).map(|n| [0, 1, 2].map(|a| rng.between(3 * n + a, -50.0, 50.0))).collect()
    }

    fn sensitivities(places: &[[f64; 3]]) -> DMatrix<f64> {
        let column = |row: usize, c: usize| {
            let x = places[row / 3];
            if c == 0 { 1.0 + 0.01 * x[row % 3] } else { (0.05 * x[(row + c) % 3]).sin() }
        };
        DMatrix::from_fn(3 * places.len(), 3, column)
    }

    #[test]
    fn independent_errors_leave_least_squares() {
        let places = places();
        let white = Process { sd_mm: 0.3, length_mm: 1e-6 };
        let jacobian = sensitivities(&places);
        let projection = Projection::new(&jacobian, &Factor::new(&places, &[white]).unwrap()).unwrap();
        let projected = projection.whiten(&jacobian);
        let expected = jacobian.transpose() * &jacobian / 0.09;
        let found = projected.transpose() * projected;
        assert!((&found - &expected).amax() < 1e-5 * expected.amax(), "{found} {expected}");
    }

    #[test]
    fn the_covariance_is_that_of_least_squares_under_the_errors() {
        let places = places();
        let alike = [Process { sd_mm: 0.1, length_mm: 8.0 }, Process { sd_mm: 0.5, length_mm: 60.0 }];
        let jacobian = sensitivities(&places);
        let projection = Projection::new(&jacobian, &Factor::new(&places, &alike).unwrap()).unwrap();
        let projected = projection.whiten(&jacobian);
        let found = (projected.transpose() * projected).try_inverse().unwrap();
        let covariance = DMatrix::from_fn(jacobian.nrows(), jacobian.nrows(), |a, b| {
            let distance = (nalgebra::Vector3::from(places[a / 3]) - nalgebra::Vector3::from(places[b / 3])).norm();
            let sum = || alike.iter().map(|p| p.covariance_mm2(distance)).sum::<f64>();
            if a % 3 == b % 3 { sum() } else { 0.0 }
        });
        let solve = (jacobian.transpose() * &jacobian).try_inverse().unwrap() * jacobian.transpose();
        let expected = &solve * covariance * solve.transpose();
        assert!((&found - &expected).amax() < 1e-4 * expected.amax(), "{found} {expected}");
    }

    #[test]
    fn a_parameter_that_moves_nothing_is_left_alone() {
        let places = places();
        let mut jacobian = sensitivities(&places);
        jacobian.column_mut(1).fill(0.0);
        let errors = Factor::new(&places, &[Process { sd_mm: 0.1, length_mm: 8.0 }]).unwrap();
        let white = Projection::new(&jacobian, &errors).unwrap().whiten(&jacobian);
        assert_eq!((white.nrows(), white.column(1).norm()), (2, 0.0));
        assert!(Projection::new(&DMatrix::zeros(240, 2), &errors).is_none());
    }
}

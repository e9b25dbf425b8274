//! What the rigid registration has left or taken up: a small turn and shift of everything, estimated along with the moduli.
//!
//! Rigid registration of whole heads takes up a part of the brain's shift (docs/evidence/choices.md), and no later step takes that
//! out.

use super::{LogPrior, Scale};
use nalgebra::{DMatrix, DVector, Matrix3x6, Vector3};

/// The six rigid movements of some places about their middle.
#[derive(Clone, Debug)]
pub struct RigidModes {
    /// Displacement of every place, three components each, per mm (shifts) and per radian (turns).
    pub columns_mm: DMatrix<f64>,
    /// What they turn about, mm.
    middle_mm: Vector3<f64>,
    /// Standard deviations: mm for shifts, radians for turns.
    sd: [f64; 6],
}

/// How many they are.
pub const RIGID: usize = 6;

impl RigidModes {
    /// Movements of these places whose expected error is `error_mm` (root mean square), one half of its square from shifts,
    /// the other from turns.
    pub fn new(places_mm: &[[f64; 3]], error_mm: f64) -> Self {
        let count = places_mm.len().max(1) as f64;
        let middle_mm = places_mm.iter().map(|x| Vector3::from(*x)).sum::<Vector3<f64>>() / count;
        let arm = |x: &[f64; 3]| Vector3::from(*x) - middle_mm;
        let mean_squared_arm = places_mm.iter().map(|x| arm(x).norm_squared()).sum::<f64>() / count;
        let columns_mm =
            DMatrix::from_fn(3 * places_mm.len(), RIGID, |row, k| column(k, &arm(&places_mm[row / 3]))[row % 3]);
        // Three shifts of s: mean square 3 s^2. Turns of t about three axes: 2 t^2 arm^2.
        let shift = (error_mm * error_mm / 6.0).sqrt();
        let turn = (error_mm * error_mm / 4.0 / mean_squared_arm.max(1e-12)).sqrt();
        Self { columns_mm, middle_mm, sd: [shift, shift, shift, turn, turn, turn] }
    }

    /// The same movements of any point, one column each.
    pub fn at(&self, x_mm: [f64; 3]) -> Matrix3x6<f64> {
        let arm = Vector3::from(x_mm) - self.middle_mm;
        Matrix3x6::from_columns(&[0, 1, 2, 3, 4, 5].map(|k| column(k, &arm)))
    }

    /// The inverse covariance of what is known of them beforehand.
    pub fn precision(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal(&DVector::from_iterator(RIGID, self.sd.iter().map(|sd| 1.0 / (sd * sd))))
    }

    /// What is known of them beforehand.
    pub fn priors(&self) -> impl Iterator<Item = LogPrior> {
        let names = ["shift along x", "shift along y", "shift along z", "turn about x", "turn about y", "turn about z"];
        let prior = |(name, sd): (&str, f64)| {
            let name = format!("remainder of the rigid registration: {name}");
            LogPrior { name, mean: 0.0, sd: Some(sd), scale: Scale::Plain, correlation: Vec::new(), average: None }
        };
        names.into_iter().zip(self.sd).map(prior)
    }
}

/// How a point moves at this arm from the middle, per mm of a shift or radian of a turn.
fn column(k: usize, arm: &Vector3<f64>) -> Vector3<f64> {
    let mut unit = Vector3::zeros();
    unit[k % 3] = 1.0;
    if k < 3 { unit } else { unit.cross(arm) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> Vec<[f64; 3]> {
        (0..60).map(|n| [f64::from(n % 4) * 11.0, f64::from(n / 4 % 5) * 9.0, f64::from(n / 20) * 14.0]).collect()
    }

    /// How far a shift and a turn about the middle of the places carry a point, mm.
    fn carried(places: &[[f64; 3]], x: [f64; 3], amounts: &[f64]) -> Vector3<f64> {
        let middle = places.iter().map(|x| Vector3::from(*x)).sum::<Vector3<f64>>() / places.len() as f64;
        let part = |k: usize| Vector3::new(amounts[k], amounts[k + 1], amounts[k + 2]);
        part(0) + part(3).cross(&(Vector3::from(x) - middle))
    }

    #[test]
    fn the_movements_are_those_of_a_rigid_body_and_of_the_size_that_is_expected() {
        let places = places();
        let rigid = RigidModes::new(&places, 0.2);
        let amounts = [0.3, -0.1, 0.2, 1e-3, -2e-3, 5e-4];
        let moved = &rigid.columns_mm * DVector::from_column_slice(&amounts);
        for (n, x) in places.iter().enumerate() {
            let there = carried(&places, *x, &amounts);
            assert!((0..3).all(|a| (there[a] - moved[3 * n + a]).abs() < 1e-12));
            assert!((rigid.at(*x) * DVector::from_column_slice(&amounts) - there).norm() < 1e-12);
        }
        // Lengths between places stay, to first order.
        let between = |a: usize, b: usize, moved: f64| {
            let at = |n: usize| Vector3::from(places[n]) + moved * carried(&places, places[n], &amounts);
            (at(a) - at(b)).norm()
        };
        assert!((between(3, 57, 1.0) - between(3, 57, 0.0)).abs() < 1e-3);
        let sd: Vec<f64> = rigid.priors().filter_map(|p| p.sd).collect();
        let mean_square =
            rigid.columns_mm.column_iter().zip(&sd).map(|(c, sd)| c.norm_squared() * sd * sd).sum::<f64>();
        assert!((mean_square / places.len() as f64 - 0.04).abs() < 1e-12);
    }
}

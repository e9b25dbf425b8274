//! How much of what a body would do may be there without being seen: what passes for noise, and what rigid registration follows.

use super::process::{Factor, Process};
use super::rigid_remainder::RIGID;
use crate::experiment::rmse::root_mean_square;
use crate::experiment::verdict::CONTRADICTION_SD;
use nalgebra::{DMatrix, DVector};

/// Whether what was seen moves by more than the measurement's noise, on the whole or, by three standard deviations, in more
/// than one place of a hundred. The size of a smooth process is no measure of that: one longer than the head may have any.
pub(super) fn above_noise(seen_mm: &DVector<f64>, noise: Process) -> bool {
    let on_the_whole = root_mean_square(seen_mm.as_slice()).is_some_and(|size| size > noise.sd_mm);
    let far = CONTRADICTION_SD * 3f64.sqrt() * noise.sd_mm;
    let places = seen_mm.as_slice().chunks(3);
    let (all, beyond) = places.fold((0, 0), |(all, beyond), u| {
        (all + 1, beyond + usize::from(u.iter().map(|v| v * v).sum::<f64>().sqrt() > far))
    });
    on_the_whole || 100 * beyond > all
}

/// The smallest multiple of what the body would do that [`above_noise`] takes for a movement; infinite where it does nothing.
pub(super) fn least_share_above_noise(pattern_mm: &DVector<f64>, noise: Process) -> f64 {
    let on_the_whole = noise.sd_mm / root_mean_square(pattern_mm.as_slice()).unwrap_or(0.0);
    let mut sizes: Vec<f64> =
        pattern_mm.as_slice().chunks(3).map(|u| u.iter().map(|v| v * v).sum::<f64>().sqrt()).collect();
    sizes.sort_by(|a, b| b.total_cmp(a));
    // More than one of a hundred.
    let place = sizes.get(sizes.len() / 100).copied().unwrap_or(0.0);
    on_the_whole.min(CONTRADICTION_SD * 3f64.sqrt() * noise.sd_mm / place)
}

/// What is left of a displacement once the rigid movement (its patterns, `rigid_mm`) that is most like it is taken away.
pub(super) fn without_rigid(pattern_mm: &DVector<f64>, rigid_mm: &DMatrix<f64>) -> DVector<f64> {
    let fitted = (rigid_mm.transpose() * rigid_mm).cholesky();
    // Places on one line do not say how they have turned about it: nothing is left of what nobody could see.
    fitted.map_or_else(
        || DVector::zeros(pattern_mm.len()),
        |normal| pattern_mm - rigid_mm * normal.solve(&(rigid_mm.transpose() * pattern_mm)),
    )
}

/// How much of a pattern is there in what was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Share {
    /// As a multiple of the pattern.
    pub share: f64,
    /// One standard deviation of that.
    pub sd: f64,
}

/// How much of a pattern is there beside a rigid movement of which `rigid_precision` is known beforehand; `None` where it does
/// nothing that the movement does not.
pub(super) fn share_of(
    pattern_mm: &DVector<f64>,
    seen_mm: &DVector<f64>,
    rigid_mm: &DMatrix<f64>,
    rigid_precision: &[f64],
    factor: &Factor,
) -> Option<Share> {
    let rows = pattern_mm.len();
    let columns = DMatrix::from_fn(rows, 1 + RIGID, |r, c| if c == 0 { pattern_mm[r] } else { rigid_mm[(r, c - 1)] });
    let white = factor.whiten(&columns);
    let target = factor.whiten(&DMatrix::from_column_slice(rows, 1, seen_mm.as_slice()));
    let mut normal = white.transpose() * &white;
    (0..RIGID).for_each(|k| normal[(1 + k, 1 + k)] += rigid_precision[k]);
    normal.cholesky().map(|normal| {
        let share = normal.solve(&(white.transpose() * target))[(0, 0)];
        Share { share, sd: normal.inverse()[(0, 0)].sqrt() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::RigidModes;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_passes_for_noise_ends_where_movement_begins(
            pattern in prop::collection::vec(-3.0..3.0f64, 6..900), one_place in 0.0..40.0f64, sd_mm in 0.05..0.5f64,
        ) {
            let mut pattern = DVector::from_vec(pattern[..pattern.len() / 3 * 3].to_vec());
            pattern[0] += one_place;
            let noise = Process { sd_mm, length_mm: 20.0 };
            let share = least_share_above_noise(&pattern, noise);
            prop_assert!(above_noise(&(&pattern * (share * (1.0 + 1e-9))), noise));
            prop_assert!(!above_noise(&(&pattern * (share * (1.0 - 1e-9))), noise));
        }

        #[test]
        fn a_rigid_movement_of_a_displacement_is_no_part_of_what_is_left_of_it(
            amounts in prop::collection::vec(-2.0..2.0f64, 6), bent in prop::collection::vec(-1.0..1.0f64, 180),
        ) {
            let at = |n: i32| [f64::from(n % 4) * 11.0, f64::from(n / 4 % 5) * 9.0, f64::from(n / 20) * 14.0];
            let places: Vec<[f64; 3]> = (0..60).map(at).collect();
            let rigid = RigidModes::new(&places, 0.2).columns_mm;
            let bent = DVector::from_vec(bent);
            // Millimetres, and twentieths of a radian.
            let amounts = DVector::from_fn(6, |k, _| amounts[k] * if k < 3 { 1.0 } else { 0.05 });
            let left = without_rigid(&(&bent + &rigid * amounts), &rigid);
            prop_assert!((&left - without_rigid(&bent, &rigid)).amax() < 1e-9);
            prop_assert!((rigid.transpose() * &left).amax() < 1e-6);
        }
    }
}

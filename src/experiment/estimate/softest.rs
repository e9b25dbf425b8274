//! How soft each tissue of a body may be that was not seen to move.

use super::LogPrior;
use super::posterior::{Z_95_ONE_SIDED, prior_correlation};

/// How soft a tissue may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Softest {
    /// Logarithm of its least shear modulus with the other unknowns as they were taken to be.
    log_pa: f64,
    /// What these make of it, one standard deviation.
    spread: f64,
}

impl Softest {
    /// Logarithm of the modulus that it is above (95 %, one-sided) where labels, supports and mesh make a modulus wrong by `error`.
    pub fn log_bound(self, error: f64) -> f64 {
        self.log_pa - Z_95_ONE_SIDED * self.spread.hypot(error)
    }
}

/// Least shear modulus (logarithm) of each parameter that is one, where it is bounded, by a body of parameters `at` of whose
/// displacement no more than `share` can be there (95 %, one-sided).
///
/// A body of linear stiffness moves as 1 / modulus if all its tissues are stiffer alike. Of a single one less is known: the others
/// may be stiffer than the prior has them beside it, and other unknowns (the load, the room at the skull) may be such that everything
/// moves less. Each is taken at its one-sided 95 %. `slopes` is d ln(displacement) / d parameter, `of_shape` what the body's shape may
/// make of that logarithm, one standard deviation.
pub(super) fn softest(
    share: f64,
    at: &[f64],
    slopes: &[f64],
    prior: &[LogPrior],
    are_moduli: &[bool],
    of_shape: f64,
) -> Vec<Option<Softest>> {
    let sd = |n: usize| prior[n].sd.unwrap_or(f64::INFINITY);
    // The part of the displacement that goes with each tissue's compliance.
    let part: Vec<f64> = slopes.iter().zip(are_moduli).map(|(s, is)| if *is { (-s).max(0.0) } else { 0.0 }).collect();
    let whole: f64 = part.iter().sum();
    let others = slopes.iter().zip(are_moduli).enumerate().filter(|(_, (slope, is))| !**is && **slope != 0.0);
    let spread = others.map(|(n, (slope, _))| (slope * sd(n)).powi(2)).sum::<f64>().sqrt().hypot(of_shape);
    let apart = |n: usize, other: usize| {
        let together = prior_correlation(prior, n, other);
        let both = if together == 0.0 { 0.0 } else { 2.0 * together * sd(n) * sd(other) };
        (sd(n).powi(2) + sd(other).powi(2) - both).max(0.0).sqrt()
    };
    let of = |n: usize| {
        let moves = |other: usize| {
            let stiffer = if other == n { 0.0 } else { Z_95_ONE_SIDED * apart(n, other) };
            part[other] / whole * (-stiffer).exp()
        };
        let left: f64 = (0..part.len()).filter(|other| part[*other] > 0.0).map(moves).sum();
        let log_pa = at[n] + (left / share).ln();
        (are_moduli[n] && log_pa.is_finite() && spread.is_finite()).then_some(Softest { log_pa, spread })
    };
    (0..prior.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Scale;
    use super::*;

    /// Bounds of a body that is what it is taken to be.
    fn softest(share: f64, at: &[f64], slopes: &[f64], prior: &[LogPrior], are_moduli: &[bool]) -> Vec<Option<f64>> {
        let found = super::softest(share, at, slopes, prior, are_moduli, 0.0).into_iter();
        found.map(|bound| bound.map(|bound| bound.log_bound(0.0))).collect()
    }

    #[test]
    fn what_labels_and_mesh_may_be_off_bounds_less() {
        let bound = |sd, error: f64| {
            let priors = [prior(0.5, vec![]), prior(sd, vec![])];
            let found = super::softest(0.25, &[7.0, 4.6], &[-1.0, 1.0], &priors, &[true, false], 0.0);
            found[0].unwrap().log_bound(error)
        };
        assert!((bound(0.0, 0.2) - bound(0.0, 0.0) + Z_95_ONE_SIDED * 0.2).abs() < 1e-12);
        // Beside a load that is not known it adds in the square.
        assert!((bound(0.3, 0.4) - bound(0.0, 0.5)).abs() < 1e-12);
    }

    #[test]
    fn a_shape_with_which_it_may_all_move_less_bounds_less() {
        let bound = |of_shape, error: f64| {
            let found = super::softest(0.25, &[7.0], &[-1.0], &[prior(0.5, vec![])], &[true], of_shape);
            found[0].unwrap().log_bound(error)
        };
        assert!((bound(0.0, 0.0) - bound(0.2, 0.0) - Z_95_ONE_SIDED * 0.2).abs() < 1e-12);
        assert!((bound(0.3, 0.4) - bound(0.0, 0.5)).abs() < 1e-12);
    }

    fn prior(sd: f64, correlation: Vec<f64>) -> LogPrior {
        LogPrior { name: String::new(), mean: 7.0, sd: Some(sd), scale: Scale::Logarithm, correlation, average: None }
    }

    #[test]
    fn one_tissue_is_as_much_stiffer_as_it_moves_less() {
        let found = softest(0.25, &[7.0], &[-1.0], &[prior(0.5, vec![])], &[true]);
        assert!((found[0].unwrap() - 7.0 - 4f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn two_that_are_only_known_together_are_bounded_together_and_two_that_are_not_each_by_its_own_part() {
        let [w, share] = [0.7, 0.5];
        let bounds = |together: f64, sd: f64| {
            let priors = [prior(sd, vec![]), prior(sd, vec![together])];
            softest(share, &[7.0, 6.5], &[-w, w - 1.0], &priors, &[true, true])
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
        };
        let same = bounds(1.0, 0.5);
        assert!((same[0] - 7.0 + share.ln()).abs() < 1e-9 && (same[1] - 6.5 + share.ln()).abs() < 1e-9, "{same:?}");
        let any = bounds(0.0, 50.0);
        assert!((any[0] - 7.0 - (w / share).ln()).abs() < 1e-9, "{any:?}");
        assert!((any[1] - 6.5 - ((1.0 - w) / share).ln()).abs() < 1e-9, "{any:?}");
        // No pair of moduli that the prior has within its 95 % and that moves no more breaks them.
        let some = bounds(0.5, 0.6);
        let ratio = Z_95_ONE_SIDED * 0.6;
        for step in -100..=100 {
            let more = ratio * f64::from(step) / 100.0;
            // White's excess over grey's at which both move just as much as may be there.
            let grey = 7.0 + ((w + (1.0 - w) * (-more).exp()) / share).ln();
            assert!(grey >= some[0] - 1e-9 && grey - 0.5 + more >= some[1] - 1e-9, "{more} {grey} {some:?}");
        }
    }

    #[test]
    fn a_load_that_may_be_less_bounds_less() {
        let with =
            |sd| softest(0.25, &[7.0, 4.6], &[-1.0, 1.0], &[prior(0.5, vec![]), prior(sd, vec![])], &[true, false]);
        assert_eq!(with(0.5)[1], None);
        assert!((with(0.5)[0].unwrap() - 7.0 - 4f64.ln() + Z_95_ONE_SIDED * 0.5).abs() < 1e-12);
        let unknown = LogPrior { sd: None, ..prior(1.0, vec![]) };
        assert_eq!(
            softest(0.25, &[7.0, 4.6], &[-1.0, 1.0], &[prior(0.5, vec![]), unknown], &[true, false]),
            [None, None]
        );
    }
}

//! How probable what was seen is under a model: the Laplace evidence of a linearised estimate, with what instrument and
//! model leave unexplained as Gaussian processes whose size and length are the most probable ones.
//!
//! Kennedy and O'Hagan, "Bayesian calibration of computer models", Journal of the Royal Statistical Society B 63, 2001;
//! MacKay, "Information Theory, Inference, and Learning Algorithms", chapter 28.

use super::Convergence;
use super::process::{Factor, Process};
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How well the instrument's noise is known: standard deviation of the logarithm of its size (a factor of 1.65).
pub const NOISE_LOG_SD: f64 = 0.5;
/// Lengths of a discrepancy that are looked at, mm: from what a registration can show to a whole head.
const LENGTHS_MM: [f64; 2] = [10.0, 200.0];
/// Sizes of a discrepancy that are looked at, mm.
const SIZES_MM: [f64; 2] = [1e-3, 10.0];

/// What is not explained: the instrument's noise and the model's discrepancy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unexplained {
    /// Noise of the instrument.
    pub noise: Process,
    /// What the model misses; of size 0 for none.
    pub discrepancy: Process,
}

impl Unexplained {
    /// The covariance's factor at these places; `None` when it is not positive in numbers.
    pub fn factor(&self, places_mm: &[[f64; 3]]) -> Option<Factor> {
        let both = [self.noise, self.discrepancy];
        Factor::new(places_mm, if self.discrepancy.sd_mm > 0.0 { &both } else { &both[..1] })
    }
}

/// Residuals and how they change with the parameters, at a point of the parameters.
#[derive(Clone, Debug)]
pub struct LinearModel<'a> {
    /// Where displacements were seen, mm.
    pub places_mm: &'a [[f64; 3]],
    /// Model minus seen, mm, three components a place.
    pub residuals_mm: &'a DVector<f64>,
    /// Their derivatives, one column per parameter.
    pub jacobian_mm: &'a DMatrix<f64>,
    /// How far the point lies from the prior's mean, per parameter.
    pub away: DVector<f64>,
    /// Inverse covariance of the prior; rows of zero for no prior (the evidence has no meaning beside another's then).
    pub precision: DMatrix<f64>,
    /// Whether the way to the minimum that the linearisation shows from the point counts as gone ([`Self::after`]).
    pub way_left: bool,
}

/// The most probable noise and discrepancy, and what they make of the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// Noise and discrepancy.
    pub unexplained: Unexplained,
    /// Logarithm of the probability density of what was seen.
    pub log_evidence: f64,
}

impl LinearModel<'_> {
    /// Of a point at which a search for the minimum ended in this way. Beyond the point of a search that was not finished nobody
    /// knows how far the linearisation holds: many standard deviations of promised way would rank a model above those that
    /// have gone theirs. What is left is no more than its evidence.
    #[must_use]
    pub fn after(self, convergence: Convergence) -> Self {
        Self { way_left: !convergence.is_unfinished(), ..self }
    }

    /// Logarithm of the evidence at the best point of the linearised model, or at the point itself; `None` when it is no number.
    fn log_evidence(&self, unexplained: &Unexplained) -> Option<f64> {
        let factor = unexplained.factor(self.places_mm)?;
        let residuals = DMatrix::from_column_slice(self.residuals_mm.len(), 1, self.residuals_mm.as_slice());
        let r = factor.whiten(&residuals).column(0).into_owned();
        let mut quadratic = r.norm_squared() + self.away.dot(&(&self.precision * &self.away));
        let mut log_ratio = 0.0;
        if !self.away.is_empty() {
            let j = factor.whiten(self.jacobian_mm);
            let gradient = j.transpose() * &r + &self.precision * &self.away;
            let hessian = (j.transpose() * &j + &self.precision).cholesky()?;
            if self.way_left {
                quadratic -= gradient.dot(&hessian.solve(&gradient));
            }
            log_ratio = hessian.l_dirty().diagonal().map(f64::ln).sum();
            log_ratio -= self.log_root_of_precision();
        }
        let constant = 0.5 * r.len() as f64 * std::f64::consts::TAU.ln();
        let log_evidence = -0.5 * quadratic - 1.5 * factor.log_determinant - log_ratio - constant;
        // Nothing can be ranked by what is no number.
        log_evidence.is_finite().then_some(log_evidence)
    }

    /// Half the logarithm of the prior's precision, parameters of no prior left out.
    fn log_root_of_precision(&self) -> f64 {
        let known: Vec<usize> = (0..self.away.len()).filter(|&p| self.precision[(p, p)] > 0.0).collect();
        let part = DMatrix::from_fn(known.len(), known.len(), |r, c| self.precision[(known[r], known[c])]);
        part.cholesky().map_or(0.0, |factor| factor.l_dirty().diagonal().map(f64::ln).sum())
    }

    /// The most probable size of the noise around the measured one, without a discrepancy. How far it is alike is not
    /// known beforehand: an error of the measurement is told from a movement by its size alone.
    pub fn with_noise_alone(&self, measured: Process) -> Option<Evidence> {
        let at = |x: &[f64]| Unexplained {
            noise: Process { length_mm: x[1].exp(), ..scaled(measured, x[0]) },
            discrepancy: Process { sd_mm: 0.0, length_mm: LENGTHS_MM[0] },
        };
        let score = |x: &[f64]| self.score(&at(x), x[0]);
        let lengths = (measured.length_mm.min(LENGTHS_MM[0]).ln(), LENGTHS_MM[1].ln());
        let best = climb(&score, vec![0.0, measured.length_mm.ln()], &[(-3.0, 3.0), lengths])?;
        Some(Evidence { unexplained: at(&best.0), log_evidence: best.1 })
    }

    /// The most probable noise and discrepancy.
    pub fn with_discrepancy(&self, measured: Process) -> Option<Evidence> {
        let at = |x: &[f64]| Unexplained {
            noise: scaled(measured, x[0]),
            discrepancy: Process { sd_mm: x[1].exp(), length_mm: x[2].exp() },
        };
        let score = |x: &[f64]| self.score(&at(x), x[0]);
        let range = |[low, high]: [f64; 2]| (low.ln(), high.ln());
        let ranges = [(-3.0, 3.0), range(SIZES_MM), range(LENGTHS_MM)];
        // From a coarse grid: the likelihood may have two hills.
        let mut start: Option<(Vec<f64>, f64)> = None;
        for size_mm in [0.05, 0.2, 0.8, 3.0f64] {
            for length_mm in [15.0, 45.0, 135.0f64] {
                let x = vec![0.0, size_mm.ln(), length_mm.ln()];
                let Some(score) = score(&x) else { continue };
                if start.as_ref().is_none_or(|(_, best)| score > *best) {
                    start = Some((x, score));
                }
            }
        }
        let best = climb(&score, start?.0, &ranges)?;
        Some(Evidence { unexplained: at(&best.0), log_evidence: best.1 })
    }

    fn score(&self, unexplained: &Unexplained, log_noise: f64) -> Option<f64> {
        Some(self.log_evidence(unexplained)? - 0.5 * (log_noise / NOISE_LOG_SD).powi(2))
    }
}

fn scaled(process: Process, log_factor: f64) -> Process {
    Process { sd_mm: process.sd_mm * log_factor.exp(), ..process }
}

/// The highest point by a pattern search (Hooke and Jeeves, Journal of the ACM 8, 1961): a step along every axis, halved
/// when none is better.
fn climb(score: &dyn Fn(&[f64]) -> Option<f64>, start: Vec<f64>, ranges: &[(f64, f64)]) -> Option<(Vec<f64>, f64)> {
    const FIRST_STEP: f64 = 0.5;
    const LAST_STEP: f64 = 0.03;
    let mut here = start;
    let mut height = score(&here)?;
    let mut step = FIRST_STEP;
    while step >= LAST_STEP {
        let mut moved = false;
        for axis in 0..here.len() {
            for sign in [1.0, -1.0] {
                let mut there = here.clone();
                there[axis] = (there[axis] + sign * step).clamp(ranges[axis].0, ranges[axis].1);
                let higher = score(&there).filter(|s| *s > height);
                if let Some(higher) = higher {
                    (here, height, moved) = (there, higher, true);
                    break;
                }
            }
        }
        if !moved {
            step *= 0.5;
        }
    }
    Some((here, height))
}

/// Weights of models from the logarithms of their evidence: exp, scaled to a sum of 1.
pub fn weights(log_evidence: &[f64]) -> Vec<f64> {
    let highest = log_evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let parts: Vec<f64> = log_evidence.iter().map(|e| (e - highest).exp()).collect();
    let sum: f64 = parts.iter().sum();
    parts.into_iter().map(|part| part / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::verdict::STRONG;
    use crate::material::random::CounterRng;

    const NOISE: Process = Process { sd_mm: 0.1, length_mm: 8.0 };

    fn places() -> Vec<[f64; 3]> {
        let rng = CounterRng::new(5, 1);
        (0..150).map(|n| [0, 1, 2].map(|a| rng.between(3 * n + a, -50.0, 50.0))).collect()
    }

    /// A draw of the processes at the places: L times independent numbers.
    fn draw(places: &[[f64; 3]], processes: &[Process], stream: u64) -> DVector<f64> {
        let n = places.len();
        let rng = CounterRng::new(7, stream);
        let covariance = DMatrix::from_fn(n, n, |r, c| {
            let distance = (nalgebra::Vector3::from(places[r]) - nalgebra::Vector3::from(places[c])).norm();
            processes.iter().map(|p| p.covariance_mm2(distance)).sum::<f64>() + if r == c { 1e-9 } else { 0.0 }
        });
        let lower = covariance.cholesky().unwrap().unpack();
        let parts: Vec<DVector<f64>> =
            (0..3).map(|a| &lower * DVector::from_fn(n, |i, _| rng.normal((3 * i + a) as u64))).collect();
        DVector::from_fn(3 * n, |row, _| parts[row % 3][row / 3])
    }

    fn no_parameters<'a>(places: &'a [[f64; 3]], r: &'a DVector<f64>, j: &'a DMatrix<f64>) -> LinearModel<'a> {
        let none = DVector::zeros(0);
        let precision = DMatrix::zeros(0, 0);
        LinearModel { places_mm: places, residuals_mm: r, jacobian_mm: j, away: none, precision, way_left: true }
    }

    #[test]
    fn size_and_length_of_a_discrepancy_come_back_from_one_draw() {
        let (places, truth) = (places(), Process { sd_mm: 0.6, length_mm: 30.0 });
        let r = draw(&places, &[NOISE, truth], 1);
        let empty = DMatrix::zeros(r.len(), 0);
        let found = no_parameters(&places, &r, &empty).with_discrepancy(NOISE).unwrap().unexplained;
        let off = |a: f64, b: f64| (a / b).ln().abs();
        assert!(off(found.discrepancy.sd_mm, 0.6) < 0.35 && off(found.discrepancy.length_mm, 30.0) < 0.6, "{found:?}");
        assert!(off(found.noise.sd_mm, 0.1) < 0.4, "{found:?}");
    }

    #[test]
    fn noise_alone_is_not_taken_for_a_discrepancy_and_a_discrepancy_not_for_noise() {
        let places = places();
        let empty = DMatrix::zeros(450, 0);
        let gain = |r: &DVector<f64>| {
            let model = no_parameters(&places, r, &empty);
            model.with_discrepancy(NOISE).unwrap().log_evidence - model.with_noise_alone(NOISE).unwrap().log_evidence
        };
        assert!(gain(&draw(&places, &[NOISE], 2)) < STRONG);
        let both = [NOISE, Process { sd_mm: 0.3, length_mm: 40.0 }];
        assert!(gain(&draw(&places, &both, 3)) > STRONG);
    }

    #[test]
    fn the_evidence_of_a_linear_model_is_the_density_of_a_gaussian() {
        let places = &places()[..4];
        let r = draw(places, &[NOISE], 4);
        let j = DMatrix::from_fn(12, 2, |r, c| ((r + 3 * c) % 5) as f64 - 1.7);
        let (away, precision) = (DVector::from_vec(vec![0.3, -0.2]), DVector::from_vec(vec![4.0, 0.25]));
        let model = LinearModel {
            places_mm: places,
            residuals_mm: &r,
            jacobian_mm: &j,
            away: away.clone(),
            precision: DMatrix::from_diagonal(&precision),
            way_left: true,
        };
        let unexplained = Unexplained { noise: NOISE, discrepancy: Process { sd_mm: 0.0, length_mm: 10.0 } };
        // Seen minus the model at the prior's mean is a draw of C + J S J^T.
        let at_mean = &r - &j * &away;
        let covariance = DMatrix::from_fn(12, 12, |a, b| {
            let distance = (nalgebra::Vector3::from(places[a / 3]) - nalgebra::Vector3::from(places[b / 3])).norm();
            let own = if a == b { 1e-6 * 0.01 } else { 0.0 };
            if a % 3 == b % 3 { NOISE.covariance_mm2(distance) + own } else { 0.0 }
        }) + &j * DMatrix::from_diagonal(&precision.map(f64::recip)) * j.transpose();
        let factor = covariance.clone().cholesky().unwrap();
        let expected = -0.5 * at_mean.dot(&factor.solve(&at_mean))
            - 0.5 * covariance.determinant().ln()
            - 6.0 * std::f64::consts::TAU.ln();
        let found = model.log_evidence(&unexplained).unwrap();
        assert!((found - expected).abs() < 1e-8 * expected.abs(), "{found} {expected}");
    }

    #[test]
    fn a_search_that_was_not_finished_is_not_credited_with_the_way_that_it_did_not_go() {
        let places = &places()[..4];
        let j = DMatrix::from_fn(12, 1, |r, _| (r % 5) as f64 - 1.7);
        let unexplained = Unexplained { noise: NOISE, discrepancy: Process { sd_mm: 0.0, length_mm: 10.0 } };
        let at = |sds: f64, convergence| {
            // So many standard deviations of the posterior from the minimum, which is the prior's mean.
            let white = unexplained.factor(places).unwrap().whiten(&j);
            let away = DVector::from_element(1, sds / (white.norm_squared() + 4.0).sqrt());
            let r = &j * &away;
            let precision = DMatrix::from_element(1, 1, 4.0);
            let model =
                LinearModel { places_mm: places, residuals_mm: &r, jacobian_mm: &j, away, precision, way_left: true };
            model.after(convergence).log_evidence(&unexplained).unwrap()
        };
        let best = at(0.0, Convergence::StepBelowTolerance);
        for found in [Convergence::StepBelowTolerance, Convergence::NoDescent, Convergence::NotSought] {
            assert!((at(6.0, found) - best).abs() < 1e-6 * best.abs(), "{found:?}");
        }
        for unfinished in [Convergence::Stalled, Convergence::IterationsExhausted] {
            assert!((at(6.0, unfinished) - (best - 18.0)).abs() < 1e-6 * best.abs(), "{unfinished:?}");
            assert!((at(0.0, unfinished) - best).abs() < 1e-9 * best.abs());
        }
    }

    #[test]
    fn an_evidence_that_is_no_number_is_none() {
        let (places, r) = (&places()[..4], DVector::zeros(12));
        let j = DMatrix::from_element(12, 1, 1.0);
        let (away, precision) = (DVector::from_element(1, f64::NEG_INFINITY), DMatrix::from_element(1, 1, 4.0));
        let model =
            LinearModel { places_mm: places, residuals_mm: &r, jacobian_mm: &j, away, precision, way_left: true };
        assert_eq!(model.with_noise_alone(NOISE), None);
        assert_eq!(model.with_discrepancy(NOISE), None);
    }

    #[test]
    fn weights_are_odds_scaled_to_one() {
        let w = weights(&[-1000.0, -1000.0 + 3f64.ln()]);
        assert!((w[0] - 0.25).abs() < 1e-12 && (w[1] - 0.75).abs() < 1e-12);
    }
}

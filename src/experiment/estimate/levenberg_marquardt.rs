//! Levenberg-Marquardt on residuals in mm with a Gaussian prior on the log-parameters.

use super::{LogPrior, Scale};
use crate::experiment::parameter_name::in_words;
use crate::experiment::setting::{SettingError, first_broken};
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Residuals at a point and, when asked for, how they change.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// Observed minus simulated, mm, one per observation.
    pub residuals_mm: DVector<f64>,
    /// d residual / d ln(parameter), mm, one column per parameter.
    pub jacobian_mm: DMatrix<f64>,
}

/// A model that turns log-parameters into residuals; the solver with its sensitivities, or a test's formula.
pub trait Forward {
    /// Why a point could not be evaluated (an equilibrium that does not exist, say).
    type Error: std::fmt::Display;

    /// Residuals and Jacobian at these log-parameters. One call costs one solve and one tangent solve per parameter.
    ///
    /// # Errors
    /// The model's own.
    fn linearise(&mut self, log_parameters: &[f64]) -> Result<Linearisation, Self::Error>;
}

/// How to descend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EstimateSettings {
    /// Standard deviation of one observation, mm.
    pub noise_mm: f64,
    /// Stop when no log-parameter moves more than this.
    pub step_tolerance: f64,
    /// Stop when the way left to the minimum is below this share of the posterior's standard deviation (the Newton
    /// decrement): closer than that nothing is known, and the residuals' own rounding ends the descent late.
    pub decrement_tolerance: f64,
    /// Most iterations.
    pub iterations: usize,
    /// Longest step of a log-parameter: a factor e^1 in one go is as far as a linearisation carries. For an exponent, in
    /// standard deviations of its prior.
    pub longest_step: f64,
}

impl EstimateSettings {
    /// Refuses what no descent can be made with.
    ///
    /// # Errors
    /// The first setting out of its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        first_broken(&[
            ("noise_mm", &self.noise_mm, positive(self.noise_mm), "above 0"),
            ("step_tolerance", &self.step_tolerance, self.step_tolerance >= 0.0, "0 or more"),
            ("decrement_tolerance", &self.decrement_tolerance, self.decrement_tolerance >= 0.0, "0 or more"),
            ("iterations", &self.iterations, self.iterations >= 1, "1 or more"),
            ("longest_step", &self.longest_step, positive(self.longest_step), "above 0"),
        ])
    }
}

impl Default for EstimateSettings {
    fn default() -> Self {
        Self { noise_mm: 0.5, step_tolerance: 1e-6, decrement_tolerance: 1e-2, iterations: 30, longest_step: 1.0 }
    }
}

/// Distance to the minimum, in standard deviations of the posterior, below which a linearisation holds.
const NEAR: f64 = 0.5;
/// Steps that may be refused there before the descent ends.
const MOST_REFUSED: usize = 3;
/// Fall of the cost (of minus the log posterior) that is nothing, where a first step was refused.
const LITTLE: f64 = 0.02;

/// How the descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Convergence {
    /// The last step was below a tolerance.
    StepBelowTolerance,
    /// No step, however short, lowered the cost: the residuals' own precision is reached.
    NoDescent,
    /// The same far from the minimum: what the sensitivities promise is not what the model does, or it has no equilibrium there.
    /// The figures are the best found, not a minimum.
    Stalled,
    /// The iterations ran out: the figures are the best found, not a minimum.
    IterationsExhausted,
    /// Nothing was seen to move: there is no minimum to be looked for, and the figures are the prior's.
    NotSought,
}

impl Convergence {
    /// Whether what was found is no minimum, though one was looked for.
    pub fn is_unfinished(self) -> bool {
        matches!(self, Self::Stalled | Self::IterationsExhausted)
    }
}

/// The best point found and the way there.
#[derive(Clone, Debug)]
pub struct Descent {
    /// ln(parameter) at the minimum.
    pub log_parameters: Vec<f64>,
    /// Residuals and Jacobian there.
    pub linearisation: Linearisation,
    /// Minus log posterior (up to a constant) after every accepted step, the start first.
    pub costs: Vec<f64>,
    /// Calls of the forward model.
    pub evaluations: usize,
    /// Why it stopped.
    pub convergence: Convergence,
}

/// Why there is no estimate.
#[derive(Debug, Error, PartialEq)]
pub enum EstimateError {
    /// The model failed at the start.
    #[error("the estimate cannot begin at the prior's mean: {0}")]
    Start(String),
    /// Nothing to fit.
    #[error(
        "only {observations} observed components for {parameters} unknowns: no node lies deep enough in the brain, or \
         a surface is empty; lower `depth_mm` in the table [estimate.displacement] or use a finer mesh"
    )]
    TooFewObservations {
        /// Residuals.
        observations: usize,
        /// Parameters.
        parameters: usize,
    },
    /// The errors' covariance has no factor.
    #[error(
        "the covariance of the errors cannot be factored: give `noise_mm` and `correlation_mm` of the table \
         [estimate.displacement] above 0 and of a size that displacements have"
    )]
    Covariance,
    /// A residual is NaN or infinite.
    #[error(
        "the displacement of observation {0} is not a finite number: a file of the case is damaged; make the case \
         again"
    )]
    NotFinite(usize),
    /// What is known of a parameter beforehand is NaN or infinite.
    #[error(
        "what is known beforehand of the {0} is not a finite number: what is 0 has no logarithm to be estimated by; give it \
         another size, or take it from what is estimated"
    )]
    Known(String),
    /// The cost of the start, or its slope there, is NaN or infinite.
    #[error(
        "how well the start of the estimate fits is not a finite number: `noise_mm` is too small, or a sensitivity of the \
         displacement could not be found"
    )]
    Cost,
}

/// Refuses what is known beforehand where it is no number: nothing is far from it or near to it.
pub(super) fn known_beforehand(prior: &[LogPrior]) -> Result<(), EstimateError> {
    let astray = prior.iter().find(|known| !known.mean.is_finite());
    astray.map_or(Ok(()), |known| Err(EstimateError::Known(in_words(&known.name).0)))
}

/// Minimises sum r^2 / (2 noise^2) + sum (theta - mean)^2 / (2 sd^2) over theta = ln(parameters) from `start`.
///
/// # Errors
/// [`EstimateError`] when the start cannot be evaluated; a trial point that fails only shortens the step.
pub fn estimate<M: Forward>(
    model: &mut M,
    prior: &[LogPrior],
    start: &[f64],
    settings: &EstimateSettings,
) -> Result<Descent, EstimateError> {
    known_beforehand(prior)?;
    let weight = settings.noise_mm.powi(-2);
    let precision = super::joint_precision(prior);
    let mean = DVector::from_iterator(prior.len(), prior.iter().map(|p| p.mean));
    // A quantity that is not a logarithm has the scale of what is known of it.
    let unit_of = |p: &LogPrior| if p.scale == Scale::Plain { p.sd.unwrap_or(1.0).max(1.0) } else { 1.0 };
    let unit = DVector::from_iterator(prior.len(), prior.iter().map(unit_of));
    let cost = |theta: &DVector<f64>, r: &DVector<f64>| {
        let away = theta - &mean;
        0.5 * weight * r.norm_squared() + 0.5 * away.dot(&(&precision * &away))
    };

    let mut theta = DVector::from_column_slice(start);
    let mut here = model.linearise(start).map_err(|e| EstimateError::Start(e.to_string()))?;
    if here.residuals_mm.len() < prior.iter().filter(|p| p.sd.is_none()).count().max(1) {
        let (observations, parameters) = (here.residuals_mm.len(), start.len());
        return Err(EstimateError::TooFewObservations { observations, parameters });
    }
    if let Some(n) = here.residuals_mm.iter().position(|r| !r.is_finite()) {
        return Err(EstimateError::NotFinite(n));
    }
    let mut costs = vec![cost(&theta, &here.residuals_mm)];
    // Nothing is below a NaN, and the largest of it and 0 is 0: the descent would be at its minimum.
    if !costs[0].is_finite() {
        return Err(EstimateError::Cost);
    }
    let (mut evaluations, mut damping) = (1, 1e-3);
    let mut convergence = Convergence::IterationsExhausted;
    'descent: for _ in 0..settings.iterations {
        let mut refused = 0;
        let jt = here.jacobian_mm.transpose();
        let gradient = &jt * &here.residuals_mm * weight + &precision * (&theta - &mean);
        let hessian = &jt * &here.jacobian_mm * weight + &precision;
        if !gradient.iter().chain(hessian.iter()).all(|number| number.is_finite()) {
            return Err(EstimateError::Cost);
        }
        // From the minimum as the linearisation sees it, in standard deviations; unknown where that has none.
        let away =
            hessian.clone().cholesky().map_or(f64::INFINITY, |f| f.solve(&gradient).dot(&gradient).max(0.0).sqrt());
        let no_further = if away < NEAR { Convergence::NoDescent } else { Convergence::Stalled };
        loop {
            let scale = hessian.diagonal().map(|d| d.max(1e-12)) * damping;
            let damped = &hessian + DMatrix::from_diagonal(&scale);
            let Some(factor) = damped.cholesky() else {
                damping *= 10.0;
                // Numbers too far apart have no factor, however damped.
                if damping > 1e8 {
                    convergence = no_further;
                    break 'descent;
                }
                continue;
            };
            let mut step = -factor.solve(&gradient);
            let decrement = -step.dot(&gradient);
            if !decrement.is_finite() {
                return Err(EstimateError::Cost);
            }
            let decrement = decrement.max(0.0).sqrt();
            let longest = step.component_div(&unit).amax();
            if longest > settings.longest_step {
                step *= settings.longest_step / longest;
            }
            // A damped step is short without being at the minimum.
            let undamped = damping <= 1e-3;
            let arrived = undamped && decrement < settings.decrement_tolerance;
            if arrived || step.amax() < settings.step_tolerance {
                let found = undamped || away < NEAR;
                convergence = if found { Convergence::StepBelowTolerance } else { Convergence::Stalled };
                break 'descent;
            }
            // So near the minimum the linearisation holds, and steps that it promises to lower the cost and that do not are
            // lost in the residuals' own precision (walls come and go between two equilibria).
            if refused >= MOST_REFUSED && away < NEAR {
                convergence = Convergence::NoDescent;
                break 'descent;
            }
            let trial = &theta + &step;
            evaluations += 1;
            let there = model.linearise(trial.as_slice()).ok();
            let there = there.filter(|t| t.residuals_mm.iter().chain(t.jacobian_mm.iter()).all(|r| r.is_finite()));
            let lower = there.filter(|t| cost(&trial, &t.residuals_mm) < costs[costs.len() - 1]);
            if let Some(there) = lower {
                costs.push(cost(&trial, &there.residuals_mm));
                (theta, here) = (trial, there);
                damping = (damping * 0.1).max(1e-12);
                let gain = costs[costs.len() - 2] - costs[costs.len() - 1];
                if refused > 0 && away < NEAR && gain < LITTLE {
                    convergence = Convergence::NoDescent;
                    break 'descent;
                }
                break;
            }
            refused += 1;
            damping *= 10.0;
            if damping > 1e8 {
                convergence = no_further;
                break 'descent;
            }
        }
    }
    Ok(Descent { log_parameters: theta.as_slice().to_vec(), linearisation: here, costs, evaluations, convergence })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// r_i = a_i / mu_1 + b_i / mu_2 - observed: what a linear-elastic body under gravity does.
    struct Compliance {
        observed: Vec<f64>,
    }

    fn simulate(log: &[f64]) -> Vec<f64> {
        (0..40).map(|i| f64::from(i) * (-log[0]).exp() + f64::from((i * i) % 17) * (-log[1]).exp()).collect()
    }

    impl Forward for Compliance {
        type Error = String;
        fn linearise(&mut self, log: &[f64]) -> Result<Linearisation, String> {
            if log.iter().any(|l| l.abs() > 20.0) {
                return Err("no equilibrium".to_owned());
            }
            let value = simulate(log);
            let residuals_mm = DVector::from_iterator(40, value.iter().zip(&self.observed).map(|(s, o)| s - o));
            let column = |i: usize, p: usize| {
                let c = if p == 0 { i as f64 } else { f64::from(((i * i) % 17) as u32) };
                -c * (-log[p]).exp()
            };
            Ok(Linearisation { residuals_mm, jacobian_mm: DMatrix::from_fn(40, 2, column) })
        }
    }

    /// The same with residuals that are only good to a hundredth of a mm, differently at every point.
    struct Chattering(Compliance);

    impl Forward for Chattering {
        type Error = String;
        fn linearise(&mut self, log: &[f64]) -> Result<Linearisation, String> {
            let mut there = self.0.linearise(log)?;
            let point = log.iter().fold(0u64, |sum, l| sum.rotate_left(21) ^ l.to_bits());
            let rng = crate::material::random::CounterRng::new(1, point);
            for (n, r) in there.residuals_mm.iter_mut().enumerate() {
                *r += 0.02 * (rng.uniform(n as u64) - 0.5);
            }
            Ok(there)
        }
    }

    #[test]
    fn a_descent_ends_where_the_residuals_are_no_better() {
        let truth = [1.3, 0.4];
        let clean = || Compliance { observed: simulate(&truth) };
        let settings = EstimateSettings { noise_mm: 0.1, decrement_tolerance: 1e-4, ..EstimateSettings::default() };
        let fine = estimate(&mut clean(), &no_prior(), &[3.0, -1.0], &settings).unwrap();
        let rough = estimate(&mut Chattering(clean()), &no_prior(), &[3.0, -1.0], &settings).unwrap();
        assert_eq!(rough.convergence, Convergence::NoDescent);
        assert!(rough.evaluations < fine.evaluations + 10, "{} {}", rough.evaluations, fine.evaluations);
        let jt = fine.linearisation.jacobian_mm.transpose();
        let information = &jt * &fine.linearisation.jacobian_mm / 0.01;
        let away = DVector::from_fn(2, |p, _| rough.log_parameters[p] - fine.log_parameters[p]);
        assert!(away.dot(&(&information * &away)).sqrt() < NEAR);
    }

    /// A model with an end, beyond which it has no equilibrium.
    struct Folding {
        model: Compliance,
        softest: f64,
    }

    impl Forward for Folding {
        type Error = String;
        fn linearise(&mut self, log: &[f64]) -> Result<Linearisation, String> {
            if log[0] < self.softest { Err("folded".to_owned()) } else { self.model.linearise(log) }
        }
    }

    #[test]
    fn a_descent_that_ends_before_the_minimum_says_so() {
        let settings = EstimateSettings { noise_mm: 0.1, ..EstimateSettings::default() };
        let model = || Compliance { observed: simulate(&[1.3, 0.4]) };
        let ended = |softest| {
            let mut model = Folding { model: model(), softest };
            estimate(&mut model, &no_prior(), &[3.0, 0.4], &settings).unwrap().convergence
        };
        assert_eq!(ended(2.0), Convergence::Stalled);
        assert_eq!(ended(0.0), Convergence::StepBelowTolerance);
        // Sensitivities of the wrong sign.
        struct Backwards(Compliance);
        impl Forward for Backwards {
            type Error = String;
            fn linearise(&mut self, log: &[f64]) -> Result<Linearisation, String> {
                let found = self.0.linearise(log)?;
                Ok(Linearisation { jacobian_mm: -found.jacobian_mm, ..found })
            }
        }
        let wrong = estimate(&mut Backwards(model()), &no_prior(), &[3.0, 0.4], &settings).unwrap().convergence;
        assert!(wrong.is_unfinished(), "{wrong:?}");
    }

    fn no_prior() -> Vec<LogPrior> {
        ["a", "b"]
            .map(|name| LogPrior {
                name: name.to_owned(),
                mean: 0.0,
                sd: None,
                scale: Scale::Logarithm,
                correlation: Vec::new(),
                average: None,
            })
            .to_vec()
    }

    #[test]
    fn noise_free_parameters_come_back() {
        let truth = [1.3, 0.4];
        let mut model = Compliance { observed: simulate(&truth) };
        let settings = EstimateSettings { noise_mm: 0.1, decrement_tolerance: 0.0, ..EstimateSettings::default() };
        let descent = estimate(&mut model, &no_prior(), &[3.0, -1.0], &settings).unwrap();
        for p in 0..2 {
            assert!((descent.log_parameters[p] - truth[p]).abs() < 1e-6);
        }
        assert!(descent.costs.windows(2).all(|w| w[1] < w[0]), "the cost falls at every accepted step");
    }

    #[test]
    fn a_descent_ends_where_the_posterior_knows_no_better() {
        let truth = [1.3, 0.4];
        let run = |decrement_tolerance| {
            let mut model = Compliance { observed: simulate(&truth) };
            let settings = EstimateSettings { noise_mm: 0.1, decrement_tolerance, ..EstimateSettings::default() };
            estimate(&mut model, &no_prior(), &[3.0, -1.0], &settings).unwrap()
        };
        let (fine, rough) = (run(0.0), run(0.1));
        assert!(rough.evaluations < fine.evaluations, "{} {}", rough.evaluations, fine.evaluations);
        // Distance to the minimum in standard deviations of the posterior.
        let jt = fine.linearisation.jacobian_mm.transpose();
        let information = &jt * &fine.linearisation.jacobian_mm / 0.01;
        let away = DVector::from_fn(2, |p, _| rough.log_parameters[p] - fine.log_parameters[p]);
        assert!(away.dot(&(&information * &away)).sqrt() < 0.12);
    }

    #[test]
    fn a_tight_prior_holds_the_parameter() {
        let mut model = Compliance { observed: simulate(&[1.3, 0.4]) };
        let tight = |mean| LogPrior {
            name: String::new(),
            mean,
            sd: Some(1e-6),
            scale: Scale::Logarithm,
            correlation: Vec::new(),
            average: None,
        };
        let descent =
            estimate(&mut model, &[tight(2.0), tight(0.0)], &[2.5, 0.5], &EstimateSettings::default()).unwrap();
        assert!((descent.log_parameters[0] - 2.0).abs() < 1e-4 && descent.log_parameters[1].abs() < 1e-4);
    }

    #[test]
    fn what_is_no_number_is_refused_and_not_taken_for_a_minimum() {
        let model = || Compliance { observed: simulate(&[1.3, 0.4]) };
        // A pressure of 0: its logarithm.
        let mut prior = no_prior();
        (prior[1].name, prior[1].mean, prior[1].sd) = ("pressure".to_owned(), 0f64.ln(), Some(0.3));
        let settings = EstimateSettings::default();
        let found = estimate(&mut model(), &prior, &[3.0, 0.4], &settings);
        assert_eq!(found.unwrap_err(), EstimateError::Known(in_words("pressure").0));
        let noiseless = EstimateSettings { noise_mm: 0.0, ..settings.clone() };
        let found = estimate(&mut model(), &no_prior(), &[3.0, 0.4], &noiseless);
        assert_eq!(found.unwrap_err(), EstimateError::Cost);

        /// A sensitivity that is no number at one point.
        struct Slopeless {
            model: Compliance,
            at_start: bool,
            asked: usize,
        }
        impl Forward for Slopeless {
            type Error = String;
            fn linearise(&mut self, log: &[f64]) -> Result<Linearisation, String> {
                let mut found = self.model.linearise(log)?;
                if self.asked == usize::from(!self.at_start) {
                    found.jacobian_mm[(3, 1)] = f64::NAN;
                }
                self.asked += 1;
                Ok(found)
            }
        }
        let ended = |at_start| {
            let mut model = Slopeless { model: model(), at_start, asked: 0 };
            estimate(&mut model, &no_prior(), &[3.0, 0.4], &settings).map(|found| found.convergence)
        };
        assert_eq!(ended(true), Err(EstimateError::Cost));
        assert_eq!(ended(false), Ok(Convergence::StepBelowTolerance), "a trial point only shortens the step");
    }

    #[test]
    fn a_start_without_equilibrium_is_refused_with_its_reason() {
        let mut model = Compliance { observed: simulate(&[1.0, 1.0]) };
        let error = estimate(&mut model, &no_prior(), &[50.0, 0.0], &EstimateSettings::default()).unwrap_err();
        assert_eq!(error, EstimateError::Start("no equilibrium".to_owned()));
    }
}

//! How sure the estimate is, and what it cannot tell apart.

use super::LogPrior;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether the data say something about a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Knowledge {
    /// The data narrow the prior.
    Identified,
    /// The interval comes from the prior: the data add little.
    PriorDominated,
    /// Without prior the interval spans more than a factor 10 either way: not identifiable.
    NotIdentifiable,
    /// The data narrow the prior, but less than the measurement would: what the model leaves unexplained widens the interval.
    Widened,
    /// The figure is an average over models that cannot be told apart.
    Averaged,
    /// The figures are not an answer: no shift was seen, or the model does not stand, or not alone (the verdict says which).
    Withheld,
}

/// The Laplace approximation: a Gaussian over the log-parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Posterior {
    /// Names, in the order of everything below.
    pub names: Vec<String>,
    /// Most probable value of every parameter (exp of the mode of its logarithm).
    pub mode: Vec<f64>,
    /// Standard deviation of ln(parameter).
    pub log_sd: Vec<f64>,
    /// 95 % interval of every parameter.
    pub interval_95: Vec<[f64; 2]>,
    /// Covariance of the log-parameters, row by row.
    pub log_covariance: Vec<Vec<f64>>,
    /// What the data can tell.
    pub identifiability: Identifiability,
}

/// Panel of identifiability, from the data alone (prior left out).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Identifiability {
    /// One per parameter.
    pub verdicts: Vec<Knowledge>,
    /// Correlation of the sensitivities d u / d ln(parameter), row by row; near 1: a valley.
    pub sensitivity_correlation: Vec<Vec<f64>>,
    /// Ratio of the largest to the smallest eigenvalue of the Gauss-Newton matrix.
    pub condition: f64,
    /// The direction in log-parameters along which the data change least: along it the cost has its valley.
    pub valley: Vec<f64>,
    /// Standard deviation of the log-parameters along the valley from the data alone.
    pub valley_log_sd: f64,
}

/// From what part of a prior's standard deviation on the data have added little.
const LITTLE: f64 = 0.7;

/// Two-sided 95 % of a Gaussian.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// One-sided 95 % of a Gaussian.
pub(super) const Z_95_ONE_SIDED: f64 = 1.644_853_626_951_472_7;

/// What the data alone say of the first `own` parameters: J^T J of independent residuals of standard deviation 1, the other
/// parameters (of these precisions) integrated out.
pub fn information(jacobian: &DMatrix<f64>, own: usize, others: &[f64]) -> DMatrix<f64> {
    let all = jacobian.transpose() * jacobian;
    let ours = all.view((0, 0), (own, own)).into_owned();
    if others.is_empty() {
        return ours;
    }
    let count = others.len();
    let cross = all.view((own, 0), (count, own)).into_owned();
    let theirs = all.view((own, own), (count, count)) + DMatrix::from_diagonal(&DVector::from_column_slice(others));
    ours - cross.transpose() * invert(&theirs) * cross
}

/// How two parameters go together before the patient is seen.
pub fn prior_correlation(prior: &[LogPrior], a: usize, b: usize) -> f64 {
    match a.cmp(&b) {
        std::cmp::Ordering::Equal => 1.0,
        std::cmp::Ordering::Greater => prior[a].correlation.get(a - b - 1).copied().unwrap_or(0.0),
        std::cmp::Ordering::Less => prior_correlation(prior, b, a),
    }
}

/// The inverse of the joint covariance of these priors; rows of no prior knowledge are zero.
pub fn joint_precision(prior: &[LogPrior]) -> DMatrix<f64> {
    let n = prior.len();
    if prior.iter().all(|p| p.correlation.is_empty()) {
        return DMatrix::from_diagonal(&DVector::from_iterator(n, prior.iter().map(LogPrior::precision)));
    }
    let known: Vec<usize> = (0..n).filter(|&p| prior[p].sd.is_some()).collect();
    let sd = |p: usize| prior[p].sd.unwrap_or(0.0);
    let covariance = DMatrix::from_fn(known.len(), known.len(), |r, c| {
        prior_correlation(prior, known[r], known[c]) * sd(known[r]) * sd(known[c])
    });
    let inverse = invert(&covariance);
    let mut precision = DMatrix::zeros(n, n);
    for (r, &p) in known.iter().enumerate() {
        for (c, &q) in known.iter().enumerate() {
            precision[(p, q)] = inverse[(r, c)];
        }
    }
    precision
}

/// What the data say of every parameter whose covariance with the priors is this, whatever it was widened by since.
fn knowledge(covariance: &DMatrix<f64>, prior: &[LogPrior]) -> Vec<Knowledge> {
    // Without the prior that is in it; a covariance as wide as the prior leaves nothing that the data would say.
    let data = invert(covariance) - joint_precision(prior);
    let data_only = invert(&data);
    // A person may be anybody: whether the data say anything is asked of the average of the studies.
    let average: Vec<LogPrior> = prior.iter().map(LogPrior::of_average).collect();
    let from_average = invert(&(data + joint_precision(&average)));
    let sd = |variances: &DMatrix<f64>, p: usize| variances[(p, p)].max(0.0).sqrt();
    let of = |(p, prior): (usize, &LogPrior)| {
        // A parameter that goes along with another is known better once that one is: what the data leave of its own
        // prior is asked as well.
        let as_before = prior.sd.is_some_and(|before| sd(covariance, p) > LITTLE * before);
        match average[p].sd {
            Some(_) if as_before => Knowledge::PriorDominated,
            Some(before) if sd(&from_average, p) > LITTLE * before => Knowledge::PriorDominated,
            Some(_) => Knowledge::Identified,
            // Written so that an infinite or NaN variance is not identifiable.
            None if Z_95 * sd(&data_only, p) <= 10f64.ln() => Knowledge::Identified,
            None => Knowledge::NotIdentifiable,
        }
    };
    prior.iter().enumerate().map(of).collect()
}

/// The Laplace posterior at a minimum; `fisher` is what the data alone say there ([`information`]).
pub fn laplace(log_parameters: &[f64], fisher: &DMatrix<f64>, prior: &[LogPrior]) -> Posterior {
    let n = prior.len();
    let precision = joint_precision(prior);
    let covariance = invert(&(fisher + &precision));

    let eigen = SymmetricEigen::new(fisher.clone());
    let least = eigen.eigenvalues.imin();
    let (lowest, highest) = (eigen.eigenvalues[least].max(0.0), eigen.eigenvalues.max());
    let mut valley: Vec<f64> = eigen.eigenvectors.column(least).iter().copied().collect();
    // An eigenvector has no sign: the first component that is not zero is positive, always.
    if valley.iter().find(|v| v.abs() > 1e-9).is_some_and(|v| *v < 0.0) {
        valley = valley.into_iter().map(|v| -v).collect();
    }

    let log_sd: Vec<f64> = (0..n).map(|p| covariance[(p, p)].max(0.0).sqrt()).collect();
    let at = |p: usize, z: f64| prior[p].scale.value(log_parameters[p] + z * log_sd[p]);
    let correlation = |r: usize, c: usize| {
        let scale = (fisher[(r, r)] * fisher[(c, c)]).sqrt();
        if scale > 0.0 { fisher[(r, c)] / scale } else { 0.0 }
    };
    let rows = |f: &dyn Fn(usize, usize) -> f64| (0..n).map(|r| (0..n).map(|c| f(r, c)).collect()).collect();
    Posterior {
        names: prior.iter().map(|p| p.name.clone()).collect(),
        mode: (0..n).map(|p| at(p, 0.0)).collect(),
        interval_95: (0..n).map(|p| [at(p, -Z_95), at(p, Z_95)]).collect(),
        log_covariance: rows(&|r, c| covariance[(r, c)]),
        identifiability: Identifiability {
            verdicts: knowledge(&covariance, prior),
            sensitivity_correlation: rows(&correlation),
            condition: if lowest > 0.0 { highest / lowest } else { f64::MAX },
            valley,
            valley_log_sd: if lowest > 0.0 { lowest.sqrt().recip() } else { f64::MAX },
        },
        log_sd,
    }
}

impl Posterior {
    /// With every figure marked that the data had narrowed: the interval is wider by what the model leaves unexplained.
    #[must_use]
    pub fn widened(self) -> Self {
        self.marked(Knowledge::Widened)
    }

    /// With every figure withheld that the data had narrowed: the model does not stand, or not alone.
    #[must_use]
    pub fn withheld(self) -> Self {
        self.marked(Knowledge::Withheld)
    }

    fn marked(mut self, mark: Knowledge) -> Self {
        let narrowed = |v: &&mut Knowledge| matches!(**v, Knowledge::Identified | Knowledge::Widened);
        for verdict in self.identifiability.verdicts.iter_mut().filter(narrowed) {
            *verdict = mark;
        }
        self
    }

    /// With one parameter known no better than this (standard deviation of its number), whatever the fit says: the others
    /// are as much less sure as they go along with it.
    #[must_use]
    pub fn known_no_better(mut self, parameter: usize, least_sd: f64, values: &[f64], prior: &[LogPrior]) -> Self {
        let column: Vec<f64> = self.log_covariance.iter().map(|row| row[parameter]).collect();
        let own = column[parameter];
        let missing = least_sd * least_sd - own;
        if missing <= 0.0 || own <= 0.0 {
            return self;
        }
        for p in 0..column.len() {
            for q in 0..column.len() {
                self.log_covariance[p][q] += column[p] * column[q] / (own * own) * missing;
            }
            self.log_sd[p] = self.log_covariance[p][p].sqrt();
            self.interval_95[p] = [-Z_95, Z_95].map(|z| prior[p].scale.value(values[p] + z * self.log_sd[p]));
        }
        self.judged(prior)
    }

    /// With what its covariance, as wide as it is now, leaves the data to say.
    fn judged(mut self, prior: &[LogPrior]) -> Self {
        let covariance = DMatrix::from_fn(prior.len(), prior.len(), |r, c| self.log_covariance[r][c]);
        self.identifiability.verdicts = knowledge(&covariance, prior);
        self
    }

    /// With the model's own error (mesh, supports, the body's outer surface) added to the uncertainty of the parameters
    /// whose `error` is given, at these values: standard deviations of their logarithms, in the order of the names.
    #[must_use]
    pub fn with_model_error(mut self, error: &[f64], values: &[f64], prior: &[LogPrior]) -> Self {
        for (p, error) in error.iter().enumerate().filter(|(_, e)| **e > 0.0) {
            self.log_covariance[p][p] += error * error;
            self.log_sd[p] = self.log_covariance[p][p].sqrt();
            self.interval_95[p] = [-Z_95, Z_95].map(|z| prior[p].scale.value(values[p] + z * self.log_sd[p]));
        }
        self.judged(prior)
    }
}

/// Inverse of a symmetric positive matrix; a flat direction gets a variance of 1e12 instead of infinity (JSON has none).
pub(super) fn invert(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = SymmetricEigen::new(matrix.clone());
    let inverse = eigen.eigenvalues.map(|l| if l > 1e-12 { 1.0 / l } else { 1e12 });
    &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::Scale;

    /// The posterior of `jacobian` (mm) with independent residuals of .5 mm.
    fn of(jacobian: DMatrix<f64>, prior: &[LogPrior]) -> Posterior {
        laplace(&vec![7.0; prior.len()], &information(&(jacobian / 0.5), prior.len(), &[]), prior)
    }

    fn prior(sd: Option<f64>) -> LogPrior {
        LogPrior {
            name: "mu".to_owned(),
            mean: 7.0,
            sd,
            scale: Scale::Logarithm,
            correlation: Vec::new(),
            average: None,
        }
    }

    #[test]
    fn what_goes_along_with_a_parameter_is_as_much_less_sure() {
        // Twice the second parameter makes up for the first.
        let jacobian = DMatrix::from_fn(60, 2, |r, c| {
            let own = f64::from((r % 5) as u32) - 2.0;
            if c == 0 { own } else { 0.5 * own + 0.1 * (f64::from((r % 3) as u32) - 1.0) }
        });
        let prior = [prior(None), prior(None)];
        let before = of(jacobian, &prior);
        let slope = before.log_covariance[0][1] / before.log_covariance[1][1];
        let same = before.clone().known_no_better(1, 0.5 * before.log_sd[1], &[7.0; 2], &prior);
        assert_eq!(same.log_sd, before.log_sd);
        let least = 3.0 * before.log_sd[1];
        let after = before.clone().known_no_better(1, least, &[7.0; 2], &prior);
        assert!((after.log_sd[1] - least).abs() < 1e-12);
        let given = before.log_sd[0].powi(2) - slope * slope * before.log_sd[1].powi(2);
        assert!((after.log_sd[0].powi(2) - given - (slope * least).powi(2)).abs() < 1e-12);
        assert!((after.interval_95[0][1].ln() - 7.0 - Z_95 * after.log_sd[0]).abs() < 1e-9);
    }

    #[test]
    fn one_parameter_has_the_textbook_standard_deviation() {
        let posterior = of(DMatrix::from_element(25, 1, 2.0), &[prior(None)]);
        // sd = noise / (|J|) = 0.5 / (2 sqrt 25).
        assert!((posterior.log_sd[0] - 0.05).abs() < 1e-12);
        assert_eq!(posterior.identifiability.verdicts, [Knowledge::Identified]);
        assert!((posterior.interval_95[0][1] / posterior.mode[0] - (0.05 * Z_95).exp()).abs() < 1e-12);
    }

    #[test]
    fn only_the_sum_is_seen_so_the_difference_is_the_valley() {
        let posterior = of(DMatrix::from_element(25, 2, 1.0), &[prior(None), prior(None)]);
        assert_eq!(posterior.identifiability.verdicts, [Knowledge::NotIdentifiable; 2]);
        assert!((posterior.identifiability.sensitivity_correlation[0][1] - 1.0).abs() < 1e-12);
        let valley = &posterior.identifiability.valley;
        assert!((valley[0] + valley[1]).abs() < 1e-9 && valley[0] > 0.0);
    }

    #[test]
    fn without_sensitivity_the_prior_is_returned_and_said_to_be() {
        let posterior = of(DMatrix::zeros(25, 1), &[prior(Some(0.4))]);
        assert!((posterior.log_sd[0] - 0.4).abs() < 1e-9);
        assert_eq!(posterior.identifiability.verdicts, [Knowledge::PriorDominated]);
    }

    #[test]
    fn what_the_models_own_error_buries_the_data_no_longer_say() {
        let prior = [prior(Some(0.35))];
        let sharp = of(DMatrix::from_element(25, 1, 1.0), &prior);
        assert_eq!(sharp.identifiability.verdicts, [Knowledge::Identified]);
        let erring = |by: f64| sharp.clone().with_model_error(&[by], &[7.0], &prior).identifiability.verdicts;
        assert_eq!(erring(0.05), [Knowledge::Identified]);
        assert_eq!(erring(0.3), [Knowledge::PriorDominated]);
    }

    #[test]
    fn a_parameter_that_is_integrated_out_leaves_what_is_left_of_the_others() {
        let jacobian = DMatrix::from_fn(30, 3, |r, c| f64::from(((r * (c + 2) + c) % 7) as u32) - 2.5);
        let others = [4.0];
        let left = information(&jacobian, 2, &others);
        // The inverse of the whole information with the other's prior, its block of the first two.
        let mut whole = jacobian.transpose() * &jacobian;
        whole[(2, 2)] += others[0];
        let block = whole.try_inverse().unwrap().view((0, 0), (2, 2)).into_owned();
        assert!((left.try_inverse().unwrap() - block).amax() < 1e-12);
    }

    #[test]
    fn withheld_figures_are_none_that_the_data_had_narrowed() {
        let posterior = of(DMatrix::from_element(25, 1, 2.0), &[prior(Some(1.0))]).withheld();
        assert_eq!(posterior.identifiability.verdicts, [Knowledge::Withheld]);
    }

    #[test]
    fn correlated_priors_have_the_inverse_of_their_covariance_as_precision() {
        let prior = |sd: Option<f64>, correlation: Vec<f64>| LogPrior {
            name: String::new(),
            mean: 0.0,
            sd,
            scale: Scale::Plain,
            correlation,
            average: None,
        };
        let found = joint_precision(&[prior(Some(0.5), vec![]), prior(Some(2.0), vec![0.6]), prior(None, vec![])]);
        let covariance = nalgebra::Matrix2::new(0.25, 0.6, 0.6, 4.0);
        let expected = covariance.try_inverse().unwrap();
        for r in 0..2 {
            for c in 0..2 {
                assert!((found[(r, c)] - expected[(r, c)]).abs() < 1e-12);
            }
        }
        assert_eq!(found[(2, 2)], 0.0);
    }

    #[test]
    fn whether_the_data_say_anything_is_asked_of_the_average_of_the_studies() {
        let average = Some(crate::experiment::estimate::Average { mean: 7.0, sd: 0.35 });
        let person = LogPrior { sd: Some(2.2), average, ..prior(None) };
        // As good as the average alone: what the data narrow of a person's prior is known without them.
        let told = |known_to: f64| {
            let fisher = DMatrix::from_element(1, 1, known_to.powi(-2));
            laplace(&[7.0], &fisher, std::slice::from_ref(&person)).identifiability.verdicts[0]
        };
        assert_eq!([told(0.5), told(0.2)], [Knowledge::PriorDominated, Knowledge::Identified]);
    }

    #[test]
    fn what_is_known_only_along_with_another_parameter_is_not_narrowed_by_itself() {
        use crate::experiment::estimate::Average;
        let of =
            |sd: f64, average: f64| LogPrior { average: Some(Average { mean: 7.0, sd: average }), ..prior(Some(sd)) };
        // A person's modulus may be anything; the studies' average of it is narrow, and would fix the exponent along the valley.
        let known = [of(2.2, 0.35), LogPrior { scale: Scale::Plain, ..of(11.9, 11.9) }];
        let seen = DMatrix::from_row_slice(1, 2, &[1.0, 0.05]) / 0.01;
        let found = laplace(&[7.0; 2], &information(&seen, 2, &[]), &known);
        assert!(found.log_sd[1] > 0.9 * 11.9, "{:?}", found.log_sd);
        assert_eq!(found.identifiability.verdicts[1], Knowledge::PriorDominated);
    }
}

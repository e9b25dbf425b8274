//! The fit to displacements whose errors are alike over a distance, with what no model of the body explains: a rigid
//! remainder and a smooth discrepancy, so that the intervals are as wide as the model is wrong.

use super::body::{Body, Observation, Solved};
use super::evidence::{Evidence, LinearModel, Unexplained};
use super::findings::{Findings, Fitted, Odds, ProblemError, ROUGH, Shift, differences};
use super::levenberg_marquardt::known_beforehand;
use super::nuisance::{Nuisance, Weighted};
use super::posterior::Z_95_ONE_SIDED;
use super::process::{Factor, Process, spread_out};
use super::projection::Projection;
use super::re_registration::{Instrument, MovedNode, without_own_error};
use super::rigid_remainder::{RIGID, RigidModes};
use super::shape::{Shape, ShapeColumns, ShapeFound};
use super::softest::softest;
use super::unseen::{Share, above_noise, least_share_above_noise, share_of, without_rigid};
use super::{
    Convergence, Descent, EstimateError, EstimateSettings, Forward, Linearisation, LogPrior, estimate, information,
};
use crate::experiment::rmse::root_mean_square;
use crate::experiment::verdict::{CONTRADICTION_SD, STRONG};
use crate::fem::Outcome;
use nalgebra::{DMatrix, DVector};

/// What is known of the errors of displacements beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CorrelatedErrors {
    /// Noise of the measurement.
    pub noise: Process,
    /// Standard deviation of that noise once the instrument's own error is taken out, mm.
    pub corrected_mm: f64,
    /// Expected error of the rigid registration, mm.
    pub rigid_mm: f64,
    /// Most places that are looked at: they are chosen evenly, and what lies between them says the same.
    pub places: usize,
}

/// Most iterations of a descent that another follows: the errors are looked at again before it.
const ROUGH_ITERATIONS: usize = 8;

/// Most descents, each under the errors of the point before it, until point and errors agree.
const SETTLING: usize = 3;

/// How many times more the instrument is shown the state where that has since moved by more than the noise: its own error
/// is about a tenth of what it is shown.
const AGAIN: usize = 2;

/// What a fit has beside the model and what was seen.
#[derive(Clone, Copy, Default)]
pub(super) struct Beside<'s> {
    /// The measurement, and how many times its own error is to be taken out.
    pub instrument: Option<(&'s Instrument<'s>, usize)>,
    /// The body's shape, where it is not known exactly.
    pub shape: Option<&'s Shape<'s>>,
    /// Whether the measurement's rigid half follows the brain: then what moves rigidly is not seen.
    pub rigid_follows: bool,
}

/// A fit under way: the model, the places looked at, and the points where it was linearised.
struct Fit<'b, 'a> {
    body: &'b mut Body<'a>,
    places_mm: Vec<[f64; 3]>,
    /// The rigid remainder, and the body's shape where it is not known.
    nuisance: Nuisance,
    /// What is not known of that.
    shape: Option<ShapeColumns>,
    beside: Beside<'b>,
    /// Priors of the model's own parameters and of those amounts behind them.
    prior: Vec<LogPrior>,
    own: usize,
}

impl Fit<'_, '_> {
    /// Descends by what the model could do; the linearisation of what is returned is in mm.
    fn descend(
        &mut self,
        projection: &Projection,
        start: &[f64],
        settings: &EstimateSettings,
    ) -> Result<Descent, ProblemError> {
        let settings = EstimateSettings { noise_mm: 1.0, ..settings.clone() };
        let mut weighted = Weighted { model: &mut *self.body, nuisance: &self.nuisance, projection, plain: Vec::new() };
        let mut descent = estimate(&mut weighted, &self.prior, start, &settings)?;
        let (own, amounts) = descent.log_parameters.split_at(self.own);
        let plain = weighted.plain.iter().rev().find(|(at, _)| at == own);
        if let Some((_, plain)) = plain {
            descent.linearisation = self.nuisance.added_to(plain, amounts);
        }
        Ok(descent)
    }

    /// A descent that has not begun.
    fn at(&mut self, parameters: &[f64]) -> Result<Descent, ProblemError> {
        let (own, amounts) = parameters.split_at(self.own);
        let plain = self.body.linearise(own).map_err(|e| EstimateError::Start(e.to_string()))?;
        Ok(Descent {
            log_parameters: parameters.to_vec(),
            linearisation: self.nuisance.added_to(&plain, amounts),
            costs: Vec::new(),
            evaluations: 0,
            convergence: Convergence::IterationsExhausted,
        })
    }

    /// What the model could do about a point, under these errors.
    fn projection(&self, at: &Descent, unexplained: &Unexplained) -> Result<Projection, ProblemError> {
        let factor = unexplained.factor(&self.places_mm);
        let found = factor.and_then(|factor| Projection::new(&at.linearisation.jacobian_mm, &factor));
        Ok(found.ok_or(EstimateError::Covariance)?)
    }

    /// Descends from a point by what the model could do there, under the most probable errors.
    fn descend_projected(
        &mut self,
        from: &Descent,
        noise: Process,
        settings: &EstimateSettings,
    ) -> Result<Descent, ProblemError> {
        let unexplained = self.errors(from, noise)?.unexplained;
        let projection = self.projection(from, &unexplained)?;
        self.descend(&projection, &from.log_parameters, settings)
    }

    /// Descends until point and errors agree, or nearly: far from the minimum a large discrepancy is the most probable one,
    /// and under it the prior weighs more than it should.
    fn settle(&mut self, from: Descent, noise: Process, settings: &EstimateSettings) -> Result<Descent, ProblemError> {
        let mut here = from;
        for _ in 0..SETTLING {
            here = self.descend_projected(&here, noise, settings)?;
            // The first evaluation is of the point itself.
            if here.evaluations <= 1 {
                break;
            }
        }
        Ok(here)
    }

    /// The same, and again with what the shape does found anew where that has led to another body.
    fn settle_with_shape(
        &mut self,
        from: Descent,
        noise: Process,
        settings: &EstimateSettings,
    ) -> Result<Descent, ProblemError> {
        let settled = self.settle(from, noise, settings)?;
        match self.shape_found_anew(&settled)? {
            Some(from) => self.settle(from, noise, settings),
            None => Ok(settled),
        }
    }

    /// The same point with what the shape does to the body there, where that is another body than it was found for: of a stiffer
    /// one it is less, and outline and falx would pass for as much better known. Where it cannot be found for all the amounts
    /// what was found before stays.
    fn shape_found_anew(&mut self, here: &Descent) -> Result<Option<Descent>, ProblemError> {
        let own = &here.log_parameters[..self.own];
        let are_moduli = self.body.are_moduli();
        let Some(before) = self.shape.as_ref().filter(|shape| shape.is_of_another_body(own, &are_moduli)) else {
            return Ok(None);
        };
        let anew = self.beside.shape.and_then(|shape| shape.columns(own, &self.places_mm));
        let Some(anew) = anew.filter(|anew| anew.of_same_amounts(before)) else { return Ok(None) };
        self.nuisance.columns_mm.columns_mut(RIGID, anew.columns_mm.ncols()).copy_from(&anew.columns_mm);
        self.shape = Some(anew);
        self.at(&here.log_parameters).map(Some)
    }

    /// The most probable errors around a point.
    fn errors(&self, at: &Descent, measured: Process) -> Result<Evidence, ProblemError> {
        Ok(self.linear(at).with_discrepancy(measured).ok_or(EstimateError::Covariance)?)
    }

    fn linear<'c>(&'c self, at: &'c Descent) -> LinearModel<'c> {
        let away = at.log_parameters.iter().zip(&self.prior).map(|(value, prior)| value - prior.mean);
        LinearModel {
            places_mm: &self.places_mm,
            residuals_mm: &at.linearisation.residuals_mm,
            jacobian_mm: &at.linearisation.jacobian_mm,
            away: DVector::from_iterator(self.prior.len(), away),
            precision: super::joint_precision(&self.prior),
            way_left: true,
        }
    }
}

/// Finds the parameters, the rigid remainder, the outline and the discrepancy together.
///
/// # Errors
/// [`ProblemError`].
pub(super) fn fit(
    body: &mut Body<'_>,
    errors: &CorrelatedErrors,
    prior: &[LogPrior],
    start: &[f64],
    beside: Beside<'_>,
    settings: &EstimateSettings,
) -> Result<Fitted, ProblemError> {
    // What has not moved is not descended for: its evidence would be of no number.
    known_beforehand(prior)?;
    let seen = body.observed_nodes().to_vec();
    let own = prior.len();
    if seen.len() <= own {
        return Err(EstimateError::TooFewObservations { observations: 3 * seen.len(), parameters: own }.into());
    }
    let nodes_mm = body.mesh().nodes_mm();
    let positions: Vec<[f64; 3]> = seen.iter().map(|(n, _)| nodes_mm[*n as usize]).collect();
    let chosen = spread_out(&positions, errors.places);
    let pick = |list: &[MovedNode]| -> Vec<MovedNode> { chosen.iter().map(|&n| list[n]).collect() };
    let places_mm: Vec<[f64; 3]> = chosen.iter().map(|&n| positions[n]).collect();
    let rigid = RigidModes::new(&places_mm, errors.rigid_mm);
    let seen_there = pick(&seen);
    body.observe(Observation::Nodes(seen_there.clone()));
    let seen_mm = DVector::from_iterator(3 * seen_there.len(), seen_there.iter().flat_map(|(_, u)| *u));
    let moved = above_noise(&seen_mm, errors.noise);
    let nuisance = Nuisance::rigid(&rigid);
    let shape = beside.shape.filter(|_| moved).and_then(|shape| shape.columns(start, &places_mm));
    let nuisance = match &shape {
        Some(shape) => nuisance.with(&shape.columns_mm, shape.priors()),
        None => nuisance,
    };
    let prior: Vec<LogPrior> = prior.iter().chain(&nuisance.priors).cloned().collect();
    let amounts = nuisance.count();
    let mut fit = Fit { body, places_mm, nuisance, shape, beside, prior, own };

    let iterations = settings.iterations.min(ROUGH_ITERATIONS);
    let rough = EstimateSettings { decrement_tolerance: ROUGH, iterations, ..settings.clone() };
    let from: Vec<f64> = start.iter().copied().chain(std::iter::repeat_n(0.0, amounts)).collect();
    let start = fit.at(&from)?;
    // What has not moved says nothing of how the registration sees what moves, and a bound needs no minimum.
    let instrument = beside.instrument.filter(|(_, rounds)| moved && *rounds > 0);
    let mut descent = if moved {
        fit.settle_with_shape(start, errors.noise, &rough)?
    } else {
        Descent { convergence: Convergence::NotSought, ..start }
    };
    let (mut taken_out_rms_mm, mut taken_up) = (None, None);
    if let Some((instrument, rounds)) = instrument {
        let mut shown: Option<Vec<[f64; 3]>> = None;
        for round in 0..rounds + AGAIN {
            let known = fit.body.solve(&descent.log_parameters[..own])?.outcome.displacement_mm;
            let away = |before: &Vec<[f64; 3]>| rms_between(before, &known, &seen);
            if round >= rounds && shown.as_ref().is_some_and(|before| away(before) <= errors.noise.sd_mm) {
                break;
            }
            let corrected = without_own_error(&seen, &known, instrument)?;
            taken_out_rms_mm = root_mean_square(&differences(&seen, &corrected.nodes));
            fit.body.observe(Observation::Nodes(pick(&corrected.nodes)));
            taken_up = Some(corrected.taken_up);
            descent = fit.settle_with_shape(descent, errors.noise, &rough)?;
            shown = Some(known);
        }
    }
    if moved {
        descent = fit.descend_projected(&descent, errors.noise, settings)?;
    }
    // What models are ranked by.
    let ranked = fit.linear(&descent).after(descent.convergence);
    let evidence = ranked.with_discrepancy(errors.noise).ok_or(EstimateError::Covariance)?;
    let exact = ranked.with_noise_alone(errors.noise).ok_or(EstimateError::Covariance)?;
    // A discrepancy that is not needed is none: its size would widen nothing but by chance.
    let unexplained = if evidence.log_evidence > exact.log_evidence { evidence.unexplained } else { exact.unexplained };

    let mut findings = fit.findings(errors, &seen_there, &descent, unexplained, [evidence, exact])?;
    // Whether anything has moved at all is asked of the measurement as it comes.
    if taken_out_rms_mm.is_some() && findings.shift.seen {
        findings.measured_noise.sd_mm = errors.corrected_mm;
    }
    let precisions: Vec<f64> = fit.prior[own..].iter().map(LogPrior::precision).collect();
    let residuals = descent.linearisation.residuals_mm.as_slice();
    let residual_rms_mm = root_mean_square(residuals).unwrap_or(0.0);
    let observations = residuals.len();
    let total_sd_mm = unexplained.noise.sd_mm.hypot(unexplained.discrepancy.sd_mm);
    let plain = Linearisation {
        residuals_mm: descent.linearisation.residuals_mm.clone(),
        jacobian_mm: descent.linearisation.jacobian_mm.columns(0, own).into_owned(),
    };
    descent.log_parameters.truncate(own);
    Ok(Fitted {
        fisher: information(&findings.white_jacobian, own, &precisions),
        noise_mm: total_sd_mm,
        independent: independent(&findings.factor, &fit.places_mm, total_sd_mm),
        residual_rms_mm,
        rest_rms_mm: root_mean_square(fit.body.residuals_at_rest().as_slice()).unwrap_or(0.0),
        observations,
        taken_out_rms_mm,
        taken_up,
        correlated: Some(findings),
        descent: Descent { linearisation: plain, ..descent },
    })
}

/// Root mean square distance between two states over the nodes that were seen, mm.
fn rms_between(before: &[[f64; 3]], after: &[[f64; 3]], seen: &[MovedNode]) -> f64 {
    let squared = |n: usize| (0..3).map(|a| (after[n][a] - before[n][a]).powi(2)).sum::<f64>();
    (seen.iter().map(|(n, _)| squared(*n as usize)).sum::<f64>() / seen.len().max(1) as f64).sqrt()
}

/// How many independent observations tell as much of a shift of everything as these do.
fn independent(factor: &Factor, places_mm: &[[f64; 3]], sd_mm: f64) -> f64 {
    let along_x = DMatrix::from_fn(3 * places_mm.len(), 1, |row, _| if row % 3 == 0 { 1.0 } else { 0.0 });
    3.0 * factor.whiten(&along_x).norm_squared() * sd_mm * sd_mm
}

impl Fit<'_, '_> {
    /// The rigid remainder's patterns.
    fn rigid(&self) -> DMatrix<f64> {
        self.nuisance.columns_mm.columns(0, RIGID).into_owned()
    }

    fn rigid_precision(&self) -> Vec<f64> {
        self.prior[self.own..self.own + RIGID].iter().map(LogPrior::precision).collect()
    }

    /// What was seen as a rigid remainder and noise alone, and with a smooth movement of any kind.
    fn without_mechanics(&self, seen_mm: &DVector<f64>, noise: Process) -> Result<[Evidence; 2], ProblemError> {
        let unmoved = -seen_mm;
        let precision = self.rigid_precision();
        let still = LinearModel {
            places_mm: &self.places_mm,
            residuals_mm: &unmoved,
            jacobian_mm: &self.rigid(),
            away: DVector::zeros(RIGID),
            precision: DMatrix::from_diagonal(&DVector::from_column_slice(&precision)),
            way_left: true,
        };
        let nothing = still.with_noise_alone(noise).ok_or(EstimateError::Covariance)?;
        let anything = still.with_discrepancy(noise).ok_or(EstimateError::Covariance)?;
        Ok([nothing, anything])
    }

    /// What the fit says of the shift and of the model, beside simpler explanations.
    fn findings(
        &mut self,
        errors: &CorrelatedErrors,
        seen: &[MovedNode],
        descent: &Descent,
        unexplained: Unexplained,
        [evidence, exact]: [Evidence; 2],
    ) -> Result<Findings, ProblemError> {
        let rows = 3 * seen.len();
        let flat = |u: &dyn Fn(usize) -> [f64; 3]| DVector::from_fn(rows, |row, _| u(row / 3)[row % 3]);
        // Model, any movement and none are held against the same: what was seen without the instrument's own error. As it was
        // seen that error would speak for a movement, and only the model would have been spared it.
        let seen_mm = flat(&|n| self.body.observed_nodes()[n].1);
        let (rigid, precision, follows) = (self.rigid(), self.rigid_precision(), self.beside.rigid_follows);
        let [nothing, anything] = self.without_mechanics(&seen_mm, errors.noise)?;
        let model = evidence.log_evidence.max(exact.log_evidence);
        let odds = Odds {
            log_evidence: model,
            log_evidence_exact: exact.log_evidence,
            model_to_any_movement: model - anything.log_evidence,
            moved_to_still: model.max(anything.log_evidence) - nothing.log_evidence,
        };

        // How much of what the body would do is there, and how well that is known. Of a body that has not moved only the
        // prior's most probable one says what it would do.
        let seen_at_all = odds.moved_to_still > STRONG && above_noise(&seen_mm, errors.noise);
        let usual: Vec<f64> = self.prior[..self.own].iter().map(|p| p.mean).collect();
        let at = if seen_at_all { descent.log_parameters[..self.own].to_vec() } else { self.body.start(&usual) };
        let Solved { outcome: Outcome { displacement_mm: pattern_mm, .. }, sensitivities } = self.body.solve(&at)?;
        let pattern = flat(&|n| pattern_mm[seen[n].0 as usize]);
        // Beside a shift, "noise alone" is the shift itself: then what was measured beforehand counts.
        let noise = if seen_at_all { errors.noise } else { nothing.unexplained.noise };
        let factor = Factor::new(&self.places_mm, &[noise]).ok_or(EstimateError::Covariance)?;
        // Where rigid registration follows the brain it takes up the rigid part of whatever moves, which says nothing then.
        let (told, precision) =
            if follows { (without_rigid(&pattern, &rigid), vec![0.0; RIGID]) } else { (pattern, precision) };
        let size = share_of(&told, &seen_mm, &rigid, &precision, &factor);
        let largest_mm = pattern_mm.iter().map(|u| u.iter().map(|v| v * v).sum::<f64>().sqrt()).fold(0.0, f64::max);
        // What may pass for noise is not ruled out, however little of it the seen displacement looks like.
        let passes_for_noise = least_share_above_noise(&told, errors.noise);
        let largest_share = size
            .filter(|_| !seen_at_all)
            .map(|Share { share, sd }| passes_for_noise.max(share.max(0.0) + Z_95_ONE_SIDED * sd));
        let changes = |s: &Vec<[f64; 3]>| told.dot(&flat(&|n| s[seen[n].0 as usize])) / told.norm_squared();
        // What the shape makes of a size is the usual body's.
        let in_question = self.beside.shape.filter(|_| largest_share.is_some());
        let in_question = in_question.and_then(|shape| shape.columns(&at, &self.places_mm));
        let of_shape_log_sd = in_question.as_ref().map_or(0.0, |shape| shape.log_sd_of_size(&told));
        let softest = largest_share.map_or_else(Vec::new, |share| {
            let slopes: Vec<f64> = sensitivities.iter().map(changes).collect();
            softest(share, &at, &slopes, &self.prior[..self.own], &self.body.are_moduli(), of_shape_log_sd)
        });
        // A shift of a size that is not ruled out, and was not seen, would not have been.
        let not_ruled_out = largest_share.filter(|_| follows).unwrap_or(0.0);
        let would_be_seen = |sd: f64| passes_for_noise.max(CONTRADICTION_SD * sd).max(not_ruled_out);
        let (remainder, of_shape) = descent.log_parameters[self.own..].split_at(RIGID);
        let remainder = rigid * DVector::from_column_slice(remainder);
        let residuals = &descent.linearisation.residuals_mm;
        let rms = |v: &DVector<f64>| (v.norm_squared() / seen.len() as f64).sqrt();
        let shifted = &seen_mm - &remainder;
        let projection = self.projection(descent, &unexplained)?;
        Ok(Findings {
            white_jacobian: projection.whiten(&descent.linearisation.jacobian_mm),
            precision: super::joint_precision(&self.prior),
            factor: unexplained.factor(&self.places_mm).ok_or(EstimateError::Covariance)?,
            projection,
            places_mm: self.places_mm.clone(),
            nodes: seen.iter().map(|(n, _)| *n).collect(),
            unexplained,
            measured_noise: errors.noise,
            odds,
            rigid_remainder_mm: rms(&remainder),
            shape: ShapeFound {
                unsolved: in_question.as_ref().or(self.shape.as_ref()).map_or(0, ShapeColumns::unsolved),
                ..self.shape.as_ref().map_or_else(ShapeFound::default, |shape| shape.found(of_shape))
            },
            softest,
            seen_mean_mm: std::array::from_fn(|axis| {
                seen_mm.iter().skip(axis).step_by(3).sum::<f64>() / seen.len().max(1) as f64
            }),
            shift: Shift {
                seen: seen_at_all,
                seen_rms_mm: rms(&shifted),
                explained_share: if seen_at_all {
                    1.0 - residuals.norm_squared() / shifted.norm_squared().max(f64::MIN_POSITIVE)
                } else {
                    0.0
                },
                // Where its size cannot be told at all, no smaller movement can.
                would_be_seen_mm: size.map_or(largest_mm, |Share { sd, .. }| largest_mm * would_be_seen(sd)),
                largest_share,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ShapeError, Shown, Unknown};
    use super::*;
    use crate::experiment::phantom::{PhantomSettings, block};
    use crate::experiment::sample::Tissue;
    use crate::fem::Scenario;
    use std::iter::repeat_n;

    /// A block that is pushed from above, and what is estimated of it.
    fn pushed() -> (Scenario, Vec<Unknown>) {
        let settings = PhantomSettings::pushed_from_above();
        (settings.scenario(), Tissue::grey_and_white().into_iter().map(Unknown::ShearModulus).collect())
    }

    /// The rigid registration of scans without a skull follows the brain: nothing is seen of what moves rigidly.
    #[test]
    fn what_rigid_registration_follows_counts_neither_for_what_would_be_seen_nor_for_how_stiff_a_brain_is() {
        let (mesh, (scenario, unknowns)) = (block(4), pushed());
        let usual = [1100f64.ln(); 2];
        let prior: Vec<LogPrior> = unknowns.iter().map(|unknown| unknown.prior(usual[0], 0.4)).collect();
        let body = |seen| Body::new(&mesh, &scenario, unknowns.clone(), 0.45, Observation::Nodes(seen)).unwrap();
        let pattern = body(Vec::new()).equilibrium(&usual).unwrap().displacement_mm;
        let rigid = RigidModes::new(mesh.nodes_mm(), 0.1).columns_mm;
        let left =
            |u: &[[f64; 3]]| without_rigid(&DVector::from_iterator(3 * u.len(), u.iter().flatten().copied()), &rigid);
        let stripped = |u: &[[f64; 3]]| -> Vec<MovedNode> {
            let left = left(u);
            (0..u.len()).map(|n| (n as u32, [0, 1, 2].map(|a| left[3 * n + a]))).collect()
        };
        let instrument = |u: &[[f64; 3]]| Ok(Shown::from(stripped(u)));
        let noise = Process { sd_mm: 0.02, length_mm: 7.5 };
        let errors = CorrelatedErrors { noise, corrected_mm: noise.sd_mm, rigid_mm: 0.1, places: 1000 };
        let passes_for_noise = least_share_above_noise(&left(&pattern), noise);
        let largest_mm = pattern.iter().map(|u| u.iter().map(|v| v * v).sum::<f64>().sqrt()).fold(0.0, f64::max);
        for times in [0.3, 0.9, 0.99, 1.2, 1.5] {
            let share = times * passes_for_noise;
            let moved: Vec<[f64; 3]> = pattern.iter().map(|u| u.map(|v| share * v)).collect();
            let beside = Beside { instrument: Some((&instrument, 1)), shape: None, rigid_follows: true };
            let mut body = body(stripped(&moved));
            let found = fit(&mut body, &errors, &prior, &usual, beside, &EstimateSettings::default()).unwrap();
            let found = found.correlated.unwrap();
            assert!(!found.shift.seen || times > 1.0, "{times}: {:?}", found.shift);
            if found.shift.seen {
                continue;
            }
            assert!(share * largest_mm <= found.shift.would_be_seen_mm, "{times}: {share} {:?}", found.shift);
            for bound in &found.softest {
                let log_pa = bound.unwrap().log_bound(0.0);
                assert!(log_pa <= usual[0] - share.ln(), "{times}: {log_pa} {share}");
            }
        }
    }

    #[test]
    fn what_the_shape_does_is_found_anew_where_the_descent_has_come_to_another_body() {
        let (mesh, (scenario, unknowns)) = (block(4), pushed());
        let error = ShapeError { outline_mm: 0.5, ..ShapeError::default() };
        let shape = Shape { mesh: &mesh, template: &scenario, unknowns: &unknowns, poisson_ratio: 0.45, error };
        let seen: Vec<MovedNode> = (0..mesh.nodes_mm().len() as u32).step_by(5).map(|n| (n, [0.0; 3])).collect();
        let places_mm: Vec<[f64; 3]> = seen.iter().map(|(n, _)| mesh.nodes_mm()[*n as usize]).collect();
        let mut body = Body::new(&mesh, &scenario, unknowns.clone(), 0.45, Observation::Nodes(seen)).unwrap();
        let of = |pa: f64| shape.columns(&[pa.ln(); 2], &places_mm).unwrap();
        let (stiff, soft) = (of(4000.0), of(1100.0).columns_mm);
        let nuisance = Nuisance::rigid(&RigidModes::new(&places_mm, 0.1)).with(&stiff.columns_mm, stiff.priors());
        let own = unknowns.iter().map(|unknown| unknown.prior(7.0, 0.4));
        let mut fit = Fit {
            prior: own.chain(nuisance.priors.clone()).collect(),
            body: &mut body,
            places_mm: places_mm.clone(),
            nuisance,
            shape: Some(stiff),
            beside: Beside { shape: Some(&shape), ..Beside::default() },
            own: 2,
        };
        let before = fit.nuisance.clone();
        let at = |pa: f64| -> Vec<f64> { repeat_n(pa.ln(), 2).chain(repeat_n(0.1, before.count())).collect() };
        let near = fit.at(&at(3000.0)).unwrap();
        assert!(fit.shape_found_anew(&near).unwrap().is_none());
        assert_eq!(fit.nuisance.columns_mm, before.columns_mm);
        let far = fit.at(&at(1100.0)).unwrap();
        let again = fit.shape_found_anew(&far).unwrap().unwrap();
        assert_eq!(again.log_parameters, far.log_parameters);
        assert_eq!(again.linearisation.jacobian_mm.columns(2 + RIGID, soft.ncols()), soft);
        assert_eq!(fit.nuisance.columns_mm.columns(0, RIGID), before.columns_mm.columns(0, RIGID));
        assert!(soft.norm() > 2.0 * before.columns_mm.columns(RIGID, soft.ncols()).norm());
        // Of this body it is known now.
        assert!(fit.shape_found_anew(&again).unwrap().is_none());
    }
}

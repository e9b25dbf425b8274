//! The fit to observations whose errors are independent but for a share: displacements of a phantom, distances to a surface.

use super::body::{Body, Observation};
use super::findings::{Fitted, ProblemError, ROUGH, differences};
use super::re_registration::{Instrument, without_own_error};
use super::{EstimateSettings, LogPrior, estimate, information};
use crate::experiment::rmse::root_mean_square;

/// The fit to observations that are independent but for a share.
pub(super) fn fit_independent(
    body: &mut Body<'_>,
    share: f64,
    prior: &[LogPrior],
    start: &[f64],
    instrument: Option<(&Instrument<'_>, usize)>,
    settings: &EstimateSettings,
) -> Result<Fitted, ProblemError> {
    let share = share.clamp(1e-9, 1.0);
    // Neighbours share their error: together they weigh as much as the independent ones alone.
    let descent_settings = EstimateSettings { noise_mm: settings.noise_mm / share.sqrt(), ..settings.clone() };
    // A state that the instrument is shown need not be the best one.
    let rough = EstimateSettings { decrement_tolerance: ROUGH, ..descent_settings.clone() };
    let first = if instrument.is_some_and(|(_, rounds)| rounds > 0) { &rough } else { &descent_settings };
    let mut descent = estimate(body, prior, start, first)?;
    let (mut taken_out_rms_mm, mut taken_up) = (None, None);
    if let Some((instrument, rounds)) = instrument {
        let seen = body.observed_nodes().to_vec();
        for round in 1..=rounds {
            let known = body.solve(&descent.log_parameters)?.outcome.displacement_mm;
            let corrected = without_own_error(&seen, &known, instrument)?;
            taken_out_rms_mm = root_mean_square(&differences(&seen, &corrected.nodes));
            body.observe(Observation::Nodes(corrected.nodes));
            taken_up = Some(corrected.taken_up);
            let settings = if round < rounds { &rough } else { &descent_settings };
            descent = estimate(body, prior, &descent.log_parameters, settings)?;
        }
    }
    let residuals = &descent.linearisation.residuals_mm;
    let residual_rms_mm = root_mean_square(residuals.as_slice()).unwrap_or(0.0);
    // What the model cannot explain is noise to it: a misfit above the measurement's widens the intervals.
    let noise_mm = settings.noise_mm.max(residual_rms_mm);
    let weighted = &descent.linearisation.jacobian_mm * (share.sqrt() / noise_mm);
    Ok(Fitted {
        fisher: information(&weighted, prior.len(), &[]),
        noise_mm,
        independent: share * residuals.len() as f64,
        residual_rms_mm,
        rest_rms_mm: root_mean_square(body.residuals_at_rest().as_slice()).unwrap_or(0.0),
        observations: residuals.len(),
        taken_out_rms_mm,
        taken_up,
        correlated: None,
        descent,
    })
}

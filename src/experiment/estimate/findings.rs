//! What a fit has found, whatever the errors are taken to be.

use super::body::BodyError;
use super::evidence::Unexplained;
use super::mesh_error::made_up_by;
use super::process::{Factor, Process};
use super::projection::Projection;
use super::re_registration::InstrumentError;
use super::shape::ShapeFound;
use super::softest::Softest;
use super::{Descent, EstimateError, EstimateSettings};
use crate::experiment::verdict::Finding;
use crate::geometry::{Mni, RigidTransform};
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Where a descent may end that another follows, in standard deviations of the posterior.
pub(super) const ROUGH: f64 = 0.1;

/// Why there is no estimate.
#[derive(Debug, Error)]
pub enum ProblemError {
    /// The scenario or mesh is refused, or the last state cannot be solved.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The descent cannot start.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// The estimate's state cannot be registered.
    #[error("the estimate's state, registered like the post-operative scan: {0}")]
    Instrument(#[from] InstrumentError),
}

/// What a fit has found, whatever the errors are taken to be.
pub(super) struct Fitted {
    /// The minimum, of the problem's own parameters.
    pub descent: Descent,
    /// What the data alone say there.
    pub fisher: DMatrix<f64>,
    /// Standard deviation of one observation, mm.
    pub noise_mm: f64,
    /// How many observations count as independent.
    pub independent: f64,
    /// Root mean square of the residuals, mm.
    pub residual_rms_mm: f64,
    /// The same of a body that has not moved, mm.
    pub rest_rms_mm: f64,
    /// Observations.
    pub observations: usize,
    /// What was taken out of one observation, mm.
    pub taken_out_rms_mm: Option<f64>,
    /// What the rigid registration follows of the state.
    pub taken_up: Option<RigidTransform<Mni, Mni>>,
    /// What correlated errors say.
    pub correlated: Option<Findings>,
}

impl Fitted {
    /// Root mean square of what is left of an observation, and the standard deviation that it is held against, mm. Where nothing was
    /// seen to move the state is rest: what the body that was looked at leaves, at moduli that are no answer, says nothing.
    pub fn left_mm(&self, finding: Finding, settings: &EstimateSettings) -> [f64; 2] {
        match &self.correlated {
            _ if finding != Finding::NoShift => [self.residual_rms_mm, self.noise_mm],
            Some(found) => [self.rest_rms_mm, found.measured_noise.sd_mm],
            None => [self.rest_rms_mm, settings.noise_mm],
        }
    }
}

/// How probable the model is beside simpler explanations: natural logarithms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Odds {
    /// Evidence of the model with its discrepancy.
    pub log_evidence: f64,
    /// Evidence of the model were it exact.
    pub log_evidence_exact: f64,
    /// Odds of the model against a smooth movement of any kind.
    pub model_to_any_movement: f64,
    /// Odds of movement (the model's or any) against none.
    pub moved_to_still: f64,
}

/// Whether anything has moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shift {
    /// Movement is more probable than stillness by more than [`STRONG`](crate::experiment::verdict::STRONG), and larger than
    /// the measurement's noise.
    pub seen: bool,
    /// Root mean square of the displacement seen, rigid remainder taken away, mm.
    pub seen_rms_mm: f64,
    /// Share of it that the model explains; zero where nothing was seen to move.
    pub explained_share: f64,
    /// The shift, at its largest place, that would have been seen, mm: three standard deviations of its size, and more than
    /// passes for the measurement's noise. Where rigid registration follows the brain, by what is left of a movement without its
    /// rigid part, and no less than the size that what was seen does not rule out.
    pub would_be_seen_mm: f64,
    /// Where nothing was seen to move: largest size (95 %, one-sided, and no less than passes for noise) of what the prior's
    /// most probable body would do under the load, as a share of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_share: Option<f64>,
}

/// Everything that the fit says beside the parameters.
pub struct Findings {
    /// Noise and discrepancy.
    pub unexplained: Unexplained,
    /// What the measurement is worth: its noise, or what is left of it without the instrument's own error.
    pub measured_noise: Process,
    /// Model, any movement, none.
    pub odds: Odds,
    /// Size of the rigid remainder, mm.
    pub rigid_remainder_mm: f64,
    /// Where outline and falx are taken to be.
    pub shape: ShapeFound,
    /// The shift.
    pub shift: Shift,
    /// Where nothing was seen to move: how soft each parameter's tissue may be (logarithm), where that is bounded.
    pub softest: Vec<Option<Softest>>,
    /// Mean of the displacement seen, mm.
    pub seen_mean_mm: [f64; 3],
    /// The places that were looked at, mm, and their nodes.
    pub places_mm: Vec<[f64; 3]>,
    /// Their nodes.
    pub nodes: Vec<u32>,
    pub(super) factor: Factor,
    /// What the model could do of a displacement.
    pub(super) projection: Projection,
    /// The Jacobian through the projection, rigid remainder included.
    pub(super) white_jacobian: DMatrix<f64>,
    /// The prior's inverse covariance.
    pub(super) precision: DMatrix<f64>,
}

impl Findings {
    /// The change of the first `own` parameters that makes up for a change (mm) of the model at the places, row by row;
    /// `None` where none is found.
    pub fn made_up_by(&self, change_mm: impl Fn(usize) -> f64, own: usize) -> Option<Vec<f64>> {
        let rows = 3 * self.nodes.len();
        let change = DMatrix::from_fn(rows, 1, |row, _| change_mm(row));
        let white = self.projection.whiten(&change).column(0).into_owned();
        made_up_by(&self.white_jacobian, &self.precision, &white, own)
    }
}

/// Component by component, mm.
pub(super) fn differences(seen: &[(u32, [f64; 3])], corrected: &[(u32, [f64; 3])]) -> Vec<f64> {
    seen.iter().zip(corrected).flat_map(|((_, s), (_, c))| (0..3).map(move |a| s[a] - c[a])).collect()
}

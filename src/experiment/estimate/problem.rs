//! What an estimate starts from: a body, what is not known of it, and what was observed.

use super::LogPrior;
use super::body::Observation;
use super::correlated::CorrelatedErrors;
use super::re_registration::Instrument;
use super::shape::ShapeError;
use super::unknown::Unknown;
use crate::fem::Scenario;
use crate::mesh::TetMesh;

/// What is known of the errors of what was observed.
#[derive(Clone, Debug, PartialEq)]
pub enum Errors {
    /// Independent of each other but for a share (neighbours see the same error), of the descent's noise.
    Independent {
        /// Share of the observations that are independent.
        share: f64,
    },
    /// Alike over some distance, with a rigid remainder and a discrepancy of the model.
    Correlated(CorrelatedErrors),
}

/// Everything an estimate starts from.
pub struct Problem<'a> {
    /// The body at rest.
    pub mesh: &'a TetMesh,
    /// Loads, supports, solver; the materials are the unknowns'.
    pub template: &'a Scenario,
    /// What is estimated, with the prior of each logarithm in the same order.
    pub unknowns: Vec<(Unknown, LogPrior)>,
    /// Poisson's ratio of every tissue.
    pub poisson_ratio: f64,
    /// What was observed.
    pub observation: Observation,
    /// How far it is believed.
    pub errors: Errors,
    /// Standard deviation of ln(modulus) that mesh and element add; 0 for a body known exactly. Only taken where it cannot be
    /// found from a coarser mesh.
    pub model_log_sd: f64,
    /// Standard deviation of ln(modulus) that labels and supports add; 0 for a body known exactly.
    pub body_log_sd: f64,
    /// How far its shape may be off; only taken where there is a coarser mesh to find out what that does.
    pub shape: ShapeError,
    /// The same body in a coarser mesh: what mesh, element and shape add is found from it, case by case.
    pub coarser: Option<&'a TetMesh>,
    /// Whether body and load are known exactly (a phantom's): then nothing is held against what is known of tissue.
    pub body_known: bool,
    /// Where to start; the prior's mean when empty.
    pub start: Vec<f64>,
    /// The measurement behind nodes' displacements, where its own error is to be taken out, and how many times.
    pub instrument: Option<(&'a Instrument<'a>, usize)>,
}

impl<'a> Problem<'a> {
    /// A body that is known exactly, seen by an instrument whose own error stays in; from the prior's mean.
    pub fn new(
        mesh: &'a TetMesh,
        template: &'a Scenario,
        unknowns: Vec<(Unknown, LogPrior)>,
        poisson_ratio: f64,
        (observation, errors): (Observation, Errors),
    ) -> Self {
        Self {
            mesh,
            template,
            unknowns,
            poisson_ratio,
            observation,
            errors,
            model_log_sd: 0.0,
            body_log_sd: 0.0,
            shape: ShapeError::default(),
            coarser: None,
            body_known: true,
            start: Vec::new(),
            instrument: None,
        }
    }
}

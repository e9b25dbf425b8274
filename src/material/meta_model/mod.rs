//! Meta-models: simple stable laws fitted to a strain energy density curve, W(l) on the uniaxial isochoric path.
//!
//! The curves stand with their laws ([`UniaxialCurve`](crate::material::law::UniaxialCurve)). Residuals are ln(W + offset) - y, weighting each decade of energy alike, or,
//! for measured stresses, dW/dl - P.

mod curve;
mod least_squares;
mod search;

pub use crate::material::law::{Search, Stability, StabilityRange};
pub use curve::MetaModel;
pub use search::{Fit, FitError, MetaModelSettings, fit, fit_stress};

#[cfg(test)]
mod tests;

//! Meta-models: simple stable laws fitted to a strain energy density curve, W(l) on the uniaxial isochoric path.
//!
//! neo-Hookean W = mu/2 (I1 - 3); Mooney-Rivlin W = c1 (I1 - 3) + c2 (I2 - 3); Ogden W = mu/alpha S(l, alpha) with
//! S = l^alpha + 2 l^(-alpha/2) - 3. Residuals are ln(W + offset) - y, weighting each decade of energy alike, or,
//! for measured stresses, dW/dl - P.

mod curve;
mod least_squares;
mod search;
mod stability;

pub use curve::MetaModel;
pub use search::{Fit, FitError, MetaModelSettings, Search, fit, fit_stress};
pub use stability::{Stability, StabilityRange};

#[cfg(test)]
mod tests;

//! A law on the uniaxial isochoric path, where it is fitted to measured curves and to samples of the prior: a meta-model.

use super::stability::Stability;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The most parameters of a meta-model.
pub const MOST_PARAMETERS: usize = 3;

/// Derivatives by the parameters in their order; entries beyond them are zero.
pub type Slope = [f64; MOST_PARAMETERS];

/// How to search for parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Search {
    /// Exact Jacobians, tight tolerances, parameters where the law is stable at every stretch.
    #[default]
    Exact,
    /// As the published program: its bounds and starts, its tolerances, and its neo-Hookean Jacobian, which lacks the
    /// derivative of mu and leaves mu up to 3 % low.
    Published,
}

/// What starts may be chosen by.
#[derive(Clone, Copy, Debug)]
pub struct Data<'a> {
    /// The stretches of the curve.
    pub stretches: &'a [f64],
    /// The neo-Hookean shear modulus that fits the median point, Pa: the scale of the data.
    pub modulus_pa: f64,
}

/// Where a search starts and what it may not leave; infinite where there is no bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// First parameters.
    pub parameters: Vec<f64>,
    /// Lower bounds.
    pub low: Vec<f64>,
    /// Upper bounds.
    pub high: Vec<f64>,
}

impl Start {
    /// From first parameters with their bounds.
    pub fn new(parameters: &[f64], low: &[f64], high: &[f64]) -> Self {
        Self { parameters: parameters.to_vec(), low: low.to_vec(), high: high.to_vec() }
    }
}

/// A law as it is fitted: W(l) with stretches (l, l^-1/2, l^-1/2).
pub trait UniaxialCurve: Sync {
    /// The word in files and on the command line.
    fn name(&self) -> &'static str;
    /// Parameters with their units, [`MOST_PARAMETERS`] at most.
    fn parameters(&self) -> &'static [&'static str];
    /// W, Pa.
    fn energy_pa(&self, parameters: &[f64], stretch: f64) -> f64;
    /// dW / d parameters.
    fn energy_slope_pa(&self, parameters: &[f64], stretch: f64) -> Slope;
    /// Nominal stress dW/dl, Pa.
    fn stress_pa(&self, parameters: &[f64], stretch: f64) -> f64;
    /// d stress / d parameters.
    fn stress_slope_pa(&self, parameters: &[f64], stretch: f64) -> Slope;
    /// Starts of the search; the best end is taken, the first of equal ones.
    fn starts(&self, search: Search, data: &Data) -> Vec<Start>;
    /// Verdict for parameters fitted over a window, from the analytic regions.
    fn stability(&self, parameters: &[f64], window: [f64; 2]) -> Stability;
    /// The law's own numbers for these parameters.
    fn values(&self, parameters: &[f64]) -> Vec<f64>;
    /// The published program's d ln(W + offset) / d parameter, where it is not the derivative.
    fn published_slope(&self, _parameters: &[f64], _stretch: f64, _log_offset_pa: f64) -> Option<f64> {
        None
    }
}

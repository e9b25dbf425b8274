//! How a search that ended too early is told.

/// A gradient below this for each observation is flat.
pub(super) const STEEP: f64 = 1e-5;

/// The slope for each observation that a search has ended on, where it is none that is flat; one that is no number is not.
pub(super) fn left_over(gradient_norm: f64, observations: usize) -> Option<f64> {
    let slope = gradient_norm / observations.max(1) as f64;
    (slope.is_nan() || slope > STEEP).then_some(slope)
}

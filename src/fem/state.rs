//! A displacement as solves pass it on.

/// A displacement field to start from: the solution of a neighbouring problem on the same model.
#[derive(Clone, Debug)]
pub struct State {
    /// Solver numbering, m.
    pub(super) u: Vec<[f64; 3]>,
}

//! Phantom, resection, sweep, estimation: scenario in, outcome out.

pub mod estimate;
pub mod outcome;
pub mod rmse;

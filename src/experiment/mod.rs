//! Phantom, resection, sweep, estimation: scenario in, outcome out.

pub mod outcome;
pub mod rmse;

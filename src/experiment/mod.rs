//! Phantom, resection, sweep, estimation: scenario in, outcome out.

pub mod compare;
pub mod depth;
pub mod estimate;
pub mod field;
pub mod landmarks;
mod law_outcome;
mod moments;
pub mod nodal_field;
pub mod observed;
pub mod outcome;
mod person_prior;
pub mod phantom;
pub mod population;
pub mod predict;
pub mod prior;
pub mod resection;
pub mod rmse;
pub mod sample;
pub mod setting;
pub mod skull;
pub mod smooth_noise;
pub mod stuck_cortex;
pub mod supports;
pub mod sweep;
pub mod synth;
pub mod verdict;
pub mod verdict_of_samples;

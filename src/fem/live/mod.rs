//! A body that is stepped from outside, one frame at a time, with hands on it: what a live session drives.
//!
//! No second solver: the steps are those of [`super::Model::run`] and [`super::Model::solve`], taken one at a time from the
//! last frame's state, with what hands do added to the supports' part.

mod hands;
mod loads;
mod stepper;

pub use hands::{Ball, Grip};
pub use stepper::{Manner, Readout, StepReport, Stepper};

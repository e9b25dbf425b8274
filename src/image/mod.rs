//! Volumes on oriented grids: NIfTI, resampling, filtering, morphology, distance.

mod grid;
mod volume;

pub use grid::Grid;
pub use volume::{LabelMap, Mask, Volume};

//! Volumes on oriented grids: NIfTI, resampling, filtering, morphology, distance.

mod bounds;
pub mod components;
pub mod distance;
pub mod gaussian;
mod grid;
pub mod morphology;
pub mod nifti;
pub mod resample;
pub mod seg_nrrd;
mod volume;

pub use bounds::VoxelBox;
pub use grid::Grid;
pub use volume::{LabelMap, Mask, Volume};

//! Volumes on oriented grids: NIfTI, resampling, filtering, morphology, distance.

mod blank_slices;
pub mod blocks;
mod bounds;
pub mod components;
pub mod distance;
pub mod gaussian;
mod grid;
pub mod morphology;
mod near_distance;
pub mod nifti;
mod padding;
pub(crate) mod pieces;
pub mod resample;
mod sampling;
pub mod seg_nrrd;
mod spline;
mod volume;

pub use blank_slices::{BlankSlices, blank_slices, with_filled};
pub use bounds::VoxelBox;
pub use grid::Grid;
pub use padding::{Padding, padding};
pub use sampling::coprime_stride;
pub use volume::{LabelMap, Mask, Volume};

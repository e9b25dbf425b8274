//! The frame that a synthetic patient's anatomy is in.

use crate::geometry::Frame;
use crate::image::Grid;
use nalgebra::Point3;

/// The patient's own frame, near the template's: what both scanners' frames are poses of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patient;

impl Frame for Patient {
    const NAME: &'static str = "patient";
}

/// Centre of voxel number `n`.
pub fn centre<F: Frame>(grid: &Grid<F>, n: usize) -> Point3<f64> {
    grid.centre(grid.voxel(n)).mm
}

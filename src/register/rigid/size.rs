//! Whether two scans of one head have it in one size: a wrong voxel size or slice spacing in one header shows as a stretch.

use super::side::Side;
use crate::geometry::Native;
use crate::image::Grid;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// How much longer one head is in the fixed image than in the moving one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RelativeSize {
    /// Where the voxel axes i, j and k of the moving image run in the head, as its header says.
    pub along: [&'static str; 3],
    /// How much longer the fixed image's head is along each of them, percent.
    pub longer_percent: [f64; 3],
}

impl RelativeSize {
    /// Of the linear part that takes the moving image's mm to the fixed one's.
    pub(super) fn of(fixed_from_moving: &Matrix3<f64>, moving: &Side) -> Self {
        let axes = axes(&moving.image.grid);
        Self {
            along: axes.map(|axis| in_words(&axis)),
            longer_percent: axes.map(|axis| 100.0 * ((fixed_from_moving * axis).norm() - 1.0)),
        }
    }

    /// The axis along which the sizes differ most.
    pub fn worst(&self) -> usize {
        let far = |axis: &usize| self.longer_percent[*axis].abs();
        (0..3).rev().max_by(|a, b| far(a).total_cmp(&far(b))).unwrap_or(0)
    }
}

/// Directions of the voxel axes.
fn axes(grid: &Grid<Native>) -> [Vector3<f64>; 3] {
    [0, 1, 2].map(|axis| grid.mm_from_voxel.fixed_view::<3, 1>(0, axis).normalize())
}

fn in_words(axis: &Vector3<f64>) -> &'static str {
    ["left to right", "back to front", "feet to head"][axis.iamax()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Volume;

    #[test]
    fn a_stretch_is_told_along_the_axis_it_is_along_whatever_the_turn() {
        let grid = Grid::<Native>::axis_aligned([8; 3], [1.0, 1.0, 3.0], [0.0; 3]);
        let moving = Side { image: Volume::filled(grid, 0.0), mask: None };
        let turn = *nalgebra::Rotation3::from_euler_angles(0.3, -0.2, 0.5).matrix();
        let stretched = turn * Matrix3::from_diagonal(&Vector3::new(1.0, 0.99, 1.06));
        let found = RelativeSize::of(&stretched, &moving);
        assert_eq!((found.worst(), found.along[found.worst()]), (2, "feet to head"));
        for (found, made) in found.longer_percent.into_iter().zip([0.0, -1.0, 6.0]) {
            assert!((found - made).abs() < 1e-9);
        }
    }
}

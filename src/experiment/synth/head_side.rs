//! Sides of the head by name, and the axes of a scan that run towards them.

use crate::geometry::Frame;
use crate::image::Grid;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A side of the head.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum HeadSide {
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
    /// The face.
    Front,
    /// The back of the head.
    Back,
    /// The vertex.
    Top,
    /// The neck.
    Bottom,
}

impl HeadSide {
    /// Which way it lies in the head, of length 1.
    pub(super) fn direction(self) -> Vector3<f64> {
        match self {
            Self::Left => -Vector3::x(),
            Self::Right => Vector3::x(),
            Self::Front => Vector3::y(),
            Self::Back => -Vector3::y(),
            Self::Top => Vector3::z(),
            Self::Bottom => -Vector3::z(),
        }
    }
}

/// The grid's axis that runs most nearly along a direction, and whether it runs that way.
pub(super) fn axis_along<F: Frame>(grid: &Grid<F>, direction: &Vector3<f64>) -> (usize, bool) {
    let along = |a: usize| grid.mm_from_voxel.fixed_view::<3, 1>(0, a).normalize().dot(direction);
    let axis = (0..3).fold(0, |best, a| if along(a).abs() > along(best).abs() { a } else { best });
    (axis, along(axis) > 0.0)
}

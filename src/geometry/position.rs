//! Points and directions that know their frame.

use super::frame::Frame;
use nalgebra::{Point3, Vector3};
use std::marker::PhantomData;

/// A point in frame `F`, in mm, RAS+.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position<F: Frame> {
    /// The coordinates in mm.
    pub mm: Point3<f64>,
    frame: PhantomData<F>,
}

/// A difference of two points of frame `F`, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction<F: Frame> {
    /// The components in mm.
    pub mm: Vector3<f64>,
    frame: PhantomData<F>,
}

impl<F: Frame> Position<F> {
    /// The point with these coordinates in mm.
    pub fn new(x: f64, y: f64, z: f64) -> Self {
        Self::from_point(Point3::new(x, y, z))
    }

    /// The point with these coordinates in mm.
    pub fn from_point(mm: Point3<f64>) -> Self {
        Self { mm, frame: PhantomData }
    }

    /// Distance in mm.
    pub fn distance_mm(&self, other: &Self) -> f64 {
        (self.mm - other.mm).norm()
    }
}

impl<F: Frame> Direction<F> {
    /// The direction with these components in mm.
    pub fn new(x: f64, y: f64, z: f64) -> Self {
        Self { mm: Vector3::new(x, y, z), frame: PhantomData }
    }
}

impl<F: Frame> std::ops::Sub for Position<F> {
    type Output = Direction<F>;
    fn sub(self, other: Self) -> Direction<F> {
        Direction { mm: self.mm - other.mm, frame: PhantomData }
    }
}

impl<F: Frame> std::ops::Add<Direction<F>> for Position<F> {
    type Output = Self;
    fn add(self, step: Direction<F>) -> Self {
        Self::from_point(self.mm + step.mm)
    }
}

//! A sheet in the plane x = 0 of the frame, between the left and right halves of labels.

use super::line_height;
use nalgebra::{Matrix4, Vector3};

/// Where a mesh conforms to the midplane though no label ends there: the falx.
///
/// A sheet that ends inside the tissue cannot be the border between two fields. So the halves meet all over the midplane, but
/// below the free edge their border is *loose*: vertices may leave the plane, and it counts for nothing in the end.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sheet {
    pub frame_from_box: Matrix4<f64>,
    /// Bit k: field k is a left half.
    pub left: u64,
    /// Bit k: field k is a right half.
    pub right: u64,
    /// Free edge as (y, z) from front to back, mm: the border is loose below. Without points it is loose nowhere.
    pub above_yz_mm: Vec<[f64; 2]>,
}

/// The sheet stays fixed to this depth below the free edge, so that the edge itself lies in the plane, mm.
const HEM_MM: f64 = 2.0;

impl Sheet {
    /// Whether fields `a` and `b` are halves on either side of the midplane.
    #[inline]
    pub fn crosses(&self, a: u8, b: u8) -> bool {
        let sides = |a: u8, b: u8| self.left >> a & 1 == 1 && self.right >> b & 1 == 1;
        sides(a, b) || sides(b, a)
    }

    /// Whether the facet between fields `a` and `b` around `centre` (box, mm) is a border that counts for nothing.
    #[inline]
    pub fn is_loose(&self, a: u8, b: u8, centre: &Vector3<f64>) -> bool {
        if self.above_yz_mm.is_empty() || !self.crosses(a, b) {
            return false;
        }
        let p = self.frame_from_box.transform_point(&(*centre).into());
        p.z < line_height(&self.above_yz_mm, p.y) - HEM_MM
    }

    /// The x coordinate in the frame of a point of the box, mm.
    pub fn distance_mm(&self, p: &Vector3<f64>) -> f64 {
        self.frame_from_box.transform_point(&(*p).into()).x
    }

    /// Unit vector of the box along x of the frame.
    pub fn normal(&self) -> Vector3<f64> {
        self.frame_from_box.fixed_view::<1, 3>(0, 0).transpose().normalize()
    }
}

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

/// The field that has the place among the bits of `other` that `field` has among those of `own`: halves are numbered in the
/// order of their labels.
fn same_place(own: u64, field: u8, other: u64) -> u8 {
    let place = (own & ((1 << field) - 1)).count_ones();
    let mut fields = (0..64).filter(|k| other >> k & 1 == 1);
    fields.nth(place as usize).unwrap_or(field)
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
        self.crosses(a, b) && self.is_below(centre)
    }

    /// Whether a point of the box is below the free edge and its hem.
    pub fn is_below(&self, point: &Vector3<f64>) -> bool {
        if self.above_yz_mm.is_empty() {
            return false;
        }
        let p = self.frame_from_box.transform_point(&(*point).into());
        p.z < line_height(&self.above_yz_mm, p.y) - HEM_MM
    }

    /// Whether a field is half of a split label.
    pub fn is_half(&self, field: u8) -> bool {
        field < 64 && (self.left | self.right) >> field & 1 == 1
    }

    /// The half of a field's label at this distance from the midplane; a field that is no half itself.
    pub fn on_side(&self, field: u8, distance_mm: f64) -> u8 {
        if !self.is_half(field) {
            return field;
        }
        let (own, other) = if self.left >> field & 1 == 1 { (self.left, self.right) } else { (self.right, self.left) };
        let is_there = (own == self.left) == (distance_mm < 0.0);
        if is_there { field } else { same_place(own, field, other) }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_finds_the_other_half_of_its_label() {
        let sheet =
            Sheet { frame_from_box: Matrix4::identity(), left: 0b110, right: 0b11_0000, above_yz_mm: Vec::new() };
        for (left, right) in [(1, 4), (2, 5)] {
            assert_eq!([left, right].map(|k| sheet.on_side(k, -1.0)), [left; 2]);
            assert_eq!([left, right].map(|k| sheet.on_side(k, 1.0)), [right; 2]);
        }
        assert_eq!([0, 3, u8::MAX].map(|k| sheet.on_side(k, 1.0)), [0, 3, u8::MAX]);
    }
}

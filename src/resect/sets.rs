//! Masks of one grid as sets.

use crate::geometry::Mni;
use crate::image::Mask;

pub(super) fn both(a: &Mask<Mni>, b: &Mask<Mni>) -> Mask<Mni> {
    Mask::from_fn(a.grid, |n| a.data[n] && b.data[n])
}

pub(super) fn either(a: &Mask<Mni>, b: &Mask<Mni>) -> Mask<Mni> {
    Mask::from_fn(a.grid, |n| a.data[n] || b.data[n])
}

pub(super) fn without(a: &Mask<Mni>, b: &Mask<Mni>) -> Mask<Mni> {
    Mask::from_fn(a.grid, |n| a.data[n] && !b.data[n])
}

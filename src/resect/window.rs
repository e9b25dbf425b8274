//! Means over a neighbourhood.

use crate::geometry::Mni;
use crate::image::gaussian::gaussian;
use crate::image::{Mask, Volume};

/// Means over Gaussian windows that do not look over the edge of a mask.
pub(super) struct Window<'a> {
    inside: &'a Mask<Mni>,
    weight: Volume<f32, Mni>,
    sigma_mm: f64,
}

impl<'a> Window<'a> {
    pub fn new(inside: &'a Mask<Mni>, sigma_mm: f64) -> Self {
        Self { inside, weight: gaussian(&inside.map(f32::from), sigma_mm), sigma_mm }
    }

    pub fn mean(&self, image: &Volume<f32, Mni>) -> Volume<f32, Mni> {
        let masked = Volume::from_fn(image.grid, |n| if self.inside.data[n] { image.data[n] } else { 0.0 });
        let sum = gaussian(&masked, self.sigma_mm);
        Volume::from_fn(image.grid, |n| sum.data[n] / self.weight.data[n].max(1e-3))
    }
}

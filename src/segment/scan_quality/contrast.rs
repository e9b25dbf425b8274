//! Grey against white matter: how far apart they are, over how much they vary.

use super::super::label;
use super::block::Blocks;
use super::gain::WhiteGain;
use crate::geometry::Frame;
use crate::image::{LabelMap, Volume};
use rayon::prelude::*;

/// A neighbour farther than this says nothing of whether a voxel is at the border.
const NEAR_MM: f64 = 2.5;
/// Fewer voxels than this say nothing of a tissue.
const LEAST: f64 = 500.0;

/// Number, sum and sum of squares of intensities.
#[derive(Clone, Copy, Default)]
struct Moments([f64; 3]);

impl Moments {
    fn add(&mut self, x: f64) {
        self.0[0] += 1.0;
        self.0[1] += x;
        self.0[2] += x * x;
    }

    fn and(self, other: Self) -> Self {
        Self([0, 1, 2].map(|m| self.0[m] + other.0[m]))
    }

    fn mean(self) -> f64 {
        self.0[1] / self.0[0].max(1.0)
    }

    fn variance(self) -> f64 {
        (self.0[2] / self.0[0].max(1.0) - self.mean().powi(2)).max(0.0)
    }

    fn is_enough(self) -> bool {
        self.0[0] >= LEAST
    }
}

/// Intensities of grey and white matter without the coil's gain.
pub(super) struct Tissues {
    grey: Moments,
    /// All of it.
    white: Moments,
    /// Away from its border.
    deep_white: Moments,
}

impl Tissues {
    /// `air_deviation`: standard deviation of the air's noise, in the scan's units; 0 where it is not known.
    pub fn contrast_to_noise(&self, air_deviation: f64) -> Option<f64> {
        let white = self.white_matter()?;
        let spread = (white.variance() + self.grey.variance() + air_deviation.powi(2)).sqrt();
        (self.grey.is_enough() && spread > 0.0).then(|| (white.mean() - self.grey.mean()).abs() / spread)
    }

    /// Mean over standard deviation.
    pub fn white_signal_to_noise(&self) -> Option<f64> {
        let white = self.white_matter()?;
        (white.variance() > 0.0).then(|| white.mean() / white.variance().sqrt())
    }

    /// Away from the border, or all of it where voxels are too large for that.
    fn white_matter(&self) -> Option<Moments> {
        [self.deep_white, self.white].into_iter().find(|white| white.is_enough())
    }

    fn and(self, other: &Self) -> Self {
        Self {
            grey: self.grey.and(other.grey),
            white: self.white.and(other.white),
            deep_white: self.deep_white.and(other.deep_white),
        }
    }
}

/// Slice by slice, then the slices in their order. Voxels of 0 are blank: of lost slices, of a mask.
pub(super) fn tissues<F: Frame>(
    t1: &Volume<f32, F>,
    labels: &LabelMap<F>,
    gain: &WhiteGain<F>,
    blocks: &Blocks<F>,
) -> Tissues {
    let none = || Tissues { grey: Moments::default(), white: Moments::default(), deep_white: Moments::default() };
    let of_slice = |k: usize| {
        let mut found = none();
        for j in 0..t1.grid.dims[1] {
            for i in 0..t1.grid.dims[0] {
                let n = t1.grid.index(i, j, k);
                let (own, value) = (labels.data[n], t1.data[n]);
                if !(own == label::GREY_MATTER || own == label::WHITE_MATTER) || value <= 0.0 {
                    continue;
                }
                let flat = f64::from(value / gain.over_mean.data[blocks.place([i, j, k])]);
                if own == label::GREY_MATTER {
                    found.grey.add(flat);
                    continue;
                }
                found.white.add(flat);
                if is_deep(labels, [i, j, k]) {
                    found.deep_white.add(flat);
                }
            }
        }
        found
    };
    let slices: Vec<Tissues> = (0..t1.grid.dims[2]).into_par_iter().map(of_slice).collect();
    slices.iter().fold(none(), Tissues::and)
}

/// Whether all neighbours over faces that are near have the voxel's label.
fn is_deep<F: Frame>(labels: &LabelMap<F>, [i, j, k]: [usize; 3]) -> bool {
    let (own, voxel) = (labels.at(i, j, k), [i, j, k].map(|v| v as isize));
    let spacing = labels.grid.spacing_mm();
    (0..3).filter(|a| spacing[*a] <= NEAR_MM).all(|a| {
        [-1, 1].into_iter().all(|step| {
            let mut at = voxel;
            at[a] += step;
            labels.get(at[0], at[1], at[2]) == Some(own)
        })
    })
}

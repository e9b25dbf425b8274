//! The coil's gain as white matter shows it.

use super::super::label;
use super::block::Blocks;
use crate::geometry::Frame;
use crate::image::gaussian::gaussian;
use crate::image::{LabelMap, Volume};

/// White matter is averaged over this (standard deviation): narrower than a coil's gain changes, for at the border of white
/// matter the average is the gain about as far inside.
const SIGMA_MM: f64 = 6.0;
/// Blocks with this share of white matter count for the range.
const MUCH_WHITE: f32 = 0.5;
/// Weight of the mean gain, over the largest weight of a neighbourhood: where no white matter is near, the gain is the mean one.
const FLOOR: f32 = 1e-3;

/// White matter's brightness over the scan.
pub(super) struct WhiteGain<F: Frame> {
    /// Over the mean one, on the grid of blocks.
    pub over_mean: Volume<f32, F>,
    /// Mean brightness of white matter, in the scan's units.
    pub mean: f64,
    /// Brightest over darkest part.
    pub times: f64,
}

/// `None` without white matter.
pub(super) fn white_gain<F: Frame>(
    t1: &Volume<f32, F>,
    labels: &LabelMap<F>,
    blocks: &Blocks<F>,
) -> Option<WhiteGain<F>> {
    let white = |n: usize| labels.data[n] == label::WHITE_MATTER && t1.data[n] > 0.0;
    let share = blocks.means(|n| f32::from(u8::from(white(n))));
    let bright = blocks.means(|n| if white(n) { t1.data[n] } else { 0.0 });
    let sum = |v: &Volume<f32, F>| v.data.iter().map(|&x| f64::from(x)).sum::<f64>();
    let mean = sum(&bright) / sum(&share);
    if !(mean.is_finite() && mean > 0.0) {
        return None;
    }
    let (near, seen) = (gaussian(&share, SIGMA_MM), gaussian(&bright, SIGMA_MM));
    let floor = FLOOR * near.data.iter().copied().fold(0.0, f32::max);
    let over_mean = Volume::from_fn(share.grid, |n| {
        (seen.data[n] / mean as f32 + floor) / (near.data[n] + floor).max(f32::MIN_POSITIVE)
    });
    let within = over_mean.data.iter().zip(&share.data).filter(|(_, share)| **share >= MUCH_WHITE);
    let mut gains: Vec<f32> = within.map(|(gain, _)| *gain).collect();
    gains.sort_unstable_by(f32::total_cmp);
    let last = gains.len().checked_sub(1)?;
    let at = |q: f64| f64::from(gains[(q * last as f64).round() as usize]);
    Some(WhiteGain { over_mean, mean, times: at(0.98) / at(0.02) })
}

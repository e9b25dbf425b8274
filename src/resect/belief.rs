//! Whether what looks like a cavity is one: its depth, its folds and where it lies have to make sense.

use super::cavity_pair::CavityPair;
use super::sets::both;
use super::window::Window;
use crate::geometry::Mni;
use crate::image::distance::distance_mm;
use crate::image::{Mask, Volume, VoxelBox};
use crate::segment::label;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a candidate shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Its seed: dark now, tissue before, deep enough, cc.
    pub seed_cc: f64,
    /// Loss of intensity over that from tissue to fluid; 1 where fluid has taken the place of grey matter.
    pub loss: f64,
    /// Median correlation with the folds that were there; `None` where there were none to speak of.
    pub folds_kept: Option<f64>,
    /// Share of its surface that touches the ventricles as they were before.
    pub at_ventricle: f64,
    /// Radius of the largest ball in it, mm.
    pub radius_mm: f64,
}

/// Why a candidate is no cavity.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum Doubt {
    /// The pattern of folds is still there.
    #[error("its folds are still there (correlation {correlation:.2}): the scans differ in brightness, not in tissue")]
    FoldsKept {
        /// See [`Evidence::folds_kept`].
        correlation: f64,
    },
    /// It has hardly become darker.
    #[error("it has lost {percent:.0} % of the contrast between tissue and fluid: oedema or shading, not a hole")]
    LittleLoss {
        /// See [`Evidence::loss`].
        percent: f64,
    },
    /// A rim around the ventricles.
    #[error("it is a layer of {radius_mm:.1} mm on the ventricles: they have grown")]
    Ventricle {
        /// See [`Evidence::radius_mm`].
        radius_mm: f64,
    },
}

/// Correlation above which the folds are still there.
const FOLDS_KEPT: f64 = 0.6;
/// Loss below which nothing was taken out.
const LEAST_LOSS: f64 = 0.5;
/// A candidate with this share of its surface at the ventricles and no thicker than [`LAYER_MM`] is their growth.
const AT_VENTRICLE: f64 = 0.3;
pub(super) const LAYER_MM: f64 = 4.0;
/// Windows reach this far, mm.
const MARGIN_MM: f64 = 9.0;
/// Windows in which the folds of both scans are compared, standard deviation in mm.
const WINDOW_MM: f64 = 2.5;

impl Evidence {
    /// What a seed shows.
    pub(super) fn of(seed: &Mask<Mni>, pair: &CavityPair<'_>) -> Self {
        let whole = VoxelBox { first: [0; 3], end: seed.grid.dims };
        let near = seed.bounding_box().map_or(whole, |found| found.grown(&seed.grid, MARGIN_MM));
        let inside = seed.cropped(&near);
        let (pre, post) = (pair.pre.cropped(&near), pair.post.cropped(&near));
        let labels = pair.pre_labels.cropped(&near);
        let at = |n: &usize| inside.data[*n];
        let loss: Vec<f64> = (0..inside.data.len())
            .filter(at)
            .map(|n| f64::from(pre.data[n] - post.data[n]) / (2.0 * (pair.grey_mean - pair.csf_grey_border)).max(1e-6))
            .collect();

        let comparable = both(&pair.pre_brain.cropped(&near), &pair.post_known.cropped(&near));
        let window = Window::new(&comparable, WINDOW_MM);
        let product = |x: &Volume<f32, Mni>, y: &Volume<f32, Mni>| Volume::from_fn(x.grid, |n| x.data[n] * y.data[n]);
        let (mean_a, mean_b) = (window.mean(&pre), window.mean(&post));
        let (aa, bb, ab) = (
            window.mean(&product(&pre, &pre)),
            window.mean(&product(&post, &post)),
            window.mean(&product(&pre, &post)),
        );
        let least = (pair.grey_white_contrast / 6.0).powi(2) as f32;
        let folds: Vec<f64> = (0..inside.data.len())
            .filter(at)
            .filter_map(|n| {
                let var_a = aa.data[n] - mean_a.data[n] * mean_a.data[n];
                let var_b = (bb.data[n] - mean_b.data[n] * mean_b.data[n]).max(0.1 * least);
                let covariance = ab.data[n] - mean_a.data[n] * mean_b.data[n];
                (var_a > least).then(|| f64::from(covariance / (var_a * var_b).sqrt()))
            })
            .collect();
        let enough = 5 * folds.len() >= inside.count();

        let ventricle = labels.map(|l| l == label::VENTRICLE);
        let (to_outside, to_ventricle) = (distance_mm(&inside.map(|x| !x)), distance_mm(&ventricle));
        let voxel_mm = seed.grid.spacing_mm().into_iter().fold(0.0, f64::max) as f32;
        let is_surface = |n: &usize| to_outside.data[*n] < 1.1 * voxel_mm;
        let surface: Vec<usize> = (0..inside.data.len()).filter(at).filter(is_surface).collect();
        let touching =
            surface.iter().filter(|&&n| ventricle.count() > 0 && to_ventricle.data[n] < 2.1 * voxel_mm).count();
        Self {
            seed_cc: seed.volume_cc(),
            loss: median(loss).unwrap_or(0.0),
            folds_kept: if enough { median(folds) } else { None },
            at_ventricle: touching as f64 / surface.len().max(1) as f64,
            radius_mm: f64::from(to_outside.data.iter().copied().fold(0f32, f32::max)),
        }
    }

    /// The first reason not to believe it.
    pub fn doubt(&self) -> Option<Doubt> {
        match self.folds_kept {
            Some(correlation) if correlation > FOLDS_KEPT => return Some(Doubt::FoldsKept { correlation }),
            _ => {}
        }
        if self.loss < LEAST_LOSS {
            return Some(Doubt::LittleLoss { percent: 100.0 * self.loss.max(0.0) });
        }
        (self.at_ventricle > AT_VENTRICLE && self.radius_mm < LAYER_MM)
            .then_some(Doubt::Ventricle { radius_mm: self.radius_mm })
    }
}

pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

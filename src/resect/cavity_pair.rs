//! What a cavity is looked for in.

use crate::geometry::Mni;
use crate::image::{LabelMap, Mask, Volume};

/// Both scans on one grid, reached rigidly.
#[derive(Clone, Copy, Debug)]
pub struct CavityPair<'a> {
    /// Pre-operative intensities.
    pub pre: &'a Volume<f32, Mni>,
    /// Pre-operative labels (`segment::label`).
    pub pre_labels: &'a LabelMap<Mni>,
    /// Pre-operative brain.
    pub pre_brain: &'a Mask<Mni>,
    /// Post-operative intensities on the pre-operative scale ([`super::on_the_scale_of`]).
    pub post: &'a Volume<f32, Mni>,
    /// Where the post-operative scan looked: elsewhere is unknown, never cavity.
    pub post_known: &'a Mask<Mni>,
    /// Intensity between CSF and grey matter on the pre-operative scale.
    pub csf_grey_border: f64,
    /// Mean intensity of grey matter on the pre-operative scale.
    pub grey_mean: f64,
    /// White matter's mean intensity less grey matter's.
    pub grey_white_contrast: f64,
}

/// Two scans of a made head.
#[cfg(test)]
pub(super) struct MadePair {
    pub pre: Volume<f32, Mni>,
    pub labels: LabelMap<Mni>,
    pub brain: Mask<Mni>,
    pub post: Volume<f32, Mni>,
    /// What was taken out.
    pub gone: Mask<Mni>,
}

#[cfg(test)]
impl MadePair {
    /// Fluid of 25, tissue around 100.
    pub fn pair<'a>(&'a self, known: &'a Mask<Mni>) -> CavityPair<'a> {
        CavityPair {
            pre: &self.pre,
            pre_labels: &self.labels,
            pre_brain: &self.brain,
            post: &self.post,
            post_known: known,
            csf_grey_border: 60.0,
            grey_mean: 100.0,
            grey_white_contrast: 30.0,
        }
    }
}

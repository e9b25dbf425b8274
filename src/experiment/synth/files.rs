//! A synthetic patient as files.

use super::SyntheticPatient;
use crate::image::nifti::{encode_i16, encode_mask, encode_u8, encode_vectors};
use crate::register::transform_text;

/// Every file that a patient may have, by its path below the output folder.
pub const FILES: [&str; 16] = [
    "pre.nii.gz",
    "post.nii.gz",
    "truth/T_pre2post.txt",
    "truth/brain_pre.nii.gz",
    "truth/brain_post.nii.gz",
    "truth/tissue_pre.nii.gz",
    "truth/ventricles_pre.nii.gz",
    "truth/ventricles_post.nii.gz",
    "truth/resected_pre.nii.gz",
    "truth/cavity_post.nii.gz",
    "truth/displacement_pre.nii.gz",
    "truth/landmarks_pre.csv",
    "truth/landmarks_post.csv",
    "truth/truth.json",
    "truth/old_lesion_pre.nii.gz",
    "truth/old_lesion_post.nii.gz",
];

impl SyntheticPatient {
    /// The [`FILES`] of this one: the two scans and the truth, with the old lesion's where there is one.
    ///
    /// # Panics
    /// Never: the truth is plain data.
    pub fn files(&self) -> Vec<(String, Vec<u8>)> {
        let json = serde_json::to_string_pretty(&self.truth).expect("the truth is plain data") + "\n";
        let [before, after] = self.landmark_tables();
        let transform = transform_text::to_matrix_text(&self.post_from_pre);
        // In the order of their names.
        let bytes = [
            Some(encode_i16(&self.pre)),
            Some(encode_i16(&self.post)),
            Some(transform.into_bytes()),
            Some(encode_mask(&self.brain_pre)),
            Some(encode_mask(&self.brain_post)),
            Some(encode_u8(&self.tissue_pre)),
            Some(encode_mask(&self.ventricles_pre)),
            Some(encode_mask(&self.ventricles_post)),
            Some(encode_mask(&self.resected_pre)),
            Some(encode_mask(&self.cavity_post)),
            Some(encode_vectors(&self.displacement_pre)),
            Some(before),
            Some(after),
            Some(json.into_bytes()),
            self.old_lesion_pre.as_ref().map(encode_mask),
            self.old_lesion_post.as_ref().map(encode_mask),
        ];
        FILES.into_iter().zip(bytes).filter_map(|(name, bytes)| Some((name.to_owned(), bytes?))).collect()
    }
}

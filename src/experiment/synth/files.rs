//! A synthetic patient as files.

use super::SyntheticPatient;
use crate::image::nifti::{encode_i16, encode_mask, encode_u8, encode_vectors};
use crate::register::transform_text;

impl SyntheticPatient {
    /// Every file by its path below the output folder: `pre.nii.gz`, `post.nii.gz` and the truth, with the old lesion's where there is one.
    ///
    /// # Panics
    /// Never: the truth is plain data.
    pub fn files(&self) -> Vec<(String, Vec<u8>)> {
        let json = serde_json::to_string_pretty(&self.truth).expect("the truth is plain data") + "\n";
        let [before, after] = self.landmark_tables();
        let transform = transform_text::to_matrix_text(&self.post_from_pre);
        let lesion = [
            self.old_lesion_pre.as_ref().map(|mask| ("truth/old_lesion_pre.nii.gz", encode_mask(mask))),
            self.old_lesion_post.as_ref().map(|mask| ("truth/old_lesion_post.nii.gz", encode_mask(mask))),
        ];
        [
            ("pre.nii.gz", encode_i16(&self.pre)),
            ("post.nii.gz", encode_i16(&self.post)),
            ("truth/T_pre2post.txt", transform.into_bytes()),
            ("truth/brain_pre.nii.gz", encode_mask(&self.brain_pre)),
            ("truth/brain_post.nii.gz", encode_mask(&self.brain_post)),
            ("truth/tissue_pre.nii.gz", encode_u8(&self.tissue_pre)),
            ("truth/ventricles_pre.nii.gz", encode_mask(&self.ventricles_pre)),
            ("truth/ventricles_post.nii.gz", encode_mask(&self.ventricles_post)),
            ("truth/resected_pre.nii.gz", encode_mask(&self.resected_pre)),
            ("truth/cavity_post.nii.gz", encode_mask(&self.cavity_post)),
            ("truth/displacement_pre.nii.gz", encode_vectors(&self.displacement_pre)),
            ("truth/landmarks_pre.csv", before),
            ("truth/landmarks_post.csv", after),
            ("truth/truth.json", json.into_bytes()),
        ]
        .into_iter()
        .chain(lesion.into_iter().flatten())
        .map(|(name, bytes)| (name.to_owned(), bytes))
        .collect()
    }
}

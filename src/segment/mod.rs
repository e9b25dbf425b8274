//! T1 volume to label map: grey, white, ventricle, other CSF; brain mask.

pub mod atlas;
mod atlas_labels;
pub mod label;

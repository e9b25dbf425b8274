//! T1 volume to label map: grey, white, ventricle, other CSF; brain mask.

pub mod label;

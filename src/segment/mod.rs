//! T1 volume to label map: grey, white, ventricle, other CSF; brain mask.

mod appearance;
pub mod atlas;
mod atlas_labels;
mod bias;
mod brain;
mod carried;
pub mod label;
mod mixture;
pub mod native;
mod priors;
mod segmentation;
mod sulci;
mod ventricle;

pub use bias::LogBias;
pub use brain::BrainSettings;
pub use carried::{HeadError, carried_priors, fit_template, pose_of_head, segment_head};
pub use priors::AtlasPriors;
pub use segmentation::{
    SegmentError, SegmentOverrides, SegmentSettings, SegmentWarning, Segmentation, TissueVolumes, segment_t1,
    segment_with_priors,
};
pub use sulci::with_closed_sulci;
pub use ventricle::VentricleSettings;

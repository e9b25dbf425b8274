//! T1 volume to label map: grey, white, ventricle, other CSF; brain mask.

mod agreement;
mod appearance;
pub mod atlas;
mod atlas_labels;
mod bias;
mod border;
mod brain;
mod brain_source;
mod carried;
mod cerebellum;
mod coil;
mod confidence;
mod coverage;
mod folia;
mod import;
mod labelled;
mod mixture;
pub mod native;
mod noise;
mod overhang;
mod posed_scan;
mod priors;
mod region;
mod scan_quality;
mod segmentation;
mod sulci;
mod turned;
mod ventricle;
mod warning;

pub use crate::anatomy::label;
pub use agreement::{Disagreement, disagreement};
pub use bias::LogBias;
pub use brain::BrainSettings;
pub use brain_source::BrainSource;
pub use carried::{
    HeadError, carried_priors, fit_template, pose_of_head, pose_of_head_from, segment_head, without_gaps,
};
pub use confidence::RegionEvidence;
pub use coverage::LeftOut;
pub use import::{ImportError, ImportedLabels, import_labels};
pub use labelled::{Scale, fit_template_to_labels, pose_of_labels, segment_by_labels};
pub use overhang::VaultPart;
pub use posed_scan::PosedScan;
pub use priors::AtlasPriors;
pub use region::Region;
pub use scan_quality::{Air, RegionQuality, ScanQualities, ScanQuality, scan_quality};
pub use segmentation::{
    SegmentError, SegmentOverrides, SegmentSettings, Segmentation, TissueVolumes, segment_t1, segment_with_priors,
};
pub use sulci::{SULCUS_MM, closed_sulci, inside_of_cortex, with_closed_sulci};
pub use ventricle::VentricleSettings;
pub use warning::SegmentWarning;

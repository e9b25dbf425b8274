//! Rigid (and deformable where segmentation needs it) registration.

mod affine;
mod bfgs;
mod bspline;
pub mod deformable;
mod gain;
mod head;
mod mutual_information;
mod normalised;
mod pyramid;
mod rigid;
mod sample;
mod search;
#[cfg(test)]
mod synthetic_head;
pub mod transform_text;
mod two_scans;
mod whole_head;

pub use affine::subject_from_mean_head;
pub use gain::without_gain;
pub use rigid::{
    FitQuality, FitWarning, RegisterError, RelativeSize, RigidFit, RigidMasks, RigidSettings, register_rigid,
};
pub use two_scans::{register_two_scans, register_two_scans_near};
pub use whole_head::{MeanHead, register_to_mean_head, register_to_mean_head_from};

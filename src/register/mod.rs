//! Rigid (and deformable where segmentation needs it) registration.

mod bfgs;
mod bspline;
mod head;
mod mutual_information;
mod pyramid;
mod rigid;
mod sample;
mod search;
pub mod transform_text;

pub use rigid::{
    FitQuality, FitWarning, RegisterError, RigidFit, RigidMasks, RigidSettings, register_rigid, register_to_template,
};

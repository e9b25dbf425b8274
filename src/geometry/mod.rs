//! Positions, directions, frames, rigid and affine transforms.
//!
//! A frame is a type: a [`Position<Mni>`](Position) cannot be handed to a function that expects a
//! `Position<Pre>`. All coordinates are millimetres, RAS+ (x to the patient's right, y anterior, z superior).
//! A transform that maps points of frame `From` to frame `To` is named `to_from_from`, for example `mni_from_pre`.

mod affine;
mod frame;
mod position;
mod rigid;
mod smooth_field;

pub use affine::{AffineTransform, SingularAffine};
pub use frame::{Frame, Mni, Native, Post, Pre};
pub use position::{Direction, Position};
pub use rigid::{NotRigid, RigidTransform, nearest_rotation};
pub use smooth_field::{FieldPoint, SmoothField};

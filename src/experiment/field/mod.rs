//! Displacement fields: how far every point of a scan has moved, its inverse, and where either is to be believed.
//!
//! Inside the tetrahedra the field is the finite elements' own; around them, through the fluid to the skull, a harmonic
//! continuation brings it to zero. The resected tissue moves nowhere: the continuation runs through it, so that the map is
//! smooth and can be inverted, and the mask says that nothing is known there.

mod carry;
mod explained;
mod fused;
mod harmonic;
mod inverse;
mod jacobian;
mod outcome;
mod raster;
mod settings;
mod shift;
mod vectors;

pub use carry::{Between, looks_like_labels, seen_through};
pub use explained::{Explained, explained};
pub use fused::{Fused, Left, fused};
pub use harmonic::{Place, continued};
pub use inverse::inverse;
pub use jacobian::{Mended, jacobian_min, mended};
pub use outcome::{BrainShift, Discrepancy, StateShift};
pub use raster::{InTetrahedra, in_tetrahedra, of_voxels};
pub use settings::{FieldSettings, Source};
pub use shift::{Moved, ShiftField, Surroundings, shift_field};
pub use vectors::{at, carried};

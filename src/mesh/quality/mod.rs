//! How good a mesh is: the shape of its tets and how well it fills the label map that it was made of.

mod crossing;
mod fidelity;
mod shape;
mod surface;

pub use crossing::crossings;
pub use fidelity::{Fidelity, LabelFidelity, fidelity};
pub use shape::{ShapeQuality, shape_quality};
pub use surface::{SurfaceDistance, surface_distance};

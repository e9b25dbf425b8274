//! Surfaces, tetrahedral meshes, quality, mesh formats, meshing engines.

mod closest_point;
pub mod engine;
mod facets;
pub mod format;
mod isosurface;
mod label_field;
mod optimise;
pub mod quality;
mod repair;
mod tet_mesh;
mod tri_mesh;

pub use closest_point::{ClosestPoint, Hit};
pub use isosurface::isosurface;
pub use label_field::LabelField;
pub use optimise::OptimiseSettings;
pub use repair::Island;
pub use tet_mesh::{MeshError, TET_FACES, TetMesh};
pub use tri_mesh::TriMesh;

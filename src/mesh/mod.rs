//! Surfaces, tetrahedral meshes, quality, mesh formats, meshing engines.

mod closest_point;
mod facets;
pub mod format;
mod isosurface;
mod tet_mesh;
mod tri_mesh;

pub use closest_point::{ClosestPoint, Hit};
pub use isosurface::isosurface;
pub use tet_mesh::{MeshError, TET_FACES, TetMesh};
pub use tri_mesh::TriMesh;

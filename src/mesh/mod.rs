//! Surfaces, tetrahedral meshes, quality, mesh formats, meshing engines.

mod tet_mesh;
mod tri_mesh;

pub use tet_mesh::{MeshError, TET_FACES, TetMesh};
pub use tri_mesh::TriMesh;

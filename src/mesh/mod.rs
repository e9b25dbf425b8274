//! Surfaces, tetrahedral meshes, quality, mesh formats, meshing engines.

mod closest_point;
mod cut;
mod enclosed;
pub mod engine;
mod facets;
pub mod format;
mod isosurface;
mod label_field;
mod optimise;
mod partial_volume;
mod pieces;
pub mod quality;
mod repair;
mod sheet;
mod tet_mesh;
mod tri_mesh;

pub use closest_point::{ClosestPoint, Hit};
pub use enclosed::OpenSurface;
pub use isosurface::isosurface;
pub use label_field::LabelField;
pub use optimise::OptimiseSettings;
pub use partial_volume::tissue_fractions;
pub use repair::Island;
pub use tet_mesh::{Fractions, MeshError, TET_FACES, TetMesh};
pub use tri_mesh::TriMesh;

/// Height of a polyline of (y, z) at `y`: linear between its points, constant beyond its ends. It runs from front to back.
pub fn line_height(line: &[[f64; 2]], y: f64) -> f64 {
    if y >= line[0][0] {
        return line[0][1];
    }
    for pair in line.windows(2) {
        let ([y0, z0], [y1, z1]) = (pair[0], pair[1]);
        if y >= y1 {
            return z0 + (z1 - z0) * (y0 - y) / (y0 - y1);
        }
    }
    line[line.len() - 1][1]
}

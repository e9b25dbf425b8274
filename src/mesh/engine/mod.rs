//! Meshing engines behind one interface: a label map in, conforming labelled tetrahedra out.
//!
//! Every engine meshes the same smooth [`LabelField`](crate::mesh::label_field::LabelField)s and hands its tets to the
//! same quality pass, so that what follows does not depend on which one ran. `lattice` is ours and always there; the
//! others are programs, used when they are installed.
//!
//! To add an engine, write its file after the manner of `gmsh.rs` and name it below: its `mod` line and its line in
//! `ENGINES`. The command line, `hgm doctor`, the JSON Schema and the tests read that list.

mod body_centred;
mod cgal;
mod choice;
mod error;
mod gmsh;
mod lattice;
mod mesher;
mod meshing;
mod octree;
mod process;
mod programs;
mod settings;
mod sizing;
mod surface;
mod tetgen;

pub use choice::Engine;
pub use error::EngineError;
pub(crate) use mesher::{Mesher, Program};
pub use meshing::{MeshingRecord, mesh_labels};
pub use process::{Limits, ProcessError};
pub use programs::EnginePrograms;
pub use settings::{MIDSAGITTAL, MeshSettings, MeshSize, MidplaneSplit};
pub use sizing::{LabelEdge, Sizing, WallEdge};

/// The engines, in the order in which they are shown.
pub(crate) static ENGINES: [&dyn Mesher; 4] = [&cgal::Cgal, &lattice::Lattice, &gmsh::Gmsh, &tetgen::Tetgen];

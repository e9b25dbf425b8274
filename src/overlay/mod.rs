//! What other tools draw on a scan: points, streamlines, surfaces. Bytes in, positions out (mm, RAS+), and the same file
//! again with the positions moved.
//!
//! A file keeps what it holds besides positions (triangles, scalars, names of points); what its header says of files,
//! people and times is left out where the format lets it.

mod csv;
mod drawing;
mod fcsv;
mod format;
mod markups;
mod ply;
mod ply_faces;
mod stl;
mod surface;
mod tag;
mod tck;
mod trk;
mod vtk;

pub use drawing::{Carried, Drawing, NotCarried, OverlayError, PointState};

#[cfg(test)]
mod tests;

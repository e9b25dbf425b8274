//! One integration binary: laws that cross rooms, other people's tools, the command line.

mod fem;
mod mesh_files;
mod pipelines;
mod nifti_guard;
mod python;
mod rooms;
mod slicer_files;
mod transform_files;

//! One integration binary: laws that cross rooms, other people's tools, the command line.

mod bids;
mod cluster;
mod cohort;
mod command_line;
mod damaged_files;
mod doubtful_inputs;
mod examples;
mod fem;
mod job;
mod material;
mod mesh_engines;
mod mesh_files;
mod midline;
mod nifti_guard;
mod own_masks;
mod pipelines;
mod privacy;
mod python;
mod refused_inputs;
mod rooms;
mod sequences;
mod settings;
mod simulate;
mod slicer_files;
mod stale;
mod transform_files;

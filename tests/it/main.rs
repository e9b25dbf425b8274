//! One integration binary: laws that cross rooms, other people's tools, the command line.

mod bids;
mod cluster;
mod cohort;
mod command_line;
mod damaged_files;
mod doubtful_inputs;
mod fem;
mod job;
mod label_maps;
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
mod settings;
mod simulate;
mod slicer_files;
mod transform_files;

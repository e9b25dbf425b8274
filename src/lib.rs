//! hgm: from a pre- and post-operative T1 pair to a biomechanical answer.
//!
//! `src/` is a row of rooms in the order the data flows; each module below is one room, and `tests/it/rooms.rs`
//! holds the table of who may import whom. Positions and files are in mm, RAS+; moduli in Pa; only `fem::units`
//! converts to SI.
//!
//! The science follows Granados et al., "A generative model of hyperelastic strain energy density functions for
//! multiple tissue brain deformation", IJCARS 2021.

pub mod anatomy;
pub mod artefact;
pub mod cli;
pub mod experiment;
pub mod fem;
pub mod geometry;
pub mod image;
pub mod layout;
pub mod material;
pub mod mesh;
pub mod register;
pub mod report;
pub mod resect;
pub mod segment;
pub mod tag;
pub mod workflow;

//! The solver against closed forms, identities and other people's figures.

mod contact;
mod cook;
mod hertz;
mod inversion;
mod laws;
mod loads;
mod meshes;
mod mixed_cells;
mod motion;
mod refusals;
mod remarks;
mod sensitivities;
mod statics;
mod stiffness;
mod walls;

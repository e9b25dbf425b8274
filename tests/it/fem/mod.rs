//! The solver against closed forms, identities and other people's figures.

mod cook;
mod inversion;
mod laws;
mod loads;
mod meshes;
mod motion;
mod refusals;
mod sensitivities;
mod statics;
mod stiffness;

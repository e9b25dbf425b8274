//! Constitutive laws in three dimensions, one file each: formula, parameters with unit and range, energy and
//! derivatives, where the law is stable, how it is fitted, and where it comes from.
//!
//! To add a law, write its file after the manner of `neo_hookean.rs` and name it below: its `mod` line and its line in
//! [`LAWS`]. Scenario files, meta-models, samples, sensitivities, the JSON Schema, help texts and the battery of tests
//! read that list.

mod battery;
mod compression_resistance;
mod curve;
mod definition;
mod hyperelastic;
mod material;
mod material_file;
mod stability;
#[cfg(test)]
mod verification;
mod volume;

pub mod gent;
pub mod literature;
pub mod mooney_rivlin;
pub mod neo_hookean;
pub mod ogden;
pub mod stable_neo_hookean;

pub use battery::{check_hyperelastic, check_hyperelastic_within};
pub use compression_resistance::CompressionResistance;
pub use curve::{Data, MOST_PARAMETERS, Search, Slope, Start, UniaxialCurve};
pub use definition::{Card, Estimated, Law, LawParameter, Range, Role, Shape, ShapeKnown, ShapeScale, Values, Volume};
pub use hyperelastic::{Hyperelastic, Tangent};
pub use material::{Material, MaterialError, Parameter};
pub use mooney_rivlin::MooneyRivlin;
pub use neo_hookean::NeoHookean;
pub use ogden::{Ogden, OgdenTerm};
pub use stability::{Stability, StabilityRange};
pub use stable_neo_hookean::StableNeoHookean;

/// The laws, in the order in which they are shown.
pub static LAWS: [&dyn Law; 6] = [
    &neo_hookean::Definition,
    &mooney_rivlin::Definition,
    &ogden::Definition,
    &stable_neo_hookean::Definition,
    &gent::Definition,
    &literature::Definition,
];

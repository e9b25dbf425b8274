//! The constitutive forms of the brain literature, one file each: the energy in three dimensions and its reduction to
//! uniaxial isochoric stretch, (l, l^-1/2, l^-1/2).
//!
//! Each energy is written once over [`Number`]; stresses and tangents are its exact derivatives ([`Jet`]).

mod any;
mod fung;
mod gent;
mod invariant;
mod laksari;
mod linear;
mod mooney_rivlin;
mod neo_hookean;
mod number;
mod ogden;
mod parse;
mod reduced_polynomial;
mod solid;
mod stretch_energy;

pub use any::Form;
pub use fung::{Demiray, FungMihai};
pub use gent::Gent;
pub use invariant::{first_uniaxial, ogden_uniaxial, second_uniaxial};
pub use laksari::{Laksari, LaksariAsCoded};
pub use linear::Linear;
pub use mooney_rivlin::MooneyRivlin;
pub use neo_hookean::NeoHookean;
pub use number::{Jet, Number};
pub use ogden::{OgdenMihai, OgdenModified};
pub use parse::{FORM_NAMES, FormError};
pub use reduced_polynomial::ReducedPolynomial;
pub use solid::Solid;
pub use stretch_energy::StretchEnergy;

//! The constitutive forms of the brain literature, one file each: the energy in three dimensions and its reduction to
//! uniaxial isochoric stretch, (l, l^-1/2, l^-1/2).
//!
//! Each energy is written once over [`Number`]; stresses and tangents are its exact derivatives ([`Jet`]).

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

/// A form: energy density in the principal stretches.
pub trait StretchEnergy {
    /// W(l), Pa (J/m3), on the uniaxial isochoric path; zero at l = 1, not a number outside the form's domain.
    fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N;
    /// Psi of three principal stretches, Pa. Isochoric forms take l_i J^(-1/3).
    fn energy_pa<N: Number>(&self, stretches: [N; 3]) -> N;
    /// Shear modulus at rest, Pa: W is 3/2 of it times the squared strain.
    fn small_strain_shear_modulus_pa(&self) -> f64;
    /// Whether Psi resists a change of volume by itself.
    fn carries_its_own_volume_term(&self) -> bool {
        false
    }
}

/// One of the forms with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// Small-strain Hooke.
    Linear(Linear),
    /// Neo-Hookean.
    NeoHookean(NeoHookean),
    /// Mooney-Rivlin.
    MooneyRivlin(MooneyRivlin),
    /// Ogden, Mihai's convention.
    OgdenMihai(OgdenMihai),
    /// Modified one-term Ogden.
    OgdenModified(OgdenModified),
    /// Fung, Mihai's variant.
    FungMihai(FungMihai),
    /// Demiray.
    Demiray(Demiray),
    /// Gent.
    Gent(Gent),
    /// Reduced polynomial.
    ReducedPolynomial(ReducedPolynomial),
    /// Laksari.
    Laksari(Laksari),
    /// Laksari as the published program coded it.
    LaksariAsCoded(LaksariAsCoded),
}

impl Form {
    /// W(l), Pa, on the uniaxial isochoric path; not a number outside the form's domain.
    pub fn uniaxial_energy_pa<N: Number>(&self, stretch: N) -> N {
        match self {
            Self::Linear(form) => form.uniaxial_energy_pa(stretch),
            Self::NeoHookean(form) => form.uniaxial_energy_pa(stretch),
            Self::MooneyRivlin(form) => form.uniaxial_energy_pa(stretch),
            Self::OgdenMihai(form) => form.uniaxial_energy_pa(stretch),
            Self::OgdenModified(form) => form.uniaxial_energy_pa(stretch),
            Self::FungMihai(form) => form.uniaxial_energy_pa(stretch),
            Self::Demiray(form) => form.uniaxial_energy_pa(stretch),
            Self::Gent(form) => form.uniaxial_energy_pa(stretch),
            Self::ReducedPolynomial(form) => form.uniaxial_energy_pa(stretch),
            Self::Laksari(form) => form.uniaxial_energy_pa(stretch),
            Self::LaksariAsCoded(form) => form.uniaxial_energy_pa(stretch),
        }
    }

    /// dW/dl, the nominal stress in Pa, on the uniaxial isochoric path.
    pub fn uniaxial_stress_pa(&self, stretch: f64) -> f64 {
        self.uniaxial_energy_pa(Jet::variable(stretch, 0)).gradient[0]
    }
}

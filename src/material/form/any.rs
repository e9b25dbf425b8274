//! A form as a value: which one is known from a table only.

use super::fung::{Demiray, FungMihai};
use super::gent::Gent;
use super::laksari::{Laksari, LaksariAsCoded};
use super::linear::Linear;
use super::mooney_rivlin::MooneyRivlin;
use super::neo_hookean::NeoHookean;
use super::number::{Jet, Number};
use super::ogden::{OgdenMihai, OgdenModified};
use super::reduced_polynomial::ReducedPolynomial;
use super::stretch_energy::StretchEnergy;

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

    /// Psi in three dimensions with the change of volume ruled by lambda (Pa): [`StretchEnergy::energy_with_lambda_pa`].
    /// The curve of the published program exists on the uniaxial path only: elsewhere it is not a number.
    pub fn energy_with_lambda_pa<N: Number>(&self, stretches: [N; 3], lame_lambda_pa: f64) -> N {
        match self {
            Self::Linear(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::NeoHookean(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::MooneyRivlin(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::OgdenMihai(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::OgdenModified(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::FungMihai(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::Demiray(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::Gent(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::ReducedPolynomial(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::Laksari(form) => form.energy_with_lambda_pa(stretches, lame_lambda_pa),
            Self::LaksariAsCoded(_) => N::constant(f64::NAN),
        }
    }

    /// Shear modulus at rest, Pa; not a number for the curve of the published program, which has a stress at rest.
    pub fn small_strain_shear_modulus_pa(&self) -> f64 {
        match self {
            Self::Linear(form) => form.small_strain_shear_modulus_pa(),
            Self::NeoHookean(form) => form.small_strain_shear_modulus_pa(),
            Self::MooneyRivlin(form) => form.small_strain_shear_modulus_pa(),
            Self::OgdenMihai(form) => form.small_strain_shear_modulus_pa(),
            Self::OgdenModified(form) => form.small_strain_shear_modulus_pa(),
            Self::FungMihai(form) => form.small_strain_shear_modulus_pa(),
            Self::Demiray(form) => form.small_strain_shear_modulus_pa(),
            Self::Gent(form) => form.small_strain_shear_modulus_pa(),
            Self::ReducedPolynomial(form) => form.small_strain_shear_modulus_pa(),
            Self::Laksari(form) => form.small_strain_shear_modulus_pa(),
            Self::LaksariAsCoded(_) => f64::NAN,
        }
    }

    /// dW/dl, the nominal stress in Pa, on the uniaxial isochoric path.
    pub fn uniaxial_stress_pa(&self, stretch: f64) -> f64 {
        self.uniaxial_energy_pa(Jet::variable(stretch, 0)).gradient[0]
    }
}

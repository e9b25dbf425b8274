//! Compressible hyperelastic laws in three dimensions, one file each, under one battery of laws of physics.

mod battery;
mod compression_resistance;
mod material;
mod mooney_rivlin;
mod neo_hookean;
mod ogden;
mod stable_neo_hookean;
#[cfg(test)]
mod verification;
mod volume;

pub use battery::check_hyperelastic;
pub use compression_resistance::CompressionResistance;
pub use material::{Material, MaterialError, Parameter};
pub use mooney_rivlin::MooneyRivlin;
pub use neo_hookean::NeoHookean;
pub use ogden::{Ogden, OgdenTerm};
pub use stable_neo_hookean::StableNeoHookean;

use nalgebra::{Matrix3, SMatrix};

/// d vec(P) / d vec(F), column-major: entry (a + 3 b, c + 3 d) is dP_ab / dF_cd.
pub type Tangent = SMatrix<f64, 9, 9>;

/// A body whose stress is the derivative of a stored energy.
///
/// All functions take the displacement gradient H = F - I (dimensionless): forming F first loses small strains.
pub trait Hyperelastic: Send + Sync {
    /// Stored energy per undeformed volume, Pa (J/m3); zero at rest.
    fn energy_density_pa(&self, displacement_gradient: &Matrix3<f64>) -> f64;
    /// First Piola-Kirchhoff stress P = dPsi/dF, Pa.
    fn first_piola_kirchhoff_pa(&self, displacement_gradient: &Matrix3<f64>) -> Matrix3<f64>;
    /// dP/dF, Pa.
    fn tangent_pa(&self, displacement_gradient: &Matrix3<f64>) -> Tangent;
    /// Shear modulus at rest, Pa.
    fn small_strain_shear_modulus_pa(&self) -> f64;
}

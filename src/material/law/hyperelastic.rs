//! What the solver asks of a law: energy, stress and tangent at a displacement gradient.

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
    /// mu and lambda (Pa) where this is the neo-Hookean law and nothing else, and the volume ratio down to which it is (0: all):
    /// elements have a fast path for it.
    fn neo_hookean(&self) -> Option<[f64; 3]> {
        None
    }
}

impl Hyperelastic for Box<dyn Hyperelastic> {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        self.as_ref().energy_density_pa(h)
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        self.as_ref().first_piola_kirchhoff_pa(h)
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        self.as_ref().tangent_pa(h)
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.as_ref().small_strain_shear_modulus_pa()
    }

    fn neo_hookean(&self) -> Option<[f64; 3]> {
        self.as_ref().neo_hookean()
    }
}

//! Added resistance against compression, around any law.

use super::hyperelastic::{Hyperelastic, Tangent};
use super::volume::{OfVolume, add_tangent_of_volume, cofactors, volume_change};
use nalgebra::Matrix3;

/// Psi = Psi_inner - k/12 (J - 1)^3 for J < 1 and Psi_inner above: stiffer the more an element is squeezed, nothing
/// changed at rest or in tension (Kikuuwe, Tabuchi and Yamamoto, ACM TOG 2009; Sin, Schroeder and Barbic, "Vega", 2013;
/// the term the paper switches on for J < 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompressionResistance<L> {
    /// The law that is stiffened.
    pub inner: L,
    /// k, Pa.
    pub resistance_pa: f64,
}

impl<L> CompressionResistance<L> {
    fn of_volume(&self, h: &Matrix3<f64>) -> Option<OfVolume> {
        let x = volume_change(h);
        let k = self.resistance_pa;
        (x < 0.0).then(|| OfVolume { value: -k / 12.0 * x.powi(3), first: -0.25 * k * x * x, second: -0.5 * k * x })
    }
}

impl<L: Hyperelastic> Hyperelastic for CompressionResistance<L> {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        self.inner.energy_density_pa(h) + self.of_volume(h).map_or(0.0, |g| g.value)
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let stress = self.inner.first_piola_kirchhoff_pa(h);
        self.of_volume(h).map_or(stress, |g| stress + cofactors(&(Matrix3::identity() + h)) * g.first)
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let mut tangent = self.inner.tangent_pa(h);
        if let Some(g) = self.of_volume(h) {
            add_tangent_of_volume(&mut tangent, g, &(Matrix3::identity() + h));
        }
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.inner.small_strain_shear_modulus_pa()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::{MooneyRivlin, NeoHookean, check_hyperelastic};

    #[test]
    fn compression_resistance_obeys_the_laws_of_hyperelasticity() {
        check_hyperelastic(&CompressionResistance { inner: NeoHookean::new(1000.0, 0.45), resistance_pa: 5e4 });
        check_hyperelastic(&CompressionResistance {
            inner: MooneyRivlin::new(300.0, 200.0, 0.45),
            resistance_pa: 500.0,
        });
    }

    #[test]
    fn only_compression_is_resisted() {
        let inner = NeoHookean::new(1000.0, 0.45);
        let law = CompressionResistance { inner, resistance_pa: 1e5 };
        let (squeezed, stretched) = (Matrix3::identity() * -0.1, Matrix3::identity() * 0.1);
        assert!(law.energy_density_pa(&squeezed) > inner.energy_density_pa(&squeezed));
        assert_eq!(law.energy_density_pa(&stretched), inner.energy_density_pa(&stretched));
    }
}

//! A form as a three-dimensional solid: stress and tangent from the derivatives in the principal stretches.

use super::number::Jet;
use super::stretch_energy::StretchEnergy;
use crate::material::law::{Hyperelastic, Tangent};
use nalgebra::Matrix3;

/// An energy of the principal stretches, with its resistance to a change of volume, as a solid. Stress
/// P = sum dPsi/dl_i u_i v_i^T and tangent by the spectral formula (Ogden, "Non-Linear Elastic Deformations", 1984,
/// ch. 6; Bonet and Wood, 2nd ed., sec. 6.6).
#[derive(Clone, Debug, PartialEq)]
pub struct Solid<E> {
    /// The energy.
    pub form: E,
}

struct Spectral {
    stretches: [f64; 3],
    left: Matrix3<f64>,
    right: Matrix3<f64>,
}

impl<E: StretchEnergy> Solid<E> {
    fn spectral(h: &Matrix3<f64>) -> Spectral {
        let f = Matrix3::identity() + h;
        let eigen = (f.transpose() * f).symmetric_eigen();
        // Stretches from |F v| and u = F v / l keep full precision for small strains.
        let right = eigen.eigenvectors;
        let pushed = f * right;
        let stretches: [f64; 3] = std::array::from_fn(|i| pushed.column(i).norm());
        let left = Matrix3::from_fn(|row, col| pushed[(row, col)] / stretches[col]);
        Spectral { stretches, left, right }
    }

    fn jet(&self, stretches: [f64; 3]) -> Jet {
        self.form.energy_pa(std::array::from_fn(|i| Jet::variable(stretches[i], i)))
    }
}

impl<E: StretchEnergy + Send + Sync> Hyperelastic for Solid<E> {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        let det = (Matrix3::identity() + h).determinant();
        if det <= 0.0 {
            return f64::INFINITY;
        }
        let value = self.jet(Self::spectral(h).stretches).value;
        if value.is_nan() { f64::INFINITY } else { value }
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let Spectral { stretches, left, right } = Self::spectral(h);
        let slope = self.jet(stretches).gradient;
        left * Matrix3::from_diagonal(&slope.into()) * right.transpose()
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let Spectral { stretches: l, left, right } = Self::spectral(h);
        let Jet { gradient: g, hessian, .. } = self.jet(l);
        // In the principal frame: dP_ii/dF_jj = Psi_ij; for i != j the symmetric and the skew part of dF_ij.
        let mut tangent = Tangent::zeros();
        let dyad = |i: usize, j: usize| left.column(i) * right.column(j).transpose();
        let mut add = |weight: f64, a: Matrix3<f64>, b: Matrix3<f64>| {
            for row in 0..9 {
                for col in 0..9 {
                    tangent[(row, col)] += weight * a[row] * b[col];
                }
            }
        };
        for i in 0..3 {
            for j in 0..3 {
                add(hessian[i][j], dyad(i, i), dyad(j, j));
            }
        }
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let gap = l[i] - l[j];
            // Equal stretches: the limit of the difference quotient.
            let stretch_like = if gap.abs() > 1e-5 * (l[i] + l[j]) {
                (g[i] - g[j]) / gap
            } else {
                0.5 * (hessian[i][i] + hessian[j][j]) - hessian[i][j]
            };
            let turn_like = (g[i] + g[j]) / (l[i] + l[j]);
            add(0.5 * stretch_like, dyad(i, j) + dyad(j, i), dyad(i, j) + dyad(j, i));
            add(0.5 * turn_like, dyad(i, j) - dyad(j, i), dyad(i, j) - dyad(j, i));
        }
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.form.small_strain_shear_modulus_pa()
    }
}

#[cfg(test)]
mod tests {
    use super::super::*;

    #[test]
    fn three_dimensional_energy_reduces_to_the_uniaxial_curve() {
        fn gap<E: StretchEnergy>(form: &E) -> f64 {
            [0.85, 0.97, 1.02, 1.15].into_iter().fold(0.0, |worst: f64, l: f64| {
                let side = 1.0 / l.sqrt();
                let [solid, curve]: [f64; 2] = [form.energy_pa([l, side, side]), form.uniaxial_energy_pa(l)];
                worst.max((solid - curve).abs() / curve)
            })
        }
        assert!(gap(&Linear { young_modulus_pa: 2100.0, poisson_ratio: 0.45 }) < 1e-12);
        assert!(gap(&NeoHookean { shear_modulus_pa: 1.0 }) < 1e-12);
        assert!(gap(&MooneyRivlin { c1_pa: 140.0, c2_pa: 166.5 }) < 1e-12);
        assert!(gap(&OgdenMihai { terms: vec![(-3543.0, 1.0), (-2723.0, -1.0), (654.0, 2.0)] }) < 1e-9);
        assert!(gap(&OgdenModified { shear_modulus_pa: 650.0, alpha: -32.5 }) < 1e-12);
        assert!(gap(&FungMihai { c_pa: 166.64, alpha: 2.4974 }) < 1e-12);
        assert!(gap(&Demiray { shear_modulus_pa: 550.0, beta: 28.4 }) < 1e-11);
        assert!(gap(&Gent { shear_modulus_pa: 333.28, jm: 1.008 }) < 1e-12);
        assert!(gap(&ReducedPolynomial { c10_pa: 240.0, c30_pa: 3420.0 }) < 1e-12);
        let laksari =
            Laksari { c10_pa: -1010.0, c01_pa: 1490.0, c11_pa: 190.0, k_pa: 2.38, a: 100.0, poisson_ratio: 0.49 };
        assert!(gap(&laksari) < 1e-11);
    }
}

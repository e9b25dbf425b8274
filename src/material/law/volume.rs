//! What every law needs of the volume ratio J = det F: its cofactors, and functions of J with two derivatives.

use super::hyperelastic::Tangent;
use nalgebra::Matrix3;

/// det(I + H) - 1 without the cancellation of forming F.
pub(super) fn volume_change(h: &Matrix3<f64>) -> f64 {
    let minors = h[(0, 0)] * h[(1, 1)] - h[(0, 1)] * h[(1, 0)] + h[(1, 1)] * h[(2, 2)] - h[(1, 2)] * h[(2, 1)]
        + h[(0, 0)] * h[(2, 2)]
        - h[(0, 2)] * h[(2, 0)];
    h.trace() + minors + h.determinant()
}

/// Cofactors: dJ/dF = J F^-T, a polynomial of F and so defined for flat and mirrored elements too.
pub(super) fn cofactors(f: &Matrix3<f64>) -> Matrix3<f64> {
    let (a, b, c) = (f.column(0), f.column(1), f.column(2));
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)])
}

/// A function of J with its first and second derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct OfVolume {
    pub value: f64,
    pub first: f64,
    pub second: f64,
}

/// d2J/dF2: entry (a b, c d) is e_acm e_bdn F_mn.
pub(super) fn add_volume_hessian(tangent: &mut Tangent, factor: f64, f: &Matrix3<f64>) {
    for (a, c, m, s) in PERMUTATIONS {
        for (b, d, n, t) in PERMUTATIONS {
            tangent[(a + 3 * b, c + 3 * d)] += factor * s * t * f[(m, n)];
        }
    }
}

const PERMUTATIONS: [(usize, usize, usize, f64); 6] =
    [(0, 1, 2, 1.0), (1, 2, 0, 1.0), (2, 0, 1, 1.0), (0, 2, 1, -1.0), (2, 1, 0, -1.0), (1, 0, 2, -1.0)];

/// Adds d2 G(J) / dF2 = G'' cof (x) cof + G' d2J/dF2.
pub(super) fn add_tangent_of_volume(tangent: &mut Tangent, of_volume: OfVolume, f: &Matrix3<f64>) {
    let cof = cofactors(f);
    for col in 0..9 {
        for row in 0..9 {
            tangent[(row, col)] += of_volume.second * cof[row] * cof[col];
        }
    }
    add_volume_hessian(tangent, of_volume.first, f);
}

/// ln J, continued below `floor` by its second-order Taylor polynomial there when `floor` > 0: an energy that is
/// finite for flat and mirrored elements and twice continuously differentiable, so Newton can bring them back.
/// With `floor` = 0 the logarithm itself: minus infinity at J <= 0. (After Stomakhin, Howes, Schroeder and Teran,
/// "Energetically consistent invertible elasticity", SCA 2012, applied to J instead of each stretch.)
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct VolumeLogarithm {
    pub floor: f64,
}

impl VolumeLogarithm {
    pub(super) fn of(self, j_minus_1: f64) -> OfVolume {
        let j = 1.0 + j_minus_1;
        if j > self.floor {
            return OfVolume { value: j_minus_1.ln_1p(), first: 1.0 / j, second: -1.0 / (j * j) };
        }
        if self.floor <= 0.0 {
            return OfVolume { value: f64::NEG_INFINITY, first: f64::INFINITY, second: f64::NEG_INFINITY };
        }
        let (x, x0) = (j - self.floor, self.floor);
        OfVolume {
            value: x0.ln() + x / x0 - 0.5 * x * x / (x0 * x0),
            first: 1.0 / x0 - x / (x0 * x0),
            second: -1.0 / (x0 * x0),
        }
    }

    /// -shear L + lambda/2 L^2 with L this logarithm.
    pub(super) fn energy(self, shear: f64, lambda: f64, j_minus_1: f64) -> OfVolume {
        let l = self.of(j_minus_1);
        if l.value == f64::NEG_INFINITY {
            return OfVolume { value: f64::INFINITY, first: f64::NAN, second: f64::NAN };
        }
        OfVolume {
            value: -shear * l.value + 0.5 * lambda * l.value * l.value,
            first: (lambda * l.value - shear) * l.first,
            second: lambda * l.first * l.first + (lambda * l.value - shear) * l.second,
        }
    }
}

/// lambda = 2 mu nu / (1 - 2 nu), Pa.
pub(super) fn lame_lambda_pa(shear_modulus_pa: f64, poisson_ratio: f64) -> f64 {
    2.0 * shear_modulus_pa * poisson_ratio / (1.0 - 2.0 * poisson_ratio)
}

//! What a material does at one integration point: energy, stress, stiffness blocks.
//!
//! The neo-Hookean law has its own path: with g_a = F^-T G_a (the spatial gradients) its stiffness block is
//! mu (G_a . G_b) I + (mu - lambda ln J) g_b (x) g_a + lambda g_a (x) g_b, a tenth of the work of a general tangent.

use crate::material::Hyperelastic;
use crate::material::law::{Material, Tangent};
use nalgebra::{Matrix3, SMatrix, SymmetricEigen};

/// A material made ready for integration points.
pub(in super::super) enum Kernel {
    /// The paper's law without wrappers.
    NeoHookean { mu: f64, lambda: f64 },
    /// The same above a volume ratio, below which its energy is continued.
    Continued { mu: f64, lambda: f64, floor: f64, law: Box<dyn Hyperelastic> },
    /// Any other law through its 9 x 9 tangent.
    General(Box<dyn Hyperelastic>),
}

/// A kernel at a point: mu and lambda (Pa) of the closed form, or the law itself.
enum Quick<'a> {
    NeoHookean(f64, f64),
    General(&'a dyn Hyperelastic),
}

/// Row-major 3 x 3, as small as the hot loop likes it.
pub(in super::super) type M3 = [[f64; 3]; 3];

impl Kernel {
    /// A material with this lambda (Pa): its own, or 0 where its volume term is evaluated elsewhere.
    pub(in super::super) fn new(material: &Material, lambda: f64) -> Self {
        let law = material.law_with_lambda(lambda);
        match law.neo_hookean() {
            Some([mu, lambda, 0.0]) => Self::NeoHookean { mu, lambda },
            Some([mu, lambda, floor]) => Self::Continued { mu, lambda, floor, law },
            None => Self::General(law),
        }
    }

    /// How it is evaluated at this volume change: a cell that is nowhere near inside out needs no 9 x 9 tangent.
    #[inline(always)]
    fn quick(&self, j_minus_1: f64) -> Quick<'_> {
        match self {
            Self::NeoHookean { mu, lambda } => Quick::NeoHookean(*mu, *lambda),
            Self::Continued { mu, lambda, floor, .. } if 1.0 + j_minus_1 > *floor => Quick::NeoHookean(*mu, *lambda),
            Self::Continued { law, .. } | Self::General(law) => Quick::General(law.as_ref()),
        }
    }

    /// Energy density, Pa.
    #[inline(always)]
    pub(super) fn energy(&self, h: &M3) -> f64 {
        let (_, j_minus_1) = cofactors(h);
        match self.quick(j_minus_1) {
            Quick::NeoHookean(mu, lambda) => {
                if j_minus_1 <= -1.0 {
                    return f64::INFINITY;
                }
                let ln_j = j_minus_1.ln_1p();
                let trace = h[0][0] + h[1][1] + h[2][2];
                let square: f64 = h.iter().flatten().map(|v| v * v).sum();
                0.5 * mu * (2.0 * trace + square) - mu * ln_j + 0.5 * lambda * ln_j * ln_j
            }
            Quick::General(law) => law.energy_density_pa(&matrix(h)),
        }
    }

    /// First Piola-Kirchhoff stress, Pa.
    #[inline(always)]
    pub(super) fn stress(&self, h: &M3) -> M3 {
        let (cof, j_minus_1) = cofactors(h);
        match self.quick(j_minus_1) {
            Quick::NeoHookean(mu, lambda) => {
                neo_hookean_stress(mu, lambda * j_minus_1.ln_1p(), h, &cof, 1.0 + j_minus_1)
            }
            Quick::General(law) => rows(&law.first_piola_kirchhoff_pa(&matrix(h))),
        }
    }

    /// Stress, and every stiffness block (a, b), a <= b, column-major, handed to `put` after multiplying by `weight`.
    /// `project` makes the tangent positive semi-definite.
    #[inline(always)]
    pub(super) fn stiffness<const K: usize>(
        &self,
        h: &M3,
        gradients: &[[f64; 3]; K],
        weight: f64,
        project: bool,
        mut put: impl FnMut(usize, usize, &[f64; 9]),
    ) -> M3 {
        let (cof, j_minus_1) = cofactors(h);
        match self.quick(j_minus_1) {
            Quick::NeoHookean(mu, lambda) => {
                let (j, volume_stress) = (1.0 + j_minus_1, lambda * j_minus_1.ln_1p());
                let stress = neo_hookean_stress(mu, volume_stress, h, &cof, j);
                let mut exchange = mu - volume_stress;
                if project {
                    exchange = projected_exchange(exchange, mu, h);
                }
                let inverse_j = 1.0 / j;
                let spatial: [[f64; 3]; K] = std::array::from_fn(|a| {
                    let g = &gradients[a];
                    [0, 1, 2].map(|r| (cof[r][0] * g[0] + cof[r][1] * g[1] + cof[r][2] * g[2]) * inverse_j)
                });
                let (c1, c2, c3) = (weight * mu, weight * exchange, weight * lambda);
                for a in 0..K {
                    let ga = &gradients[a];
                    let (x, y) = (spatial[a].map(|v| c2 * v), spatial[a].map(|v| c3 * v));
                    for b in a..K {
                        let (gb, z) = (&gradients[b], &spatial[b]);
                        let s = c1 * (ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]);
                        let mut block = [0.0; 9];
                        for c in 0..3 {
                            for r in 0..3 {
                                block[3 * c + r] = z[r] * x[c] + y[r] * z[c];
                            }
                        }
                        block[0] += s;
                        block[4] += s;
                        block[8] += s;
                        put(a, b, &block);
                    }
                }
                stress
            }
            Quick::General(law) => {
                let h = matrix(h);
                let mut tangent = law.tangent_pa(&h);
                if project {
                    tangent = projected(&tangent);
                }
                for b in 0..K {
                    // Columns of dP for a unit displacement of node b.
                    let gb = gradients[b];
                    let half = SMatrix::<f64, 9, 3>::from_fn(|row, k| {
                        (tangent[(row, k)] * gb[0] + tangent[(row, k + 3)] * gb[1] + tangent[(row, k + 6)] * gb[2])
                            * weight
                    });
                    for a in 0..=b {
                        let ga = gradients[a];
                        let mut block = [0.0; 9];
                        for c in 0..3 {
                            for r in 0..3 {
                                block[3 * c + r] =
                                    half[(r, c)] * ga[0] + half[(r + 3, c)] * ga[1] + half[(r + 6, c)] * ga[2];
                            }
                        }
                        put(a, b, &block);
                    }
                }
                rows(&law.first_piola_kirchhoff_pa(&h))
            }
        }
    }
}

/// mu (F - F^-T) + lambda ln J F^-T, the first bracket as H + F^-T H^T: nothing cancels near rest.
#[inline(always)]
fn neo_hookean_stress(mu: f64, volume_stress: f64, h: &M3, cof: &M3, j: f64) -> M3 {
    let inverse_j = 1.0 / j;
    let g = cof.map(|row| row.map(|v| v * inverse_j));
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let turned = g[r][0] * h[c][0] + g[r][1] * h[c][1] + g[r][2] * h[c][2];
            mu * (h[r][c] + turned) + volume_stress * g[r][c]
        })
    })
}

/// Cofactors of F = I + H and det F - 1 without cancellation.
#[inline(always)]
pub(super) fn cofactors(h: &M3) -> (M3, f64) {
    let f = [[1.0 + h[0][0], h[0][1], h[0][2]], [h[1][0], 1.0 + h[1][1], h[1][2]], [h[2][0], h[2][1], 1.0 + h[2][2]]];
    let cof = cofactor_rows(&f);
    // det(I + H) - 1 = H_00 (C_00) + (minor of the rest) with C_00 = det of the lower right block of I + H.
    let lower = h[1][1] + h[2][2] + h[1][1] * h[2][2] - h[1][2] * h[2][1];
    let j_minus_1 = h[0][0] * cof[0][0] + lower + h[0][1] * cof[0][1] + h[0][2] * cof[0][2];
    (cof, j_minus_1)
}

#[inline(always)]
fn cofactor_rows(f: &M3) -> M3 {
    [
        [
            f[1][1] * f[2][2] - f[1][2] * f[2][1],
            f[1][2] * f[2][0] - f[1][0] * f[2][2],
            f[1][0] * f[2][1] - f[1][1] * f[2][0],
        ],
        [
            f[2][1] * f[0][2] - f[2][2] * f[0][1],
            f[2][2] * f[0][0] - f[2][0] * f[0][2],
            f[2][0] * f[0][1] - f[2][1] * f[0][0],
        ],
        [
            f[0][1] * f[1][2] - f[0][2] * f[1][1],
            f[0][2] * f[1][0] - f[0][0] * f[1][2],
            f[0][0] * f[1][1] - f[0][1] * f[1][0],
        ],
    ]
}

/// The largest coefficient of the exchange term X -> g X^T g that keeps mu I + c (exchange) positive semi-definite:
/// its eigenvalues are c / (s_i s_j) on diagonals and +-c / (s_i s_j) on pairs of principal stretches.
fn projected_exchange(exchange: f64, mu: f64, h: &M3) -> f64 {
    let mut f = *h;
    (0..3).for_each(|i| f[i][i] += 1.0);
    let f = matrix(&f);
    let mut stretches: [f64; 3] = (f.transpose() * f).symmetric_eigenvalues().into();
    stretches.sort_unstable_by(f64::total_cmp);
    let s = [stretches[0].max(0.0).sqrt(), stretches[1].max(0.0).sqrt()];
    exchange.clamp(-mu * s[0] * s[0], mu * s[0] * s[1])
}

/// Eigenvalues below zero become zero (Teran, Sifakis, Irving and Fedkiw, SCA 2005).
pub(super) fn projected(tangent: &Tangent) -> Tangent {
    let eigen = SymmetricEigen::new(*tangent);
    let mut raised = *tangent;
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value < 0.0 {
            raised.ger(-value, &vector, &vector, 1.0);
        }
    }
    raised
}

fn matrix(h: &M3) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| h[r][c])
}

fn rows(h: &Matrix3<f64>) -> M3 {
    std::array::from_fn(|r| std::array::from_fn(|c| h[(r, c)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::NeoHookean;

    const H: M3 = [[0.12, -0.05, 0.08], [0.03, -0.09, 0.06], [-0.07, 0.1, 0.05]];
    const GRADIENTS: [[f64; 3]; 4] = [[-1.1, -0.4, -1.0], [0.7, 0.1, 0.2], [0.3, 0.9, -0.2], [0.1, -0.6, 1.0]];

    fn blocks(kernel: &Kernel, h: &M3, project: bool) -> (M3, Vec<[f64; 9]>) {
        let mut all = vec![[0.0; 9]; 16];
        let stress = kernel.stiffness(h, &GRADIENTS, 2.0, project, |a, b, block| all[4 * a + b] = *block);
        (stress, all)
    }

    #[test]
    fn the_fast_path_is_the_general_path() {
        let fast = Kernel::NeoHookean { mu: 1000.0, lambda: 9000.0 };
        let general = Kernel::General(Box::new(NeoHookean::new(1000.0, 0.45)));
        let (f, g) = (blocks(&fast, &H, false), blocks(&general, &H, false));
        for (a, b) in f.1.iter().flatten().zip(g.1.iter().flatten()) {
            assert!((a - b).abs() < 1e-8, "{a} {b}");
        }
        for (a, b) in f.0.iter().flatten().zip(g.0.iter().flatten()) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        assert_eq!(fast.stress(&H), f.0);
        assert!((fast.energy(&H) - general.energy(&H)).abs() < 1e-10);
    }

    #[test]
    fn a_continued_law_is_the_fast_path_above_its_floor_and_the_law_below() {
        let law = || NeoHookean { inversion_threshold: 0.6, ..NeoHookean::new(1000.0, 0.45) };
        let continued = Kernel::Continued { mu: 1000.0, lambda: 9000.0, floor: 0.6, law: Box::new(law()) };
        let fast = Kernel::NeoHookean { mu: 1000.0, lambda: 9000.0 };
        let general = Kernel::General(Box::new(law()));
        let squeezed: M3 = std::array::from_fn(|r| std::array::from_fn(|c| H[r][c] - if r == c { 0.7 } else { 0.0 }));
        for (h, same) in [(&H, &fast), (&squeezed, &general)] {
            assert_eq!(blocks(&continued, h, false), blocks(same, h, false));
            assert_eq!(blocks(&continued, h, true), blocks(same, h, true));
            assert_eq!((continued.stress(h), continued.energy(h)), (same.stress(h), same.energy(h)));
        }
        // Where the two meet they are one.
        for size in [-0.2, 0.2] {
            let h: M3 = std::array::from_fn(|r| std::array::from_fn(|c| size * H[r][c]));
            assert!((continued.energy(&h) - general.energy(&h)).abs() < 1e-10);
        }
    }

    #[test]
    fn projection_leaves_no_negative_curvature() {
        // Squeezed and swollen states, where the tangent of the law is indefinite.
        for size in [-0.4, 0.8] {
            let h: M3 = std::array::from_fn(|r| std::array::from_fn(|c| H[r][c] + if r == c { size } else { 0.0 }));
            for kernel in [
                Kernel::NeoHookean { mu: 1000.0, lambda: 9000.0 },
                Kernel::General(Box::new(NeoHookean::new(1000.0, 0.45))),
            ] {
                let (_, blocks) = blocks(&kernel, &h, true);
                let dense = SMatrix::<f64, 12, 12>::from_fn(|row, col| {
                    let (a, b, r, c) = (row / 3, col / 3, row % 3, col % 3);
                    if a <= b { blocks[4 * a + b][3 * c + r] } else { blocks[4 * b + a][3 * r + c] }
                });
                let smallest = SymmetricEigen::new(dense).eigenvalues.min();
                assert!(smallest > -1e-9 * dense.abs().max(), "{smallest}");
            }
        }
    }
}

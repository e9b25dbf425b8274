//! Compressible Ogden law of any number of terms, in principal stretches.

use super::curve::{Data, Search, Slope, Start, UniaxialCurve};
use super::definition::{
    Card, Estimated, Law, LawParameter, Range, Role, Shape, ShapeKnown, ShapeScale, Values, Volume,
};
use super::hyperelastic::{Hyperelastic, Tangent};
use super::stability::{Stability, StabilityRange};
use super::volume::{OfVolume, VolumeLogarithm, add_tangent_of_volume, cofactors, lame_lambda_pa, volume_change};
use crate::material::form::ogden_uniaxial;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// The law for files, fits and sensitivities.
pub struct Definition;

impl Law for Definition {
    fn card(&self) -> &'static Card {
        &Card {
            name: "ogden",
            formula: "sum mu/alpha (l1^alpha + l2^alpha + l3^alpha - 3) - (sum mu) ln J + lambda/2 ln^2 J",
            source: "Ogden, Proc. R. Soc. A 328, 1972; Holzapfel, Nonlinear Solid Mechanics, 2000, eq. 6.137",
            parameters: &[
                LawParameter {
                    name: "alpha",
                    meaning: "exponent of the term",
                    role: Role::Shape,
                    range: Range::NOT_ZERO,
                    default: None,
                },
                LawParameter {
                    name: "mu_pa",
                    meaning: "mu of the term, Pa; mu alpha > 0 for a stable term",
                    role: Role::Modulus,
                    range: Range::ANY,
                    default: None,
                },
            ],
            of_terms: true,
            shear_modulus: "half the sum of `mu_pa` times `alpha`",
            continued: true,
        }
    }

    fn shear_modulus_pa(&self, values: &[f64]) -> f64 {
        terms(values).iter().map(|t| 0.5 * t.mu_pa * t.alpha).sum()
    }

    fn solid(&self, values: &[f64], volume: Volume) -> Box<dyn Hyperelastic> {
        let Volume { lame_lambda_pa, inversion_threshold } = volume;
        Box::new(Ogden { terms: terms(values), lame_lambda_pa, inversion_threshold })
    }

    fn curves(&self) -> &'static [&'static dyn UniaxialCurve] {
        &[&UP_TO_5, &UP_TO_50]
    }

    fn measured(&self, _values: &[f64]) -> Option<([f64; 2], Stability)> {
        None
    }

    fn estimated(&self) -> Estimated {
        Estimated::Shaped(&SHAPE)
    }

    fn examples(&self) -> Vec<Values> {
        vec![vec![-4.0, -500.0], vec![-4.7, -300.0, 2.0, 200.0]]
    }
}

/// The exponent of a single term, which may have either sign: mu = mu_1 alpha_1 / 2.
pub static SHAPE: Shape = Shape {
    law: &Definition,
    name: "alpha",
    scale: ShapeScale::Plain,
    known: ShapeKnown::Studies,
    values: |shear_modulus_pa, alpha| vec![alpha, 2.0 * shear_modulus_pa / alpha],
    number: |values| values[0],
    slopes: |alpha| vec![("alpha", 1.0 / alpha), ("mu_pa", -1.0 / alpha)],
};

fn terms(values: &[f64]) -> Vec<OgdenTerm> {
    values.as_chunks().0.iter().map(|&[alpha, mu_pa]| OgdenTerm { alpha, mu_pa }).collect()
}

/// One term, fitted with exponents up to a limit.
pub struct OneTerm {
    name: &'static str,
    limit: f64,
    /// The published program tried these one after the other.
    published_limits: &'static [f64],
}

/// |alpha| <= 5.
pub const UP_TO_5: OneTerm = OneTerm { name: "ogden", limit: 5.0, published_limits: &[5.0] };
/// |alpha| <= 50.
pub const UP_TO_50: OneTerm = OneTerm { name: "ogden-high", limit: 50.0, published_limits: &[5.0, 10.0, 20.0, 50.0] };

/// W = mu/alpha S(l, alpha) with S = l^alpha + 2 l^(-alpha/2) - 3.
/// W'' = mu l^(-alpha/2 - 2) ((alpha - 1) l^(3 alpha/2) + alpha/2 + 1): convex at every stretch for mu > 0 with
/// alpha >= 1 and for mu < 0 with alpha <= -2; the other two statements hold if and only if mu alpha > 0.
impl UniaxialCurve for OneTerm {
    fn name(&self) -> &'static str {
        self.name
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["mu_pa", "alpha"]
    }

    fn energy_pa(&self, parameters: &[f64], stretch: f64) -> f64 {
        parameters[0] / parameters[1] * ogden_uniaxial(stretch, parameters[1])
    }

    fn energy_slope_pa(&self, parameters: &[f64], stretch: f64) -> Slope {
        let (mu, alpha) = (parameters[0], parameters[1]);
        let sum = ogden_uniaxial(stretch, alpha);
        let ln_l = stretch.ln();
        let bend = ln_l * ((alpha * ln_l).exp() - (-0.5 * alpha * ln_l).exp());
        [sum / alpha, mu / alpha * (bend - sum / alpha), 0.0]
    }

    fn stress_pa(&self, parameters: &[f64], l: f64) -> f64 {
        let (mu, alpha) = (parameters[0], parameters[1]);
        mu * (l.powf(alpha - 1.0) - l.powf(-0.5 * alpha - 1.0))
    }

    fn stress_slope_pa(&self, parameters: &[f64], l: f64) -> Slope {
        let (mu, alpha) = (parameters[0], parameters[1]);
        let (up, down) = (l.powf(alpha - 1.0), l.powf(-0.5 * alpha - 1.0));
        [up - down, mu * l.ln() * (up + 0.5 * down), 0.0]
    }

    fn starts(&self, search: Search, data: &Data) -> Vec<Start> {
        const INF: f64 = f64::INFINITY;
        let mut starts = Vec::new();
        match search {
            Search::Published => {
                let up = |limit: &f64| Start::new(&[1000.0, 0.1], &[0.1, 0.1], &[INF, *limit]);
                let down = |limit: &f64| Start::new(&[-1000.0, -2.1], &[-INF, -limit], &[-0.1, -2.1]);
                starts.extend(self.published_limits.iter().map(up));
                starts.extend(self.published_limits.iter().map(down));
            }
            Search::Exact => {
                let (modulus, limit) = (data.modulus_pa, self.limit);
                // Convex at every stretch: mu > 0 with alpha >= 1, or mu < 0 with alpha <= -2. Two starts a branch,
                // since the cost may have a valley at small and another at large exponents.
                for share in [0.1, 0.6] {
                    let (up, down) = (1.0 + share * (limit - 1.0), -2.0 - share * (limit - 2.0));
                    starts.push(Start::new(&[2.0 * modulus / up, up], &[0.0, 1.0], &[INF, limit]));
                    starts.push(Start::new(&[2.0 * modulus / down, down], &[-INF, -limit], &[0.0, -2.0]));
                }
            }
        }
        starts
    }

    fn stability(&self, parameters: &[f64], window: [f64; 2]) -> Stability {
        let (mu, alpha) = (parameters[0], parameters[1]);
        let sign = StabilityRange::of(mu * alpha > 0.0, false);
        let everywhere = (mu > 0.0 && alpha >= 1.0) || (mu < 0.0 && alpha <= -2.0);
        // Linear in z = l^(3 alpha / 2), so its sign at both ends decides.
        let bend = |l: f64| mu * ((alpha - 1.0) * l.powf(1.5 * alpha) + 0.5 * alpha + 1.0) > 0.0;
        Stability {
            energy_grows: sign,
            convex: StabilityRange::of(everywhere, window.into_iter().all(bend)),
            true_stress_rises: sign,
        }
    }

    fn values(&self, parameters: &[f64]) -> Vec<f64> {
        vec![parameters[1], parameters[0]]
    }
}

/// One term mu/alpha (l1^alpha + l2^alpha + l3^alpha - 3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OgdenTerm {
    /// Exponent, not 0.
    pub alpha: f64,
    /// mu of the term, Pa; mu alpha > 0 for a stable term.
    pub mu_pa: f64,
}

/// Psi = sum_p mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) - (sum_p mu_p) ln J + lambda/2 ln^2 J
/// (Ogden, Proc. R. Soc. A 328, 1972; compressible as in Holzapfel, "Nonlinear Solid Mechanics", eq. 6.137).
/// mu = sum_p mu_p alpha_p / 2.
///
/// Equal and nearly equal stretches need no special case: divided differences of powers are formed by expm1/log1p.
#[derive(Clone, Debug, PartialEq)]
pub struct Ogden {
    /// The terms.
    pub terms: Vec<OgdenTerm>,
    /// lambda, Pa.
    pub lame_lambda_pa: f64,
    /// Volume ratio below which ln J is continued by its Taylor polynomial; 0: never. With a threshold, powers are
    /// continued the same way below its cube root.
    pub inversion_threshold: f64,
}

/// F = U diag(stretch) V^T with rotations U, V; the smallest stretch is negative when det F < 0.
struct Principal {
    u: Matrix3<f64>,
    v: Matrix3<f64>,
    /// Stretches - 1.
    extension: Vector3<f64>,
}

impl Principal {
    fn of(h: &Matrix3<f64>) -> Self {
        let f = Matrix3::identity() + h;
        // C - I: its eigenvalues keep the small strains that C would round away.
        let eigen = SymmetricEigen::new(h + h.transpose() + h.transpose() * h);
        let mut ascending = [0, 1, 2];
        ascending.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let mut v = Matrix3::from_fn(|r, c| eigen.eigenvectors[(r, ascending[c])]);
        if v.determinant() < 0.0 {
            v.column_mut(2).neg_mut();
        }
        let mut extension = Vector3::from_fn(|r, _| {
            let e = eigen.eigenvalues[ascending[r]].max(-1.0);
            if e > -0.9 { (0.5 * e.ln_1p()).exp_m1() } else { (1.0 + e).sqrt() - 1.0 }
        });
        let turned = f * v;
        let u0 = turned.column(0).normalize();
        let in_plane = turned.column(1) - u0 * u0.dot(&turned.column(1));
        // A point- or line-shaped element has no second direction of its own: any will do.
        let u1 = in_plane.try_normalize(1e-300).unwrap_or_else(|| {
            let axis = if u0.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
            u0.cross(&axis).normalize()
        });
        let u2 = u0.cross(&u1);
        if turned.column(2).dot(&u2) < 0.0 {
            extension[2] = -extension[2] - 2.0;
        }
        Self { u: Matrix3::from_columns(&[u0, u1, u2]), v, extension }
    }
}

/// x^power for x = 1 + e with derivative, Taylor-continued below `floor` when `floor` > 0.
struct Power {
    power: f64,
    floor: f64,
}

impl Power {
    fn value(&self, e: f64) -> f64 {
        let x = 1.0 + e;
        if x > self.floor {
            return (self.power * e.ln_1p()).exp();
        }
        if self.floor <= 0.0 {
            return f64::INFINITY;
        }
        self.floor.powf(self.power) + self.power * self.floor.powf(self.power - 1.0) * (x - self.floor)
    }

    fn slope(&self, e: f64) -> f64 {
        let x = (1.0 + e).max(self.floor);
        self.power * x.powf(self.power - 1.0)
    }

    /// (value(a) - value(b)) / (a - b), the slope when a = b.
    fn divided_difference(&self, a: f64, b: f64) -> f64 {
        if a == b {
            return self.slope(a);
        }
        let smallest = (1.0 + a).min(1.0 + b);
        if smallest > self.floor {
            let relative = (a - b) / (1.0 + b);
            return self.value(b) * (self.power * relative.ln_1p()).exp_m1() / (a - b);
        }
        (self.value(a) - self.value(b)) / (a - b)
    }
}

impl Ogden {
    /// From terms and Poisson's ratio.
    pub fn new(terms: Vec<OgdenTerm>, poisson_ratio: f64) -> Self {
        let shear: f64 = terms.iter().map(|t| 0.5 * t.mu_pa * t.alpha).sum();
        Self { terms, lame_lambda_pa: lame_lambda_pa(shear, poisson_ratio), inversion_threshold: 0.0 }
    }

    fn of_volume(&self, h: &Matrix3<f64>) -> OfVolume {
        let shear = self.terms.iter().map(|t| t.mu_pa).sum();
        VolumeLogarithm { floor: self.inversion_threshold }.energy(shear, self.lame_lambda_pa, volume_change(h))
    }

    /// d Psi/d l of each term is mu l^(alpha - 1).
    fn slopes(&self) -> impl Iterator<Item = (f64, Power)> + '_ {
        let floor = self.inversion_threshold.cbrt();
        self.terms.iter().map(move |t| (t.mu_pa, Power { power: t.alpha - 1.0, floor }))
    }

    /// Integral of the (continued) slope from 1: (l^alpha - 1) / alpha above the floor.
    fn stretch_energy(&self, e: f64) -> f64 {
        let floor = self.inversion_threshold.cbrt();
        self.terms
            .iter()
            .map(|t| {
                let x = (1.0 + e).max(floor) - 1.0;
                let below = (1.0 + e - floor).min(0.0);
                let regular = if x > -1.0 { (t.alpha * x.ln_1p()).exp_m1() / t.alpha } else { f64::INFINITY };
                let p = Power { power: t.alpha - 1.0, floor };
                let continued = if below < 0.0 {
                    below * p.value(floor - 1.0) + 0.5 * below * below * p.slope(floor - 1.0)
                } else {
                    0.0
                };
                t.mu_pa * (regular + continued)
            })
            .sum()
    }
}

impl Hyperelastic for Ogden {
    fn energy_density_pa(&self, h: &Matrix3<f64>) -> f64 {
        let volume = self.of_volume(h).value;
        if volume == f64::INFINITY {
            return volume;
        }
        let principal = Principal::of(h);
        principal.extension.iter().map(|&e| self.stretch_energy(e)).sum::<f64>() + volume
    }

    fn first_piola_kirchhoff_pa(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let Principal { u, v, extension } = Principal::of(h);
        let stress = extension.map(|e| self.slopes().map(|(mu, p)| mu * p.value(e)).sum());
        let f = Matrix3::identity() + h;
        u * Matrix3::from_diagonal(&stress) * v.transpose() + cofactors(&f) * self.of_volume(h).first
    }

    fn tangent_pa(&self, h: &Matrix3<f64>) -> Tangent {
        let Principal { u, v, extension } = Principal::of(h);
        let stress = extension.map(|e| self.slopes().map(|(mu, p)| mu * p.value(e)).sum::<f64>());
        // In the frame U^T dF V: diagonal entries see their slope; each pair (i, j) splits into a symmetric part that
        // sees the divided difference and a skew part that sees (s_i + s_j) / (l_i + l_j).
        let mut principal = Tangent::zeros();
        for i in 0..3 {
            principal[(4 * i, 4 * i)] = self.slopes().map(|(mu, p)| mu * p.slope(extension[i])).sum();
            for j in (0..3).filter(|&j| j != i) {
                let (a, b) = (extension[i], extension[j]);
                let symmetric: f64 = self.slopes().map(|(mu, p)| mu * p.divided_difference(a, b)).sum();
                let sum = 2.0 + a + b;
                // l_i + l_j -> 0 only for mirrored elements, where the limit is kept finite.
                let skew = (stress[i] + stress[j]) / if sum.abs() < 1e-9 { 1e-9_f64.copysign(sum) } else { sum };
                principal[(i + 3 * j, i + 3 * j)] = 0.5 * (symmetric + skew);
                principal[(i + 3 * j, j + 3 * i)] = 0.5 * (symmetric - skew);
            }
        }
        // vec(U X V^T) = (V kron U) vec(X), column-major.
        let turn = Tangent::from_fn(|row, col| u[(row % 3, col % 3)] * v[(row / 3, col / 3)]);
        let mut tangent = turn * principal * turn.transpose();
        add_tangent_of_volume(&mut tangent, self.of_volume(h), &(Matrix3::identity() + h));
        tangent
    }

    fn small_strain_shear_modulus_pa(&self) -> f64 {
        self.terms.iter().map(|t| 0.5 * t.mu_pa * t.alpha).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::law::check_hyperelastic;

    fn published() -> Ogden {
        Ogden::new(vec![OgdenTerm { alpha: -4.0, mu_pa: -500.0 }], 0.45)
    }

    #[test]
    fn ogden_obeys_the_laws_of_hyperelasticity() {
        check_hyperelastic(&published());
        let two = vec![OgdenTerm { alpha: -4.7, mu_pa: -300.0 }, OgdenTerm { alpha: 2.0, mu_pa: 200.0 }];
        check_hyperelastic(&Ogden::new(two, 0.3));
        check_hyperelastic(&Ogden { inversion_threshold: 0.97, ..published() });
    }

    #[test]
    fn ogden_with_exponent_two_is_neo_hookean() {
        let ogden = Ogden::new(vec![OgdenTerm { alpha: 2.0, mu_pa: 1000.0 }], 0.45);
        let neo = crate::material::law::NeoHookean::new(1000.0, 0.45);
        let h = Matrix3::new(0.12, -0.05, 0.08, 0.03, -0.09, 0.06, -0.07, 0.1, 0.05);
        assert!((ogden.energy_density_pa(&h) - neo.energy_density_pa(&h)).abs() < 1e-11 * 1000.0);
        assert!((ogden.first_piola_kirchhoff_pa(&h) - neo.first_piola_kirchhoff_pa(&h)).abs().max() < 1e-9);
        assert!((ogden.tangent_pa(&h) - neo.tangent_pa(&h)).abs().max() < 1e-8);
    }
}

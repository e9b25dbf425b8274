//! Numbers that carry their first and second derivatives, so that each energy is written once.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// What an energy needs of a number: a plain `f64`, or a [`Jet`] that carries derivatives along.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// A constant.
    fn constant(value: f64) -> Self;
    /// e^x - 1 without cancellation at 0.
    #[must_use]
    fn exp_m1(self) -> Self;
    /// ln(1 + x) without cancellation at 0; not a number below -1.
    #[must_use]
    fn ln_1p(self) -> Self;
    /// x^p, x > 0.
    #[must_use]
    fn powf(self, exponent: f64) -> Self;
    /// ln x.
    #[must_use]
    fn ln(self) -> Self;
}

impl Number for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn exp_m1(self) -> Self {
        self.exp_m1()
    }
    fn ln_1p(self) -> Self {
        self.ln_1p()
    }
    fn powf(self, exponent: f64) -> Self {
        self.powf(exponent)
    }
    fn ln(self) -> Self {
        self.ln()
    }
}

/// A value with its gradient and Hessian in three variables (forward differentiation of second order).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// The value.
    pub value: f64,
    /// First derivatives.
    pub gradient: [f64; 3],
    /// Second derivatives, symmetric.
    pub hessian: [[f64; 3]; 3],
}

impl Jet {
    /// The variable of this index (0, 1, 2).
    pub fn variable(value: f64, index: usize) -> Self {
        let mut jet = Self::constant(value);
        jet.gradient[index] = 1.0;
        jet
    }

    /// f(self) from f, f' and f'' at the value.
    fn chain(self, value: f64, first: f64, second: f64) -> Self {
        let g = self.gradient;
        Self {
            value,
            gradient: g.map(|d| first * d),
            hessian: std::array::from_fn(|i| {
                std::array::from_fn(|j| first * self.hessian[i][j] + second * g[i] * g[j])
            }),
        }
    }

    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            value: f(self.value, other.value),
            gradient: std::array::from_fn(|i| f(self.gradient[i], other.gradient[i])),
            hessian: std::array::from_fn(|i| std::array::from_fn(|j| f(self.hessian[i][j], other.hessian[i][j]))),
        }
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.map2(other, |a, b| a + b)
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.map2(other, |a, b| a - b)
    }
}

impl Mul for Jet {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl, reason = "the product rule adds")]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self, other);
        Self {
            value: a.value * b.value,
            gradient: std::array::from_fn(|i| a.gradient[i] * b.value + a.value * b.gradient[i]),
            hessian: std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    a.hessian[i][j] * b.value
                        + a.gradient[i] * b.gradient[j]
                        + a.gradient[j] * b.gradient[i]
                        + a.value * b.hessian[i][j]
                })
            }),
        }
    }
}

impl Div for Jet {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let inverse = 1.0 / other.value;
        self * other.chain(inverse, -inverse * inverse, 2.0 * inverse * inverse * inverse)
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Add<f64> for Jet {
    type Output = Self;
    fn add(mut self, constant: f64) -> Self {
        self.value += constant;
        self
    }
}

impl Sub<f64> for Jet {
    type Output = Self;
    fn sub(self, constant: f64) -> Self {
        self + -constant
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self.chain(factor * self.value, factor, 0.0)
    }
}

impl Number for Jet {
    fn constant(value: f64) -> Self {
        Self { value, gradient: [0.0; 3], hessian: [[0.0; 3]; 3] }
    }
    fn exp_m1(self) -> Self {
        let slope = self.value.exp();
        self.chain(self.value.exp_m1(), slope, slope)
    }
    fn ln_1p(self) -> Self {
        let slope = 1.0 / (1.0 + self.value);
        self.chain(self.value.ln_1p(), slope, -slope * slope)
    }
    fn powf(self, exponent: f64) -> Self {
        let x = self.value;
        let second = exponent * (exponent - 1.0) * x.powf(exponent - 2.0);
        self.chain(x.powf(exponent), exponent * x.powf(exponent - 1.0), second)
    }
    fn ln(self) -> Self {
        let slope = 1.0 / self.value;
        self.chain(self.value.ln(), slope, -slope * slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jet_derivatives_are_those_of_calculus() {
        // f = ln(1 + x y) / z + x^2.5 - (e^y - 1).
        let f = |v: [f64; 3]| (v[0] * v[1]).ln_1p() / v[2] + v[0].powf(2.5) - v[1].exp_m1();
        let at = [1.3, 0.7, 2.1];
        let [x, y, z] = [0, 1, 2].map(|i| Jet::variable(at[i], i));
        let jet = (x * y).ln_1p() / z + Number::powf(x, 2.5) - Number::exp_m1(y);
        assert!((jet.value - f(at)).abs() < 1e-14);
        let shifted = |i: usize, a: f64, j: usize, b: f64| {
            let mut p = at;
            p[i] += a;
            p[j] += b;
            f(p)
        };
        let h = 1e-4;
        for i in 0..3 {
            let slope = (shifted(i, h, i, 0.0) - shifted(i, -h, i, 0.0)) / (2.0 * h);
            assert!((jet.gradient[i] - slope).abs() < 1e-7, "{i}");
            for j in 0..3 {
                let bend = (shifted(i, h, j, h) - shifted(i, h, j, -h) - shifted(i, -h, j, h) + shifted(i, -h, j, -h))
                    / (4.0 * h * h);
                assert!((jet.hessian[i][j] - bend).abs() < 1e-5, "{i} {j}");
            }
        }
    }
}

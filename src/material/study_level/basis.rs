//! The functions of Hencky strain that means and differences of curves are made of.

use std::f64::consts::PI;

/// Level, step between compression and tension, slope, slope apart on either side.
pub(super) const LEVEL: usize = 0;
pub(super) const STEP: usize = 1;
pub(super) const SLOPE: usize = 2;
pub(super) const BEND: usize = 3;
/// Where the remainder begins.
pub(super) const REMAINDER: usize = 4;
/// Sines of the remainder: the tenth has a wavelength of .32, below what curves with the lengthscale here show.
const SINES: usize = 10;
/// Half the interval on which the remainder lives, in Hencky strain: beyond every window of the literature (.55 to 1.45).
const HALF_WIDTH: f64 = 0.8;
/// Lengthscale of the remainder, in Hencky strain: curves of polynomials and exponentials bend over a fifth or more.
const LENGTHSCALE: f64 = 0.2;

/// How many functions there are.
pub const SIZE: usize = REMAINDER + SINES;

/// The functions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Basis;

impl Basis {
    /// Their values at a Hencky strain x = ln l: 1, sign(x)/2, x, |x|, then the sines less their value at rest. What a curve is
    /// at rest is its level's alone: sines that are not zero there would be a second level, as large as the ends of wide windows
    /// ask for.
    pub fn at(self, x: f64) -> [f64; SIZE] {
        let mut values = [0.0; SIZE];
        values[LEVEL] = 1.0;
        values[STEP] = 0.5 * if x > 0.0 { 1.0 } else { -1.0 };
        values[SLOPE] = x;
        values[BEND] = x.abs();
        for (n, value) in values[REMAINDER..].iter_mut().enumerate() {
            let sine = |x: f64| (frequency(n) * (x + HALF_WIDTH)).sin() / HALF_WIDTH.sqrt();
            *value = sine(x) - sine(0.0);
        }
        values
    }

    /// The variance of each function's coefficient at unit spread: for the sines the spectral density of a Gaussian process
    /// with a squared-exponential kernel.
    pub fn weights(self) -> [f64; SIZE] {
        let mut weights = [1.0; SIZE];
        for (n, weight) in weights[REMAINDER..].iter_mut().enumerate() {
            let phase = frequency(n) * LENGTHSCALE;
            *weight = (2.0 * PI).sqrt() * LENGTHSCALE * (-0.5 * phase * phase).exp();
        }
        weights
    }
}

fn frequency(n: usize) -> f64 {
    PI * (n + 1) as f64 / (2.0 * HALF_WIDTH)
}

//! Quasi-random numbers: Halton's sequence and the normal law's quantiles. The same numbers every time, on any machine.

use crate::material::random::CounterRng;

/// Bases of the dimensions: two draws of up to twelve unknowns.
const PRIMES: [u32; 24] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89];

/// Number `index` (from 0) of Halton's sequence in one dimension (0 to 23), above 0 and below 1: the digits of the number
/// mirrored at the point (Halton, Numerische Mathematik 2, 1960). Point 0, the origin, is left out.
pub fn halton(index: usize, dimension: usize) -> f64 {
    let base = PRIMES[dimension % PRIMES.len()] as usize;
    let (mut rest, mut place, mut sum) = (index + 1, 1.0, 0.0);
    while rest > 0 {
        place /= base as f64;
        sum += place * (rest % base) as f64;
        rest /= base;
    }
    sum
}

/// The number below which a standard normal variable lies with this probability, good to 2e-9 of itself (Acklam's rational
/// approximation).
pub fn inverse_normal(probability: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969_683_028_665_376e1,
        2.209_460_984_245_205e2,
        -2.759_285_104_469_687e2,
        1.383_577_518_672_69e2,
        -3.066_479_806_614_716e1,
        2.506_628_277_459_239,
    ];
    const B: [f64; 6] = [
        -5.447_609_879_822_406e1,
        1.615_858_368_580_409e2,
        -1.556_989_798_598_866e2,
        6.680_131_188_771_972e1,
        -1.328_068_155_288_572e1,
        1.0,
    ];
    const C: [f64; 6] = [
        -7.784_894_002_430_293e-3,
        -3.223_964_580_411_365e-1,
        -2.400_758_277_161_838,
        -2.549_732_539_343_734,
        4.374_664_141_464_968,
        2.938_163_982_698_783,
    ];
    const D: [f64; 5] =
        [7.784_695_709_041_462e-3, 3.224_671_290_700_398e-1, 2.445_134_137_142_996, 3.754_408_661_907_416, 1.0];
    const TAIL: f64 = 0.024_25;
    let horner = |coefficients: &[f64], x: f64| coefficients.iter().fold(0.0, |sum, c| sum * x + c);
    let tail = |p: f64| {
        let q = (-2.0 * p.ln()).sqrt();
        horner(&C, q) / horner(&D, q)
    };
    if probability < TAIL {
        tail(probability)
    } else if probability > 1.0 - TAIL {
        -tail(1.0 - probability)
    } else {
        let q = probability - 0.5;
        q * horner(&A, q * q) / horner(&B, q * q)
    }
}

/// Standard normal numbers of one draw, in the dimensions from `first` on.
pub fn normals(index: usize, first: usize, dimensions: usize) -> Vec<f64> {
    normals_of(0, index, first, dimensions)
}

/// The same of a seed. Seed 0 has Halton's own points, any other those turned in every dimension by a part of the whole that it
/// draws (Cranley and Patterson, SIAM Journal on Numerical Analysis 13, 1976): as evenly spread, and independent of each other's.
pub fn normals_of(seed: u64, index: usize, first: usize, dimensions: usize) -> Vec<f64> {
    let turned = |d: usize| match seed {
        0 => halton(index, d),
        // A normal variable has no number at either end.
        seed => (halton(index, d) + CounterRng::new(seed, d as u64).uniform(0)).fract().clamp(1e-12, 1.0 - 1e-12),
    };
    (first..first + dimensions).map(|d| inverse_normal(turned(d))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_numbers_are_haltons() {
        let first = |d| (0..4).map(|n| halton(n, d)).collect::<Vec<_>>();
        assert_eq!(first(0), [0.5, 0.25, 0.75, 0.125]);
        assert!(first(1).iter().zip([1.0 / 3.0, 2.0 / 3.0, 1.0 / 9.0, 4.0 / 9.0]).all(|(a, b)| (a - b).abs() < 1e-15));
    }

    #[test]
    fn quantiles_of_the_normal_law_are_those_of_tables() {
        for (p, z) in [
            (0.5, 0.0),
            (0.975, 1.959_963_984_540_054),
            (0.001, -3.090_232_306_167_813),
            (0.84, 0.994_457_883_209_753_4),
        ] {
            assert!((inverse_normal(p) - z).abs() < 1e-8, "{p}: {}", inverse_normal(p));
            assert!((inverse_normal(p) + inverse_normal(1.0 - p)).abs() < 1e-8);
        }
    }

    #[test]
    fn a_seed_turns_the_points_and_leaves_them_as_even_and_none_is_haltons() {
        assert_eq!(normals_of(0, 5, 2, 3), normals(5, 2, 3));
        let of = |seed: u64| (0..256).map(|n| normals_of(seed, n, 0, 7)).collect::<Vec<_>>();
        assert!(of(1) == of(1) && of(1) != of(2) && of(1) != of(0));
        for draws in [of(1), of(2)] {
            let mean = |f: &dyn Fn(&[f64]) -> f64| draws.iter().map(|z| f(z)).sum::<f64>() / 256.0;
            for a in 0..7 {
                assert!(mean(&|z| z[a]).abs() < 0.1 && (mean(&|z| z[a] * z[a]) - 1.0).abs() < 0.1, "{a}");
                assert!((0..a).all(|b| mean(&|z| z[a] * z[b]).abs() < 0.12), "{a}");
            }
        }
    }

    #[test]
    fn a_hundred_draws_have_nearly_the_moments_of_the_normal_law_and_hang_together_in_no_pair_of_dimensions() {
        let draws: Vec<Vec<f64>> = (0..256).map(|n| normals(n, 0, 7)).collect();
        let mean = |f: &dyn Fn(&[f64]) -> f64| draws.iter().map(|z| f(z)).sum::<f64>() / 256.0;
        for a in 0..7 {
            assert!(mean(&|z| z[a]).abs() < 0.1 && (mean(&|z| z[a] * z[a]) - 1.0).abs() < 0.1, "{a}");
            assert!((0..a).all(|b| mean(&|z| z[a] * z[b]).abs() < 0.12), "{a}");
        }
    }
}

//! The invariants that isochoric energies are written in, shifted to vanish at rest.

use super::number::Number;

/// I1 - 3 = l^2 + 2/l - 3 on the uniaxial isochoric path, as (l - 1)^2 (l + 2) / l: no cancellation near rest.
pub fn first_uniaxial<N: Number>(stretch: N) -> N {
    let strain = stretch - 1.0;
    strain * strain * (stretch + 2.0) / stretch
}

/// I2 - 3 = 2 l + l^-2 - 3 on the uniaxial isochoric path, as (l - 1)^2 (2 l + 1) / l^2.
pub fn second_uniaxial<N: Number>(stretch: N) -> N {
    let strain = stretch - 1.0;
    strain * strain * (stretch * 2.0 + 1.0) / (stretch * stretch)
}

/// S(l, a) = l^a + 2 l^(-a/2) - 3 on the uniaxial isochoric path: I1 - 3 at the stretch l^(a/2).
pub fn ogden_uniaxial<N: Number>(stretch: N, alpha: f64) -> N {
    let strain = (stretch.ln() * (0.5 * alpha)).exp_m1();
    strain * strain * (strain + 3.0) / (strain + 1.0)
}

/// Stretches without their change of volume, l_i J^(-1/3), and J.
pub fn isochoric<N: Number>(stretches: [N; 3]) -> ([N; 3], N) {
    let volume_ratio = stretches[0] * stretches[1] * stretches[2];
    let scale = volume_ratio.powf(-1.0 / 3.0);
    (stretches.map(|l| l * scale), volume_ratio)
}

/// Sum over the three stretches of l^a - 1.
pub fn power_sum<N: Number>(stretches: [N; 3], alpha: f64) -> N {
    let [a, b, c] = stretches.map(|l| (l.ln() * alpha).exp_m1());
    a + b + c
}

/// I1 - 3 of isochoric stretches.
pub fn first<N: Number>(stretches: [N; 3]) -> N {
    power_sum(stretches, 2.0)
}

/// I2 - 3 of isochoric stretches: sum of l^-2 - 1.
pub fn second<N: Number>(stretches: [N; 3]) -> N {
    power_sum(stretches, -2.0)
}

//! Smooth noise over space, from the counter random numbers that the whole program draws from.

use crate::material::random::CounterRng;

/// Noise that varies smoothly over space: hashed values in -1..1 on a cubic lattice, blended by a smooth step.
#[derive(Clone, Copy, Debug)]
pub struct SmoothNoise {
    rng: CounterRng,
    /// Lattice points per mm.
    per_mm: f64,
}

impl SmoothNoise {
    /// Noise whose features are about `size_mm` wide.
    pub fn new(rng: CounterRng, size_mm: f64) -> Self {
        Self { rng, per_mm: 1.0 / size_mm }
    }

    /// The value in -1..1 at a point in mm.
    pub fn at(&self, mm: [f64; 3]) -> f64 {
        let scaled = mm.map(|x| x * self.per_mm);
        let base = scaled.map(|x| x.floor() as i64);
        let weight = [0, 1, 2].map(|a| {
            let t = scaled[a] - base[a] as f64;
            t * t * (3.0 - 2.0 * t)
        });
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut counter = 0u64;
            let mut w = 1.0;
            for a in 0..3 {
                let up = corner >> a & 1;
                // 21 bits per axis: the lattice is 2 million points wide.
                counter = counter << 21 | ((base[a] + up) as u64 & 0x1f_ffff);
                w *= if up == 1 { weight[a] } else { 1.0 - weight[a] };
            }
            sum += w * (2.0 * self.rng.uniform(counter) - 1.0);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_noise_is_continuous_and_fills_its_range() {
        let noise = SmoothNoise::new(CounterRng::new(5, 1), 10.0);
        let (mut low, mut high) = (0f64, 0f64);
        for n in -20_000..20_000 {
            let x = f64::from(n) * 0.01;
            let value = noise.at([x, 0.3 * x, -0.7 * x]);
            assert!((noise.at([x + 0.01, 0.3 * x, -0.7 * x]) - value).abs() < 0.01);
            low = low.min(value);
            high = high.max(value);
        }
        assert!(low < -0.5 && high > 0.5 && low >= -1.0 && high <= 1.0, "{low} {high}");
    }
}

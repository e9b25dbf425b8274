//! Random numbers that are a function of (seed, stream, counter).
//!
//! Nothing is drawn in turn: draw n is the same whichever thread asks first. The mixing function is the finaliser
//! of splitmix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014), applied to the
//! counter under a key that is itself mixed from seed and stream.

/// One stream of numbers; streams of one seed are independent of each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CounterRng {
    key: u64,
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The odd number nearest to 2^64 over the golden ratio: counters one apart become keys far apart.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

impl CounterRng {
    /// The stream `stream` of `seed`.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { key: mix(mix(seed.wrapping_add(STEP)).wrapping_add(stream.wrapping_mul(STEP))) }
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&self, counter: u64) -> u64 {
        mix(self.key ^ mix(counter.wrapping_add(1).wrapping_mul(STEP)))
    }

    /// Uniform in [0, 1).
    #[inline]
    pub fn uniform(&self, counter: u64) -> f64 {
        // 53 bits fill an f64.
        (self.bits(counter) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    #[inline]
    pub fn between(&self, counter: u64, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform(counter)
    }

    /// Two independent standard normal numbers (Box and Muller, 1958).
    #[inline]
    pub fn normal_pair(&self, counter: u64) -> [f64; 2] {
        // 1 - u lies in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * (1.0 - self.uniform(counter.wrapping_mul(2))).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform(counter.wrapping_mul(2).wrapping_add(1))).sin_cos();
        [radius * cos, radius * sin]
    }

    /// One standard normal number.
    #[inline]
    pub fn normal(&self, counter: u64) -> f64 {
        self.normal_pair(counter)[0]
    }

    /// A unit vector, uniform on the sphere.
    pub fn direction(&self, counter: u64) -> [f64; 3] {
        let z = 2.0 * self.uniform(counter.wrapping_mul(2)) - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * self.uniform(counter.wrapping_mul(2).wrapping_add(1))).sin_cos();
        let r = (1.0 - z * z).sqrt();
        [r * cos, r * sin, z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_law() {
        let rng = CounterRng::new(7, 3);
        let n = 200_000;
        let mut moment = [0.0; 5];
        let mut cross = 0.0;
        for counter in 0..n {
            let [a, b] = rng.normal_pair(counter);
            for (p, m) in moment.iter_mut().enumerate() {
                *m += a.powi(p as i32) / n as f64;
            }
            cross += a * b / n as f64;
        }
        for (p, expected) in [1.0, 0.0, 1.0, 0.0, 3.0].into_iter().enumerate() {
            assert!((moment[p] - expected).abs() < 0.05, "moment {p}: {}", moment[p]);
        }
        assert!(cross.abs() < 0.01);
    }

    #[test]
    fn streams_and_seeds_are_uncorrelated_and_repeatable() {
        let correlation = |a: CounterRng, b: CounterRng| {
            (0..50_000).map(|n| (a.uniform(n) - 0.5) * (b.uniform(n) - 0.5) * 12.0).sum::<f64>() / 50_000.0
        };
        assert!(correlation(CounterRng::new(1, 0), CounterRng::new(1, 1)).abs() < 0.02);
        assert!(correlation(CounterRng::new(1, 0), CounterRng::new(2, 0)).abs() < 0.02);
        assert!((correlation(CounterRng::new(1, 0), CounterRng::new(1, 0)) - 1.0).abs() < 0.02);
        // Bits of neighbouring counters differ in half of the places.
        let rng = CounterRng::new(0, 0);
        let flips: u32 = (0..10_000).map(|n| (rng.bits(n) ^ rng.bits(n + 1)).count_ones()).sum();
        assert!((f64::from(flips) / 320_000.0 - 1.0).abs() < 0.01);
    }
}

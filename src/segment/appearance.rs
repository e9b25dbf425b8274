//! What intensity says of a voxel's content: full of one tissue, or shared by two that meet in it.
//!
//! A voxel shared by two tissues has an intensity anywhere between theirs, equally likely all along, blurred by the noise
//! (Shattuck et al., "Magnetic resonance image tissue classification using a partial volume model", NeuroImage 13(5),
//! 2001). Without such voxels in the model the border of the cortex counts as bright CSF, draws CSF's mean up, and the
//! cortex thins.

/// CSF, grey matter, white matter.
pub(super) const CLASSES: usize = 3;
pub(super) const CSF: usize = 0;
pub(super) const GREY: usize = 1;
pub(super) const WHITE: usize = 2;

/// Tissues that meet: CSF and grey, grey and white.
const PAIRS: [(usize, usize); 2] = [(CSF, GREY), (GREY, WHITE)];
/// Intensities at which the likelihoods are tabulated.
const ENTRIES: usize = 1024;
/// Shares at which the likelihood of a mixed voxel is summed.
const SHARES: usize = 64;

/// Likelihoods of an intensity: of each pure tissue, then of each pair.
type Likelihood = [f64; CLASSES + PAIRS.len()];

/// Likelihoods as functions of intensity, for given means and standard deviations of the pure tissues.
pub(super) struct Appearance {
    means: [f64; CLASSES],
    first: f64,
    per_entry: f64,
    table: Vec<Likelihood>,
}

/// What is thought of one voxel.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    /// Probability of being full of each tissue; the rest is mixed.
    pub pure: [f64; CLASSES],
    /// Expected share of each tissue; the sum is 1.
    pub content: [f64; CLASSES],
}

impl Appearance {
    pub(super) fn new(means: &[f64; CLASSES], deviations: &[f64; CLASSES]) -> Self {
        // Darker than CSF is CSF (or air), brighter than white matter is white matter (or a vessel): the outer classes
        // are flat beyond their means, so the table need not go on.
        let (first, last) = (means[CSF] - 4.0 * deviations[CSF], means[WHITE] + 4.0 * deviations[WHITE]);
        let per_entry = (last - first) / (ENTRIES - 1) as f64;
        let at = |x: f64| {
            let mut out = [0.0; CLASSES + PAIRS.len()];
            for k in 0..CLASSES {
                let beyond = (k == CSF && x < means[k]) || (k == WHITE && x > means[k]);
                out[k] = normal(if beyond { means[k] } else { x }, means[k], deviations[k]);
            }
            for (pair, &(a, b)) in out[CLASSES..].iter_mut().zip(&PAIRS) {
                let mixed = |n: usize| {
                    let share = (n as f64 + 0.5) / SHARES as f64;
                    let mean = means[a] + share * (means[b] - means[a]);
                    let variance = deviations[a].powi(2) + share * (deviations[b].powi(2) - deviations[a].powi(2));
                    normal(x, mean, variance.sqrt())
                };
                *pair = (0..SHARES).map(mixed).sum::<f64>() / SHARES as f64;
            }
            out
        };
        let table = (0..ENTRIES).map(|n| at(first + n as f64 * per_entry)).collect();
        Self { means: *means, first, per_entry, table }
    }

    /// The content of a voxel of intensity `value`; `believed` is the prior of the tissues, `field` what its neighbours add
    /// to it. Each half of a voxel is drawn from both: halves alike make a pure voxel.
    #[inline]
    pub(super) fn seen(&self, value: f32, believed: &[f32; CLASSES], field: &[f64; CLASSES]) -> Seen {
        let value = f64::from(value);
        let likelihood = self.likelihood(value);
        let prior: [f64; CLASSES] = std::array::from_fn(|k| f64::from(believed[k]) * field[k]);
        let mut pure: [f64; CLASSES] = std::array::from_fn(|k| prior[k] * prior[k] * likelihood[k] + 1e-12);
        let mixed: [f64; PAIRS.len()] =
            std::array::from_fn(|n| 2.0 * prior[PAIRS[n].0] * prior[PAIRS[n].1] * likelihood[CLASSES + n]);
        let sum: f64 = pure.iter().sum::<f64>() + mixed.iter().sum::<f64>();
        pure = pure.map(|p| p / sum);
        let mut content = pure;
        for (&(a, b), mixed) in PAIRS.iter().zip(mixed) {
            let share = ((value - self.means[a]) / (self.means[b] - self.means[a])).clamp(0.0, 1.0);
            content[a] += (1.0 - share) * mixed / sum;
            content[b] += share * mixed / sum;
        }
        Seen { pure, content }
    }

    /// The table between its entries, linearly; constant beyond its ends.
    #[inline]
    fn likelihood(&self, value: f64) -> Likelihood {
        let at = ((value - self.first) / self.per_entry).clamp(0.0, (ENTRIES - 1) as f64);
        let n = (at as usize).min(ENTRIES - 2);
        let w = at - n as f64;
        let (a, b) = (&self.table[n], &self.table[n + 1]);
        std::array::from_fn(|k| a[k] + w * (b[k] - a[k]))
    }
}

fn normal(x: f64, mean: f64, deviation: f64) -> f64 {
    (-0.5 * ((x - mean) / deviation).powi(2)).exp() / deviation
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANYTHING: [f32; CLASSES] = [1.0 / 3.0; CLASSES];

    fn content(value: f32) -> [f64; CLASSES] {
        Appearance::new(&[40.0, 120.0, 180.0], &[8.0, 7.0, 6.0]).seen(value, &ANYTHING, &[1.0; CLASSES]).content
    }

    #[test]
    fn half_way_between_two_tissues_a_voxel_holds_half_of_each() {
        let [csf, grey, _] = content(80.0);
        assert!((csf - 0.5).abs() < 0.02 && (grey - 0.5).abs() < 0.02, "{csf} {grey}");
        let [_, grey, white] = content(150.0);
        assert!((grey - 0.5).abs() < 0.05 && (white - 0.5).abs() < 0.05, "{grey} {white}");
    }

    #[test]
    fn shares_sum_to_one_and_rise_with_the_intensity() {
        let mut before = 0.0;
        for value in (0..250u8).map(f32::from) {
            let [csf, grey, white] = content(value);
            assert!((csf + grey + white - 1.0).abs() < 1e-9);
            let brightness = 0.5 * grey + white;
            assert!(brightness > before - 1e-3, "{brightness} after {before} at {value}");
            before = brightness;
        }
        assert!(content(20.0)[CSF] > 0.99 && content(220.0)[WHITE] > 0.99);
    }
}

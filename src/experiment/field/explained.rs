//! Which share of what the images show a model explains.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Edge of the blocks that are left out in turn, mm: errors of a registration are alike over less than half of it.
const BLOCK_MM: f64 = 40.0;
/// How much larger than its noise a seen displacement must be for a share of it to mean anything.
const CLEAR: f64 = 2.0;

/// The share of the seen displacement that a model explains: 1 - sum |seen - model|^2 / sum |seen|^2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Explained {
    /// The share; absent where the seen displacement does not stand out from its noise: then it is not measurable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<f64>,
    /// Its standard error (jackknife over blocks of 40 mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share_sd: Option<f64>,
    /// Root mean square of the seen displacement, mm.
    pub seen_rms_mm: f64,
    /// Root mean square of its noise, mm.
    pub noise_rms_mm: f64,
    /// Root mean square of what the model leaves, mm.
    pub left_rms_mm: f64,
    /// Nodes that were compared.
    pub nodes: usize,
}

/// Compares nodes given as place, seen and modelled displacement, and standard deviation of a seen component, all mm.
pub fn explained(nodes: impl Iterator<Item = ([f64; 3], [f64; 3], [f64; 3], f64)>) -> Explained {
    let mut blocks: BTreeMap<[i64; 3], [f64; 2]> = BTreeMap::new();
    let (mut seen, mut left, mut noise, mut count) = (0.0, 0.0, 0.0, 0usize);
    for (x, u, model, sd) in nodes {
        let of_seen: f64 = u.iter().map(|v| v * v).sum();
        let of_left: f64 = (0..3).map(|a| (u[a] - model[a]).powi(2)).sum();
        let block = blocks.entry(x.map(|v| (v / BLOCK_MM).floor() as i64)).or_default();
        (block[0], block[1]) = (block[0] + of_seen, block[1] + of_left);
        (seen, left, noise, count) = (seen + of_seen, left + of_left, noise + 3.0 * sd * sd, count + 1);
    }
    let rms = |sum: f64| (sum / count.max(1) as f64).sqrt();
    let (seen_rms_mm, noise_rms_mm) = (rms(seen), rms(noise));
    let clear = seen_rms_mm > CLEAR * noise_rms_mm && blocks.len() > 2;
    let share = clear.then(|| 1.0 - left / seen);
    let share_sd = share.map(|share| {
        let n = blocks.len() as f64;
        let without = |b: &[f64; 2]| 1.0 - (left - b[1]) / (seen - b[0]).max(f64::MIN_POSITIVE);
        let squares: f64 = blocks.values().map(|b| (without(b) - share).powi(2)).sum();
        ((n - 1.0) / n * squares).sqrt()
    });
    Explained { share, share_sd, seen_rms_mm, noise_rms_mm, left_rms_mm: rms(left), nodes: count }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::random::CounterRng;

    fn nodes(model: f64, noise: f64, shift: f64) -> impl Iterator<Item = ([f64; 3], [f64; 3], [f64; 3], f64)> {
        (0..4000).map(move |n| {
            let rng = CounterRng::new(1, n);
            let x = [0, 1, 2].map(|a| rng.between(a, -70.0, 70.0));
            let u = [0.0, shift * (1.0 + x[1] / 200.0), 0.0];
            let seen = [0, 1, 2].map(|a| u[a] + noise * 1.73 * (2.0 * rng.uniform(10 + a as u64) - 1.0));
            (x, seen, u.map(|v| model * v), noise)
        })
    }

    #[test]
    fn a_model_of_the_whole_shift_explains_nearly_all_and_half_of_it_three_quarters() {
        let all = explained(nodes(1.0, 0.2, 3.0));
        assert!((all.share.unwrap() - (1.0 - 0.12 / 9.4)).abs() < 0.01, "{all:?}");
        let half = explained(nodes(0.5, 0.2, 3.0));
        assert!((half.share.unwrap() - 0.75).abs() < 0.02 && half.share_sd.unwrap() < 0.02, "{half:?}");
        let none = explained(nodes(0.0, 0.2, 3.0));
        assert!(none.share.unwrap().abs() < 1e-9);
        assert!(explained(nodes(-1.0, 0.2, 3.0)).share.unwrap() < -2.0, "the wrong way is worse than nothing");
    }

    #[test]
    fn where_nothing_has_moved_a_share_is_not_measurable() {
        let still = explained(nodes(1.0, 0.2, 0.0));
        assert_eq!((still.share, still.share_sd), (None, None));
        assert_eq!(explained(std::iter::empty()).share, None);
    }
}

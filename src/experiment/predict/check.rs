//! How far a prediction's draws are off: some solved whole.

use super::spread::{length, spread, weighed_quantile};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Draws as they are predicted against the same draws solved whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// How the brain was supported.
    pub supports: String,
    /// Draws that were solved.
    pub solves: usize,
    /// Root mean square of the displacement over nodes and draws, mm.
    pub displacement_rms_mm: f64,
    /// The same of the difference, mm.
    pub difference_rms_mm: f64,
    /// Difference of the means over these draws, in parts of the spread's own size at the node: 95 % of the nodes lie below.
    /// Absent below eight draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_off_95: Option<f64>,
    /// The same of the standard deviations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd_off_95: Option<f64>,
}

/// Fewer draws have no spread to speak of.
const FEWEST: usize = 8;

/// One draw, read and solved: displacement of every node, mm.
pub type Pair = (Vec<[f64; 3]>, Vec<[f64; 3]>);

/// Compares `(read, solved)` displacements of the same draws, mm.
pub fn checked(supports: &str, pairs: &[Pair]) -> Check {
    let nodes = pairs.first().map_or(0, |(read, _)| read.len());
    let (mut of_all, mut of_difference) = (0.0, 0.0);
    for (read, solved) in pairs {
        for (r, s) in read.iter().zip(solved) {
            of_all += length(s).powi(2);
            of_difference += (0..3).map(|i| (r[i] - s[i]).powi(2)).sum::<f64>();
        }
    }
    let count = (pairs.len() * nodes).max(1) as f64;
    let (mut mean_off_95, mut sd_off_95) = (None, None);
    if pairs.len() >= FEWEST {
        let of = |pick: &dyn Fn(&Pair) -> Vec<[f64; 3]>| {
            let draws: Vec<(f64, Vec<[f64; 3]>)> = pairs.iter().map(|pair| (1.0, pick(pair))).collect();
            spread(&draws, nodes, 1.0)
        };
        let (read, solved) = (of(&|pair| pair.0.clone()), of(&|pair| pair.1.clone()));
        // Nodes that are held have no spread to compare with.
        let free: Vec<usize> = (0..nodes).filter(|&n| solved.sd_mm[n] > 0.0).collect();
        let worst = |off: &dyn Fn(usize) -> f64| {
            let mut all: Vec<(f64, f64)> = free.iter().map(|&n| (off(n) / solved.sd_mm[n], 1.0)).collect();
            Some(weighed_quantile(&mut all, 0.95))
        };
        mean_off_95 = worst(&|n| length(&[0, 1, 2].map(|i| read.mean_mm[n][i] - solved.mean_mm[n][i])));
        sd_off_95 = worst(&|n| (read.sd_mm[n] - solved.sd_mm[n]).abs());
    }
    Check {
        supports: supports.to_owned(),
        solves: pairs.len(),
        displacement_rms_mm: (of_all / count).sqrt(),
        difference_rms_mm: (of_difference / count).sqrt(),
        mean_off_95,
        sd_off_95,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_that_are_a_tenth_off_are_told_to_be() {
        let pair = |n: usize| {
            let u = [1.0 + 0.1 * n as f64, 0.0, 0.0];
            (vec![u.map(|x| 1.1 * x), [0.0; 3]], vec![u, [0.0; 3]])
        };
        let pairs: Vec<_> = (0..11).map(pair).collect();
        let found = checked("fixed", &pairs);
        assert!((found.difference_rms_mm / found.displacement_rms_mm - 0.1).abs() < 1e-9);
        // Mean 1.5, spread .316.
        assert!(
            (found.sd_off_95.unwrap() - 0.1).abs() < 1e-9
                && (found.mean_off_95.unwrap() - 0.15 / 0.1f64.sqrt()).abs() < 1e-9
        );
        assert_eq!(checked("fixed", &pairs[..2]).mean_off_95, None);
    }
}

//! What draws say of every node: the mean, its spread, how far it may go.

use rayon::prelude::*;

/// Weighed displacements of the same nodes, mm.
pub type Draws = [(f64, Vec<[f64; 3]>)];

/// The spread of every node's displacement.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(clippy::struct_field_names, reason = "the unit is in the name")]
pub struct Spread {
    /// Mean displacement, mm.
    pub mean_mm: Vec<[f64; 3]>,
    /// Root of the trace of the covariance, mm.
    pub sd_mm: Vec<f64>,
    /// Half of the draws move less, mm.
    pub reach50_mm: Vec<f64>,
    /// 95 % of the draws move less, mm.
    pub reach95_mm: Vec<f64>,
    /// Probability of moving more than the threshold.
    pub over: Vec<f64>,
}

/// The length of a vector.
pub(super) fn length(u: &[f64; 3]) -> f64 {
    u.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The value that this share of the weights lies at or below.
pub(super) fn weighed_quantile(values: &mut [(f64, f64)], share: f64) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = values.iter().map(|v| v.1).sum();
    let mut below = 0.0;
    for (value, weight) in values.iter() {
        below += weight;
        // A hair less: sums of weights are rounded.
        if below >= share * all * (1.0 - 1e-12) {
            return *value;
        }
    }
    values.last().map_or(0.0, |v| v.0)
}

/// How far the place that moves most goes in all but the rest of the draws, mm: of whole draws, where a node's own reach is of
/// that node alone.
pub fn farthest(draws: &Draws, share: f64) -> f64 {
    let most = |(weight, u): &(f64, Vec<[f64; 3]>)| (u.iter().map(length).fold(0.0, f64::max), *weight);
    weighed_quantile(&mut draws.par_iter().map(most).collect::<Vec<_>>(), share)
}

/// The spread of draws over `nodes` nodes.
pub fn spread(draws: &Draws, nodes: usize, threshold_mm: f64) -> Spread {
    let all: f64 = draws.iter().map(|(weight, _)| weight).sum::<f64>().max(f64::MIN_POSITIVE);
    let of_node = |n: usize| {
        let mut mean = [0.0; 3];
        for (weight, u) in draws {
            (0..3).for_each(|i| mean[i] += weight / all * u[n][i]);
        }
        let (mut variance, mut over) = (0.0, 0.0);
        let mut sizes = Vec::with_capacity(draws.len());
        for (weight, u) in draws {
            variance += weight / all * (0..3).map(|i| (u[n][i] - mean[i]).powi(2)).sum::<f64>();
            let size = length(&u[n]);
            over += if size > threshold_mm { weight / all } else { 0.0 };
            sizes.push((size, *weight));
        }
        let (half, most) = (weighed_quantile(&mut sizes, 0.5), weighed_quantile(&mut sizes, 0.95));
        (mean, variance.sqrt(), half, most, over.min(1.0))
    };
    let found: Vec<_> = (0..nodes).into_par_iter().map(of_node).collect();
    let mut spread = Spread::default();
    for (mean, sd, half, most, over) in found {
        spread.mean_mm.push(mean);
        spread.sd_mm.push(sd);
        spread.reach50_mm.push(half);
        spread.reach95_mm.push(most);
        spread.over.push(over);
    }
    spread
}

#[cfg(test)]
mod tests {
    use super::super::low_discrepancy::normals;
    use super::*;

    #[test]
    fn a_known_law_comes_back() {
        let draw = |n: usize| vec![[(0.5 * normals(n, 0, 1)[0]).exp(), 0.0, 0.0], [0.0, 0.0, normals(n, 1, 1)[0]]];
        let draws: Vec<_> = (0..4000).map(|n| (2.0, draw(n))).collect();
        let found = spread(&draws, 2, 1.0);
        // Mean and spread of the lognormal and of the normal law.
        assert!((found.mean_mm[0][0] - 0.125f64.exp()).abs() < 0.005, "{}", found.mean_mm[0][0]);
        assert!((found.sd_mm[0] - (0.5f64.exp() - 0.25f64.exp()).sqrt()).abs() < 0.02);
        assert!(
            (found.reach50_mm[0] - 1.0).abs() < 0.01 && (found.reach95_mm[0] - (0.5f64 * 1.644_854).exp()).abs() < 0.02
        );
        assert!((found.sd_mm[1] - 1.0).abs() < 0.01 && (found.reach95_mm[1] - 1.96).abs() < 0.02);
        assert!((found.over[0] - 0.5).abs() < 0.01 && (found.over[1] - 0.3173).abs() < 0.01);
    }

    #[test]
    fn no_place_goes_beyond_the_farthest_though_every_one_of_many_seldom_does() {
        // Each of ten nodes goes far in a tenth of the draws of its own: alone it reaches 9 mm, and in every draw one does.
        let draw =
            |n: usize| (0..10).map(|node| [if node == n % 10 { 9.0 + n as f64 } else { 1.0 }, 0.0, 0.0]).collect();
        let draws: Vec<(f64, Vec<[f64; 3]>)> = (0..40).map(|n| (1.0, draw(n))).collect();
        let nodes = spread(&draws, 10, 2.0).reach95_mm.into_iter().fold(0.0, f64::max);
        assert_eq!(farthest(&draws, 0.95), 9.0 + 37.0);
        let within = draws.iter().filter(|(_, u)| u.iter().all(|x| x[0] <= farthest(&draws, 0.95))).count();
        assert!(within == 38 && nodes != farthest(&draws, 0.95), "{within} {nodes}");
    }

    #[test]
    fn a_draw_counts_as_much_as_its_weight() {
        let draws = [(3.0, vec![[1.0, 0.0, 0.0]]), (1.0, vec![[5.0, 0.0, 0.0]])];
        let found = spread(&draws, 1, 2.0);
        assert_eq!(
            (found.mean_mm[0][0], found.over[0], found.reach50_mm[0], found.reach95_mm[0]),
            (2.0, 0.25, 1.0, 5.0)
        );
        assert!((found.sd_mm[0] - 3f64.sqrt()).abs() < 1e-12);
    }
}

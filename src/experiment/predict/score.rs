//! How well draws foretold what was seen.
//!
//! Coverage counts how often what was seen lies within what was foretold. The continuous ranked probability score is the
//! integral of the squared difference between the foretold distribution and the step at what was seen: in mm, smaller is
//! better, and of a forecast without spread it is the absolute error (Gneiting and Raftery, Journal of the American
//! Statistical Association 102, 2007, eq. 21; its form for vectors, the energy score, eq. 22). What was seen has an error of
//! its own: the draws are given the same before they are compared with it (Saetra et al., Monthly Weather Review 132, 2004).

use super::ellipsoid::Scatter;
use super::spread::{length, weighed_quantile};
use crate::material::random::CounterRng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The same error of what is seen in every evaluation.
const SEED: u64 = 20;

/// A place where a displacement was foretold and seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// Displacement of every draw with its weight, mm.
    pub draws: Vec<(f64, [f64; 3])>,
    /// What was seen, mm.
    pub seen_mm: [f64; 3],
    /// Its standard deviation (root of the trace of the covariance), mm.
    pub seen_sd_mm: f64,
}

/// Shares of the places that lie within what was foretold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Moved no further than half of the draws.
    pub reach50: f64,
    /// Moved no further than 95 % of the draws.
    pub reach95: f64,
    /// Inside the ellipsoid that holds half of the draws.
    pub ellipsoid50: f64,
    /// Inside the ellipsoid that holds 95 % of the draws.
    pub ellipsoid95: f64,
}

/// A forecast against what was seen, over many places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scores {
    /// Places that were compared.
    pub places: usize,
    /// Root mean square of the displacement that was seen, mm.
    pub seen_rms_mm: f64,
    /// The same of the mean of the draws, mm.
    pub expected_rms_mm: f64,
    /// Root mean square of the difference between the two, mm.
    pub error_rms_mm: f64,
    /// Median standard deviation (root of the trace of the covariance) of what was seen, mm.
    pub seen_sd_median_mm: f64,
    /// Draws as they are: what was seen is taken to be without error.
    pub coverage: Coverage,
    /// Draws with the error of what was seen added: the one to judge by.
    pub coverage_with_error: Coverage,
    /// Continuous ranked probability score of the size of the displacement, mean over the places, mm.
    pub crps_mm: f64,
    /// The same of saying that nothing moves, mm.
    pub crps_rest_mm: f64,
    /// Energy score: the same for displacements as vectors, mm.
    pub energy_score_mm: f64,
    /// The same of saying that nothing moves, mm.
    pub energy_score_rest_mm: f64,
    /// Share of the draws, as they are, whose displacement as a whole (root mean square over the places) is smaller than what
    /// was seen: near 0 or 1, and the forecast was too large or too small altogether.
    pub rank_of_seen: f64,
}

impl Scores {
    /// Whether what was seen is smaller than its own error: then it judges no forecast.
    pub fn is_within_error(&self) -> bool {
        self.places > 0 && self.seen_rms_mm < self.seen_sd_median_mm
    }
}

/// The verdict on one place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaceScore {
    /// Within the 50 and 95 % reach, the 50 and 95 % ellipsoid: draws as they are.
    pub inside: [bool; 4],
    /// The same of draws with the error of what was seen.
    pub inside_with_error: [bool; 4],
    /// Of the size, mm: foretold, and saying that nothing moves.
    pub crps_mm: [f64; 2],
    /// Of the vector, mm: the same.
    pub energy_score_mm: [f64; 2],
    /// The mean of the draws, mm.
    pub mean_mm: [f64; 3],
}

/// Scores one place; `number` tells its error from that of others.
pub fn score_place(place: &Compared, number: usize) -> PlaceScore {
    let noise = CounterRng::new(SEED, number as u64);
    let sd = place.seen_sd_mm / 3f64.sqrt();
    let blurred: Vec<(f64, [f64; 3])> = place
        .draws
        .iter()
        .enumerate()
        .map(|(n, (w, u))| (*w, [0, 1, 2].map(|a| u[a] + sd * noise.normal((3 * n + a) as u64))))
        .collect();
    let still: Vec<(f64, [f64; 3])> =
        place.draws.iter().zip(&blurred).map(|((w, u), (_, b))| (*w, [0, 1, 2].map(|a| b[a] - u[a]))).collect();
    let all: f64 = place.draws.iter().map(|d| d.0).sum::<f64>().max(f64::MIN_POSITIVE);
    PlaceScore {
        inside: inside(&place.draws, &place.seen_mm),
        inside_with_error: inside(&blurred, &place.seen_mm),
        crps_mm: [&blurred, &still].map(|draws| crps_of_size(draws, length(&place.seen_mm))),
        energy_score_mm: [&blurred, &still].map(|draws| energy_score(draws, &place.seen_mm)),
        mean_mm: [0, 1, 2].map(|a| place.draws.iter().map(|(w, u)| w / all * u[a]).sum()),
    }
}

fn inside(draws: &[(f64, [f64; 3])], seen: &[f64; 3]) -> [bool; 4] {
    let mut sizes: Vec<(f64, f64)> = draws.iter().map(|(w, u)| (length(u), *w)).collect();
    let reach = |sizes: &mut Vec<(f64, f64)>, share: f64| length(seen) <= weighed_quantile(sizes, share);
    let scatter = Scatter::of(draws);
    let distance = scatter.distance(seen);
    [reach(&mut sizes, 0.5), reach(&mut sizes, 0.95), distance <= scatter.radius(0.5), distance <= scatter.radius(0.95)]
}

fn crps_of_size(draws: &[(f64, [f64; 3])], seen: f64) -> f64 {
    crps(&mut draws.iter().map(|(w, u)| (length(u), *w)).collect::<Vec<_>>(), seen)
}

/// The continuous ranked probability score of weighed draws `(value, weight)`: E|X - y| - E|X - X'|/2.
pub fn crps(draws: &mut [(f64, f64)], seen: f64) -> f64 {
    draws.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = draws.iter().map(|d| d.1).sum::<f64>().max(f64::MIN_POSITIVE);
    let (mut off, mut apart, mut below, mut sum_below) = (0.0, 0.0, 0.0, 0.0);
    for (x, w) in draws.iter().map(|(x, w)| (*x, w / all)) {
        off += w * (x - seen).abs();
        // Sorted: every pair once, the larger less the smaller.
        apart += w * (x * below - sum_below);
        below += w;
        sum_below += w * x;
    }
    off - apart
}

/// The energy score of weighed vectors: E|X - y| - E|X - X'|/2.
pub fn energy_score(draws: &[(f64, [f64; 3])], seen: &[f64; 3]) -> f64 {
    let between = |a: &[f64; 3], b: &[f64; 3]| length(&[a[0] - b[0], a[1] - b[1], a[2] - b[2]]);
    let all: f64 = draws.iter().map(|d| d.0).sum::<f64>().max(f64::MIN_POSITIVE);
    let off: f64 = draws.iter().map(|(w, u)| w / all * between(u, seen)).sum();
    let apart: f64 = draws
        .iter()
        .enumerate()
        .map(|(n, (w, u))| w / all * draws[..n].iter().map(|(v, x)| v / all * between(u, x)).sum::<f64>())
        .sum();
    off - apart
}

/// Scores many places together; `place` says what was foretold and seen at each, by the same draws in the same order.
pub fn scores(places: usize, place: &(dyn Fn(usize) -> Compared + Sync)) -> Scores {
    if places == 0 {
        return Scores::default();
    }
    let square = |u: &[f64; 3]| u.iter().map(|x| x * x).sum::<f64>();
    // Of the draws of a place only their sizes are kept: there are many places.
    let one = |n: usize| {
        let compared = place(n);
        let sizes: Vec<f64> = compared.draws.iter().map(|(_, u)| square(u)).collect();
        (score_place(&compared, n), sizes, compared.seen_mm, compared.seen_sd_mm)
    };
    let each: Vec<(PlaceScore, Vec<f64>, [f64; 3], f64)> = (0..places).into_par_iter().map(one).collect();
    let mean = |of: &dyn Fn(usize) -> f64| (0..places).map(of).sum::<f64>() / places as f64;
    let share = |of: &dyn Fn(&PlaceScore) -> [bool; 4]| {
        let [reach50, reach95, ellipsoid50, ellipsoid95] =
            [0, 1, 2, 3].map(|k| rounded(mean(&|n| f64::from(u8::from(of(&each[n].0)[k])))));
        Coverage { reach50, reach95, ellipsoid50, ellipsoid95 }
    };
    let away = |n: usize| [0, 1, 2].map(|a| each[n].0.mean_mm[a] - each[n].2[a]);
    let mut sd: Vec<f64> = each.iter().map(|e| e.3).collect();
    sd.sort_by(f64::total_cmp);
    let seen = mean(&|n| square(&each[n].2));
    let weights: Vec<f64> = place(0).draws.iter().map(|d| d.0).collect();
    let all = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    // What was seen has its error in it, and is larger for that.
    let noise = mean(&|n| each[n].3.powi(2));
    let smaller = |d: &usize| mean(&|n| each[n].1[*d]) + noise < seen;
    let rank = (0..weights.len()).filter(smaller).map(|d| weights[d] / all).sum::<f64>();
    Scores {
        places,
        seen_rms_mm: rounded(seen.sqrt()),
        expected_rms_mm: rounded(mean(&|n| square(&each[n].0.mean_mm)).sqrt()),
        error_rms_mm: rounded(mean(&|n| square(&away(n))).sqrt()),
        seen_sd_median_mm: rounded(sd[sd.len() / 2]),
        coverage: share(&|s| s.inside),
        coverage_with_error: share(&|s| s.inside_with_error),
        crps_mm: rounded(mean(&|n| each[n].0.crps_mm[0])),
        crps_rest_mm: rounded(mean(&|n| each[n].0.crps_mm[1])),
        energy_score_mm: rounded(mean(&|n| each[n].0.energy_score_mm[0])),
        energy_score_rest_mm: rounded(mean(&|n| each[n].0.energy_score_mm[1])),
        rank_of_seen: rounded(rank.min(1.0)),
    }
}

/// A tenth of a micrometre, or of a per mille.
pub(super) fn rounded(x: f64) -> f64 {
    (x * 1e4).round() / 1e4 + 0.0
}

#[cfg(test)]
mod tests {
    use super::super::low_discrepancy::{halton, inverse_normal, normals};
    use super::*;

    #[test]
    fn the_score_of_a_normal_law_is_its_closed_formula() {
        // Gneiting and Raftery (2007), eq. 21: sd (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi)); Phi from tables.
        let (mean, sd) = (3.0, 2.0);
        let draw = |n: usize| (mean + sd * inverse_normal((n as f64 + 0.5) / 4000.0), 1.0);
        let density = |z: f64| (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
        for (z, below) in [(0.0, 0.5), (1.0, 0.841_344_746), (-2.0, 0.022_750_132)] {
            let exact = sd * (z * (2.0 * below - 1.0) + 2.0 * density(z) - 1.0 / std::f64::consts::PI.sqrt());
            let found = crps(&mut (0..4000).map(draw).collect::<Vec<_>>(), mean + sd * z);
            assert!((found - exact).abs() < 1e-3 * sd, "{z}: {found} {exact}");
        }
    }

    #[test]
    fn without_spread_the_score_is_the_error_and_weights_count_as_repetitions() {
        assert!((crps(&mut [(2.0, 0.3), (2.0, 0.7)], 5.0) - 3.0).abs() < 1e-12);
        let weighed = crps(&mut [(1.0, 3.0), (4.0, 1.0)], 2.0);
        let repeated = crps(&mut [(1.0, 1.0), (4.0, 1.0), (1.0, 1.0), (1.0, 1.0)], 2.0);
        assert!((weighed - repeated).abs() < 1e-12);
        let along = [(3.0, [1.0, 0.0, 0.0]), (1.0, [4.0, 0.0, 0.0])];
        assert!((energy_score(&along, &[2.0, 0.0, 0.0]) - weighed).abs() < 1e-12, "along a line they are the same");
    }

    /// A place whose draws are normal around `mean`, of which `seen` is one more.
    fn place(mean: [f64; 3], sd: f64, n: usize, seen_sd_mm: f64) -> Compared {
        let draws = (0..400).map(|k| {
            let z = normals(k, 0, 3);
            (1.0, [0, 1, 2].map(|a| mean[a] + sd * z[a]))
        });
        let noise = CounterRng::new(7, n as u64);
        let both = (sd * sd + seen_sd_mm * seen_sd_mm / 3.0).sqrt();
        Compared {
            draws: draws.collect(),
            seen_mm: [0, 1, 2].map(|a| mean[a] + both * noise.normal(a as u64)),
            seen_sd_mm,
        }
    }

    #[test]
    fn what_was_drawn_from_the_foretold_law_is_covered_as_often_as_foretold() {
        let places: Vec<Compared> = (0..2000).map(|n| place([3.0, -1.0, 0.5], 0.7, n, 1.5)).collect();
        let found = scores(places.len(), &|n| places[n].clone());
        let c = found.coverage_with_error;
        for (share, exact) in [(c.reach50, 0.5), (c.reach95, 0.95), (c.ellipsoid50, 0.5), (c.ellipsoid95, 0.95)] {
            // Three standard errors of the count and a little for the 400 draws.
            assert!((share - exact).abs() < 0.04, "{c:?}");
        }
        // Without the error of what was seen the forecast looks surer than it is.
        assert!(found.coverage.ellipsoid95 < 0.8, "{found:?}");
        assert!(found.crps_mm < found.crps_rest_mm && found.energy_score_mm < found.energy_score_rest_mm);
    }

    #[test]
    fn counts_of_a_made_case_are_the_known_ones() {
        // Draws of sizes 1 to 100 along x, as often as each other; seen at 10, 60, 97 and 120.
        let draws: Vec<(f64, [f64; 3])> = (1..=100).map(|n| (1.0, [f64::from(n), 0.0, 0.0])).collect();
        let place = |x: f64| Compared { draws: draws.clone(), seen_mm: [x, 0.0, 0.0], seen_sd_mm: 0.0 };
        let places = [10.0, 60.0, 97.0, 120.0].map(place);
        let found = scores(places.len(), &|n| places[n].clone());
        // Half of the draws are at most 50 and 95 at most 95; half lie within 25 of the mean 50.5, 95 within 47.5.
        assert_eq!(
            found.coverage,
            Coverage { reach50: 0.25, reach95: 0.5, ellipsoid50: 0.25, ellipsoid95: 0.75 },
            "{found:?}"
        );
        assert_eq!(found.coverage, found.coverage_with_error);
        assert_eq!((found.places, found.seen_sd_median_mm, found.expected_rms_mm), (4, 0.0, 50.5));
        // Saying that nothing moves is off by what was seen.
        assert!((found.crps_rest_mm - 71.75).abs() < 1e-9 && (found.energy_score_rest_mm - 71.75).abs() < 1e-9);
        // Root mean square of the four: 82.9, larger than 82 of the hundred.
        assert_eq!(found.rank_of_seen, 0.82);
    }

    #[test]
    fn a_forecast_twice_too_large_ranks_low_and_scores_worse() {
        let of = |factor: f64| {
            let mut places: Vec<Compared> = (0..200).map(|n| place([3.0, 0.0, 0.0], 0.4, n, 0.3)).collect();
            for (w, u) in places.iter_mut().flat_map(|p| &mut p.draws) {
                *u = u.map(|x| factor * x);
                *w *= 1.0 + halton(3, 1);
            }
            scores(places.len(), &|n| places[n].clone())
        };
        let (right, double) = (of(1.0), of(2.0));
        assert!(double.rank_of_seen < 0.01 && (0.1..0.9).contains(&right.rank_of_seen), "{right:?} {double:?}");
        assert!(double.crps_mm > 2.0 * right.crps_mm && double.energy_score_mm > 2.0 * right.energy_score_mm);
    }
}

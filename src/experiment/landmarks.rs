//! Target registration error: how far landmarks lie from where they were carried.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The radius of the sphere that holds 95 % of a Gaussian alike in all three dimensions, in standard deviations of one component: the root of the
/// chi-squared distribution's 95th percentile for three degrees of freedom.
const RADIUS_95: f64 = 2.795_483_482_915_107_4;

/// Landmarks carried in one way.
#[derive(Clone, Debug)]
pub struct CarriedLandmarks {
    /// How: `rigid`, `observed`, `estimate`, `fused`.
    pub state: String,
    /// Where they were carried, mm.
    pub to_mm: Vec<[f64; 3]>,
    /// Standard deviation of each (root of the trace of the covariance), mm, where one is predicted.
    pub sd_mm: Vec<Option<f64>>,
}

/// Every landmark and every way of carrying it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaluation {
    /// In numbers, a row for each way.
    pub summary: Vec<StateErrors>,
    /// A row for each landmark.
    pub landmarks: Vec<LandmarkErrors>,
    /// Names that one of two files alone holds: not compared.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// SHA-256 of the results that they were carried by, where they are kept in a case.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub of_sha256: String,
}

/// Errors over all landmarks that were carried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateErrors {
    /// How they were carried.
    pub state: String,
    /// How many.
    pub landmarks: usize,
    /// Mean error, mm.
    pub mean_mm: f64,
    /// Median error, mm.
    pub median_mm: f64,
    /// 95th percentile of the error, mm.
    pub percentile_95_mm: f64,
    /// Share of those with a predicted spread that lie inside their 95 % sphere: the error is taken to be alike in all directions, a
    /// component's standard deviation that of the landmark over the root of 3, and the radius is 2.795 of those.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside_95_share: Option<f64>,
}

/// Errors of one landmark.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LandmarkErrors {
    /// Its name or number.
    pub name: String,
    /// Where it lies: `tissue`, `fluid`, `removed`, `outside`. Landmarks in removed tissue or outside are left out of the summary.
    pub place: String,
    /// Error of each way, in the order of the summary, mm.
    pub error_mm: Vec<f64>,
    /// Predicted standard deviation of each way, mm; absent where none is predicted.
    pub sd_mm: Vec<Option<f64>>,
}

/// Compares landmarks with where they were found, mm. `places` says where each lies, and `counts` whether it is compared.
pub fn evaluate(
    names: &[String],
    places: &[(String, bool)],
    found_mm: &[[f64; 3]],
    carried: &[CarriedLandmarks],
) -> Evaluation {
    let error = |c: &CarriedLandmarks, n: usize| distance(c.to_mm[n], found_mm[n]);
    let counted: Vec<usize> = (0..names.len()).filter(|&n| places[n].1).collect();
    let summary = carried.iter().map(|c| {
        let mut errors: Vec<f64> = counted.iter().map(|&n| error(c, n)).collect();
        errors.sort_by(f64::total_cmp);
        let spreads: Vec<(f64, f64)> = counted.iter().filter_map(|&n| Some((error(c, n), c.sd_mm[n]?))).collect();
        let inside = spreads.iter().filter(|(error, sd)| *error <= RADIUS_95 * sd / 3f64.sqrt()).count();
        StateErrors {
            state: c.state.clone(),
            landmarks: errors.len(),
            mean_mm: rounded(errors.iter().sum::<f64>() / errors.len().max(1) as f64),
            median_mm: rounded(percentile(&errors, 0.5)),
            percentile_95_mm: rounded(percentile(&errors, 0.95)),
            inside_95_share: (!spreads.is_empty()).then(|| rounded(inside as f64 / spreads.len() as f64)),
        }
    });
    let row = |n: usize| LandmarkErrors {
        name: names[n].clone(),
        place: places[n].0.clone(),
        error_mm: carried.iter().map(|c| rounded(error(c, n))).collect(),
        sd_mm: carried.iter().map(|c| c.sd_mm[n].map(rounded)).collect(),
    };
    Evaluation { summary: summary.collect(), landmarks: (0..names.len()).map(row).collect(), ..Evaluation::default() }
}

/// Whether another reading of landmarks brings them so much nearer by the rigid motion between the scans (root mean squares, mm) that
/// no brain shift parts the two: by half and by some millimetres.
pub fn fits_far_better(other_mm: f64, given_mm: f64) -> bool {
    const TIMES: f64 = 2.0;
    const NEARER_MM: f64 = 5.0;
    given_mm > TIMES * other_mm && given_mm - other_mm > NEARER_MM
}

/// Between the two nearest of sorted values; 0 of none.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = share * last as f64;
    let low = at as usize;
    let high = (low + 1).min(last);
    sorted[low] + (at - low as f64) * (sorted[high] - sorted[low])
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn rounded(x: f64) -> f64 {
    (x * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::random::CounterRng;

    #[test]
    fn errors_of_a_known_spread_lie_inside_their_sphere_nineteen_times_in_twenty() {
        let count = 4000;
        let gauss = |n: u64, a: u64| (0..12).map(|k| CounterRng::new(2, n).uniform(100 * a + k)).sum::<f64>() - 6.0;
        let found = vec![[1.0, 2.0, 3.0]; count];
        let to_mm: Vec<[f64; 3]> =
            (0..count as u64).map(|n| [0, 1, 2].map(|a| found[0][a] + 0.5 * gauss(n, a as u64))).collect();
        let carried =
            CarriedLandmarks { state: "fused".to_owned(), to_mm, sd_mm: vec![Some(0.5 * 3f64.sqrt()); count] };
        let names: Vec<String> = (0..count).map(|n| n.to_string()).collect();
        let all = evaluate(&names, &vec![("tissue".to_owned(), true); count], &found, &[carried]);
        let inside = all.summary[0].inside_95_share.unwrap();
        assert!((0.94..0.96).contains(&inside), "{inside}");
    }

    #[test]
    fn a_landmark_in_removed_tissue_is_listed_and_not_counted() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let places = [("tissue", true), ("removed", false), ("fluid", true)].map(|(p, c)| (p.to_owned(), c));
        let to_mm = vec![[1.0, 0.0, 0.0], [50.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
        let carried = CarriedLandmarks { state: "rigid".to_owned(), to_mm, sd_mm: vec![None; 3] };
        let all = evaluate(&names, &places, &[[0.0; 3]; 3], &[carried]);
        let s = &all.summary[0];
        assert_eq!((s.landmarks, s.mean_mm, s.median_mm, s.inside_95_share), (2, 2.0, 2.0, None));
        assert_eq!(all.landmarks[1].error_mm, [50.0]);
        assert!((s.percentile_95_mm - 2.9).abs() < 1e-9);
    }
}

//! Whether several treatments differ, by ranks: of the same subjects (Friedman) or of others (Kruskal and Wallis).
//!
//! Both statistics follow chi-square with one degree of freedom fewer than there are treatments when these are alike; with few
//! subjects that is an approximation.

use schemars::JsonSchema;
use serde::Serialize;
use statrs::function::gamma::gamma_ur;

/// A test's statistic and the probability of one as large when nothing differs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RankTest {
    /// Chi-square distributed statistic, corrected for ties.
    pub h: f64,
    /// The share of chi-square beyond it.
    pub p: f64,
}

impl RankTest {
    fn of(h: f64, treatments: usize) -> Self {
        Self { h, p: chi_square_beyond(h, treatments.saturating_sub(1)) }
    }
}

/// The share of chi-square with these degrees of freedom beyond `x`.
fn chi_square_beyond(x: f64, degrees: usize) -> f64 {
    if x.is_nan() || degrees == 0 {
        return f64::NAN;
    }
    // Exactly, as for the paper's three treatments.
    if degrees == 2 {
        return (-0.5 * x).exp();
    }
    if x <= 0.0 { 1.0 } else { gamma_ur(0.5 * degrees as f64, 0.5 * x) }
}

/// Ranks from 1, ties sharing their mean rank, and the sum of t^3 - t over groups of t ties.
pub fn ranks(values: &[f64]) -> (Vec<f64>, f64) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut ties = 0.0;
    let mut first = 0;
    for group in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let count = group.len() as f64;
        for index in group {
            ranks[*index] = first as f64 + 0.5 * (count + 1.0);
        }
        ties += count.powi(3) - count;
        first += group.len();
    }
    (ranks, ties)
}

/// Kruskal and Wallis (J Am Stat Assoc 47, 1952) over independent samples of any sizes, corrected for ties. Not a number when
/// all values are equal.
pub fn kruskal_wallis(samples: &[Vec<f64>]) -> RankTest {
    let pooled = samples.concat();
    let n = pooled.len() as f64;
    let (ranks, ties) = ranks(&pooled);
    let mut rest = ranks.as_slice();
    let mut sum = 0.0;
    for sample in samples {
        let (own, others) = rest.split_at(sample.len());
        sum += own.iter().sum::<f64>().powi(2) / sample.len() as f64;
        rest = others;
    }
    let h = 12.0 / (n * (n + 1.0)) * sum - 3.0 * (n + 1.0);
    RankTest::of(h / (1.0 - ties / (n.powi(3) - n)), samples.len())
}

/// Friedman (J Am Stat Assoc 32, 1937) over rows of as many treatments of the same subject each, corrected for ties. Not a
/// number when every row is all ties.
pub fn friedman<R: AsRef<[f64]>>(rows: &[R]) -> RankTest {
    let n = rows.len() as f64;
    let treatments = rows.first().map_or(0, |row| row.as_ref().len());
    let mut sums = vec![0.0; treatments];
    let mut all_ties = 0.0;
    for row in rows {
        let (ranks, ties) = ranks(row.as_ref());
        all_ties += ties;
        for (sum, rank) in sums.iter_mut().zip(ranks) {
            *sum += rank;
        }
    }
    let k = treatments as f64;
    let square: f64 = sums.iter().map(|s| s * s).sum();
    let h = (12.0 * square - 3.0 * n * n * k * (k + 1.0).powi(2)) / (n * k * (k + 1.0) - all_ties / (k - 1.0));
    RankTest::of(h, treatments)
}

/// Kendall's coefficient of concordance of Friedman's rows: 0 where they agree in nothing, 1 where all are in one order (Kendall
/// and Babington Smith, Ann Math Stat 10, 1939).
pub fn concordance(friedman: &RankTest, rows: usize, treatments: usize) -> f64 {
    friedman.h / (rows as f64 * (treatments as f64 - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    // What scipy 1.15.3 says.
    const FRIEDMAN: [f64; 2] = [13.040816326530614, 0.004549164077451546];
    const KRUSKAL: [f64; 2] = [15.719094339622652, 0.0012947041424509185];
    const TAILS: [(f64, usize, f64); 7] = [
        (15.5, 8, 0.0501220545326652),
        (19.7, 11, 0.049628648114463395),
        (60.0, 11, 9.272161502836452e-09),
        (0.5, 8, 0.999866630349486),
        (3.2, 5, 0.6691829020332432),
        (3.84, 1, 0.05004352124870519),
        (7.2, 2, 0.027323722447292555),
    ];

    #[test]
    fn tied_values_share_their_rank() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), (vec![3.5, 1.0, 3.5, 2.0], 6.0));
    }

    #[test]
    fn statistics_of_a_worked_example_come_out() {
        // No ties, three in each sample: rank sums 6, 15, 24 give H = 12/90 (36+225+576)/3 - 30 = 7.2.
        let apart = [vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0], vec![7.0, 8.0, 9.0]];
        let test = kruskal_wallis(&apart);
        assert!((test.h - 7.2).abs() < 1e-12 && (test.p - (-3.6_f64).exp()).abs() < 1e-15);
        // The same order in each of four rows: chi-square = n (k - 1) = 8.
        let rows = [[1.0, 2.0, 3.0], [10.0, 11.0, 12.0], [0.1, 0.2, 0.3], [5.0, 6.0, 9.0]];
        assert!((friedman(&rows).h - 8.0).abs() < 1e-12);
        // A tie in one row: rank sums 4.5, 4.5, 9 give 4.5, divided by 1 - 6 / (n k (k^2 - 1)).
        let tied = [[1.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 1.0, 3.0]];
        assert!((friedman(&tied).h - 4.5 / (1.0 - 6.0 / 72.0)).abs() < 1e-12, "{}", friedman(&tied).h);
    }

    #[test]
    fn friedman_sees_what_pooling_hides_and_neither_sees_a_difference_that_is_none() {
        // The subject matters a hundred times more than the treatment.
        let rows: Vec<[f64; 3]> = (0..8).map(|i| [0.0, 0.1, 0.2].map(|d| f64::from(i) * 10.0 + d)).collect();
        let columns: [Vec<f64>; 3] = std::array::from_fn(|c| rows.iter().map(|row| row[c]).collect());
        assert!(friedman(&rows).p < 1e-3 && kruskal_wallis(&columns).p > 0.5);
        let turned: Vec<[f64; 3]> = (0..9).map(|i| std::array::from_fn(|c| f64::from((i + c as i32) % 3))).collect();
        assert_eq!(friedman(&turned).h, 0.0);
    }

    #[test]
    fn more_than_three_treatments_are_tested_as_scipy_does() {
        let rows = [
            [1.2, 3.4, 2.2, 0.7],
            [1.1, 2.9, 3.0, 0.9],
            [1.5, 2.2, 2.2, 1.0],
            [0.8, 3.3, 2.7, 1.2],
            [1.9, 2.8, 2.0, 0.6],
        ];
        let columns: Vec<Vec<f64>> = (0..4).map(|c| rows.iter().map(|row| row[c]).collect()).collect();
        let (paired, pooled) = (friedman(&rows), kruskal_wallis(&columns));
        assert!((paired.h - FRIEDMAN[0]).abs() < 1e-9 && (paired.p - FRIEDMAN[1]).abs() < 1e-9, "{paired:?}");
        assert!((pooled.h - KRUSKAL[0]).abs() < 1e-9 && (pooled.p - KRUSKAL[1]).abs() < 1e-9, "{pooled:?}");
        let agreement = concordance(&paired, 5, 4);
        assert!(agreement > 0.8 && agreement < 1.0, "{agreement}");
    }

    #[test]
    fn the_tail_of_chi_square_is_scipys() {
        for (x, degrees, beyond) in TAILS {
            let found = chi_square_beyond(x, degrees);
            assert!((found / beyond - 1.0).abs() < 1e-9, "{x} {degrees}: {found} against {beyond}");
        }
        assert_eq!(chi_square_beyond(0.0, 5), 1.0);
    }
}

//! Do three meta-models fit equally well? Two rank tests over their costs on the same curves.
//!
//! The paper used Kruskal and Wallis' test, which takes the three samples as independent. They are not: each curve is
//! fitted by all three laws, so that Friedman's test, which compares within a curve, is the right one. Both statistics
//! follow chi-square with two degrees of freedom when the laws fit alike, whose survival function is exp(-H / 2).

use super::gp::TissuePrior;
use super::meta_model::{FitError, MetaModel, MetaModelSettings, fit};
use super::task::stretches;
use serde::Serialize;

/// The laws that are compared.
pub const COMPARED: [MetaModel; 3] = [MetaModel::NEO_HOOKEAN, MetaModel::MOONEY_RIVLIN, MetaModel::OGDEN];

/// A test's statistic and the probability of one as large when nothing differs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RankTest {
    /// Chi-square distributed statistic, two degrees of freedom, corrected for ties.
    pub h: f64,
    /// exp(-h / 2).
    pub p: f64,
}

impl RankTest {
    fn of(h: f64) -> Self {
        Self { h, p: (-0.5 * h).exp() }
    }
}

/// Ranks from 1, ties sharing their mean rank, and the sum of t^3 - t over groups of t ties.
fn ranks(values: &[f64]) -> (Vec<f64>, f64) {
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

/// Kruskal and Wallis (J Am Stat Assoc 47, 1952) over three independent samples of any sizes, corrected for ties.
/// Not a number when all values are equal.
pub fn kruskal_wallis(samples: &[Vec<f64>; 3]) -> RankTest {
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
    RankTest::of(h / (1.0 - ties / (n.powi(3) - n)))
}

/// Friedman (J Am Stat Assoc 32, 1937) over rows of three treatments of the same subject, corrected for ties. Not a
/// number when every row is all ties.
pub fn friedman(rows: &[[f64; 3]]) -> RankTest {
    let n = rows.len() as f64;
    let mut sums = [0.0; 3];
    let mut all_ties = 0.0;
    for row in rows {
        let (ranks, ties) = ranks(row);
        all_ties += ties;
        for (sum, rank) in sums.iter_mut().zip(ranks) {
            *sum += rank;
        }
    }
    let k = 3.0;
    let square: f64 = sums.iter().map(|s| s * s).sum();
    let h = (12.0 * square - 3.0 * n * n * k * (k + 1.0).powi(2)) / (n * k * (k + 1.0) - all_ties / (k - 1.0));
    RankTest::of(h)
}

/// Costs of the compared laws on one tissue's curves, and both tests.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Standard deviations of each curve; the first is the mean itself.
    pub sd_levels: Vec<f64>,
    /// Cost of each law on each curve, laws in the order of [`COMPARED`].
    pub costs: Vec<[f64; 3]>,
    /// Friedman's test, paired, over the eleven levels: the mean is one of them.
    pub friedman: RankTest,
    /// Kruskal and Wallis' test, the paper's.
    pub kruskal_wallis: RankTest,
}

/// The paper's twelve curves of one tissue: its mean, then eleven levels from -2 to 2 standard deviations.
pub fn compared_levels() -> Vec<f64> {
    let mut levels = vec![0.0];
    levels.extend(stretches(-2.0, 2.0, 11));
    levels
}

/// How costs are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CostDigits {
    /// As they are.
    All,
    /// Rounded to two decimals first, as printed in the paper: its statistics come from those.
    Two,
}

/// Fits the compared laws to the curves of a tissue and tests whether their costs differ.
///
/// # Errors
/// [`FitError`] as [`fit`].
pub fn compare(prior: &TissuePrior, settings: &MetaModelSettings, digits: CostDigits) -> Result<Comparison, FitError> {
    let sd_levels = compared_levels();
    let mut costs = Vec::new();
    for level in &sd_levels {
        let targets = prior.quantile(*level);
        let mut row = [0.0; 3];
        for (cost, model) in row.iter_mut().zip(COMPARED) {
            let exact = fit(model, &prior.stretches, &targets, settings)?.cost;
            *cost = if digits == CostDigits::Two { (exact * 100.0).round() / 100.0 } else { exact };
        }
        costs.push(row);
    }
    let column = |i: usize| costs.iter().map(|row| row[i]).collect();
    let samples: [Vec<f64>; 3] = std::array::from_fn(column);
    Ok(Comparison { sd_levels, friedman: friedman(&costs[1..]), kruskal_wallis: kruskal_wallis(&samples), costs })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::generative::{SampleSettings, tissue_prior};
    use crate::material::task::Task;

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
    fn published_settings_reproduce_the_papers_kruskal_wallis() {
        let settings = SampleSettings { stretches: 101, ..SampleSettings::published() };
        let tasks = [Task::HYPERELASTIC_GREY, Task::HYPERELASTIC_WHITE, Task::HYPERELASTIC_HEALTHY];
        // Granados et al., IJCARS 2021: grey, white, healthy.
        for (task, printed) in tasks.into_iter().zip([14.59, 20.98, 15.17]) {
            let comparison = compare(&tissue_prior(task, &settings), &settings.meta_model, CostDigits::Two).unwrap();
            assert_eq!(comparison.costs.len(), 12);
            println!("{task}: {:?} {:?}", comparison.kruskal_wallis, comparison.costs);
            let h = comparison.kruskal_wallis.h;
            assert!((h - printed).abs() < 0.005, "{task}: {h} against {printed}");
        }
    }

    #[test]
    fn exact_fits_differ_by_the_paired_test() {
        let settings = SampleSettings { stretches: 101, ..SampleSettings::default() };
        let prior = tissue_prior(Task::HYPERELASTIC_WHITE, &settings);
        let comparison = compare(&prior, &settings.meta_model, CostDigits::All).unwrap();
        // Mooney-Rivlin and Ogden contain neo-Hookean, so they never cost more.
        assert!(comparison.costs.iter().all(|[nh, mr, o]| mr <= &(nh + 1e-9) && o <= &(nh + 1e-9)));
        assert!(comparison.friedman.p < 1e-3, "{:?}", comparison.friedman);
    }
}

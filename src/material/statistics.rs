//! Do three meta-models fit equally well? Two rank tests over their costs on the same curves.
//!
//! The paper used Kruskal and Wallis' test, which takes the three samples as independent. They are not: each curve is
//! fitted by all three laws, so that Friedman's test, which compares within a curve, is the right one.

use super::gp::TissuePrior;
use super::meta_model::{FitError, MetaModel, MetaModelSettings, fit};
use super::rank_test::{RankTest, friedman, kruskal_wallis};
use super::task::stretches;
use serde::Serialize;

/// The laws that are compared.
pub const COMPARED: [MetaModel; 3] = [MetaModel::NEO_HOOKEAN, MetaModel::MOONEY_RIVLIN, MetaModel::OGDEN];

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

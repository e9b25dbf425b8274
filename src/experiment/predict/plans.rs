//! Several plans of one patient side by side: which lets the brain move least, and whether that can be told.
//!
//! A draw of a number is the same patient under every plan (the same stiffness, load, pose of the head), so plans are compared
//! draw by draw: what all plans share does not count against telling them apart. They are compared by the tissue that all of them
//! leave (`left_by_all.rs`): what a plan takes cannot move, and is no merit of it.

use super::modes::DrawnState;
use super::score::rounded;
use super::spread::weighed_quantile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Several plans. Volumes are of tissue that moves by more than the threshold. Which plan moves least is said of the tissue that all
/// plans leave: over its own tissue a plan would be the better the more it takes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanComparison {
    /// What counts as a shift, mm.
    pub threshold_mm: f64,
    /// Tissue that all plans leave, cc: what they are compared by.
    #[serde(default)]
    pub left_by_all_cc: f64,
    /// The plans in the order they were given.
    pub plans: Vec<PlanFigures>,
    /// Each way of lying.
    pub heads: Vec<PlansOfHead>,
}

/// One plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanFigures {
    /// Its case folder beside this file: `plan-1`.
    pub plan: String,
    /// What it is: `mask`, `surface`, `label 1010`, `ellipsoid`.
    pub given: String,
    /// Tissue that is to be taken, cc.
    pub resected_cc: f64,
    /// What a quality gate has against it, a sentence each: its figures, and what is said of it beside others, are not to be relied on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refusals: Vec<String>,
    /// SHA-256 of the `sim/prediction.json` that was compared.
    #[serde(default)]
    pub prediction_sha256: String,
}

/// Every plan with the head lying in one way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlansOfHead {
    /// `supine`, `prone` ...
    pub head: String,
    /// A row for each plan.
    pub plans: Vec<PlanOfHead>,
    /// The plan that on average moves least of the tissue that all plans leave.
    pub least: String,
    /// Plans that it cannot be told from: the difference is within its spread. Empty where it is told from all.
    pub not_told_from: Vec<String>,
    /// The same in words.
    pub sentence: String,
}

/// One plan with the head lying in one way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanOfHead {
    /// Its case folder.
    pub plan: String,
    /// Tissue that the plan leaves and that is expected to move by more than the threshold, cc. A plan that takes more leaves less to
    /// move: plans are not compared by this.
    pub over_threshold_cc: f64,
    /// 95 % of the draws lie between, cc.
    pub interval_95_cc: [f64; 2],
    /// Largest mean displacement of a node, mm.
    pub largest_mm: f64,
    /// Of the tissue that all plans leave, what is expected to move by more than the threshold, cc.
    #[serde(default)]
    pub left_by_all_over_cc: f64,
    /// How much more of that than with the least one, draw by draw, cc; 0 for that one itself.
    pub more_than_least_cc: f64,
    /// 95 % of those differences lie between, cc.
    pub more_interval_95_cc: [f64; 2],
    /// Share of the draws in which it moves less of that than the least one.
    pub less_than_least: f64,
}

/// A plan's draws with the head lying in one way.
#[derive(Clone, Debug)]
pub struct PlanDraws {
    /// Its case folder.
    pub plan: String,
    /// Largest mean displacement of a node, mm.
    pub largest_mm: f64,
    /// The draws.
    pub draws: Vec<DrawnState>,
    /// What moves by more than the threshold in each of them, cc, of the tissue that all plans leave.
    pub of_all_cc: Vec<f64>,
    /// A quality gate has refused it.
    pub refused: bool,
}

type Drawn<'a> = BTreeMap<(&'a str, usize), (f64, f64)>;

/// Compares plans with the head lying in one way.
pub fn compared_plans(head: &str, plans: &[PlanDraws]) -> PlansOfHead {
    let drawn: Vec<Drawn<'_>> = plans
        .iter()
        .map(|p| {
            let each = p.draws.iter().zip(&p.of_all_cc);
            each.map(|(d, cc)| ((d.supports.as_str(), d.number), (*cc, d.weight))).collect()
        })
        .collect();
    let own = |n: usize| plans[n].draws.iter().map(|d| (d.over_threshold_cc, d.weight)).collect::<Vec<_>>();
    let values = |n: usize| drawn[n].values().copied().collect::<Vec<_>>();
    // A plan may have lost a way of supporting the brain that another has: only what all have decides.
    let of_all = |n: usize| {
        let shared = |key: &&(&str, usize)| drawn.iter().all(|d| d.contains_key(*key));
        mean(&drawn[n].keys().filter(shared).map(|key| drawn[n][key]).collect::<Vec<_>>())
    };
    let least = (0..plans.len()).min_by(|&a, &b| of_all(a).total_cmp(&of_all(b)).then(a.cmp(&b))).unwrap_or(0);
    let differences = |n: usize| -> Vec<(f64, f64)> {
        let with = |(key, (cc, weight)): (&(&str, usize), &(f64, f64))| Some((cc - drawn[least].get(key)?.0, *weight));
        drawn[n].iter().filter_map(with).collect()
    };
    let interval = |values: &mut Vec<(f64, f64)>| [0.025, 0.975].map(|share| weighed_quantile(values, share));
    let row = |n: usize| {
        let mut more = differences(n);
        let all: f64 = more.iter().map(|d| d.1).sum::<f64>().max(f64::MIN_POSITIVE);
        let less: f64 = more.iter().filter(|d| d.0 < 0.0).map(|d| d.1).sum();
        PlanOfHead {
            plan: plans[n].plan.clone(),
            over_threshold_cc: rounded(mean(&own(n))),
            interval_95_cc: interval(&mut own(n)).map(rounded),
            largest_mm: plans[n].largest_mm,
            left_by_all_over_cc: rounded(mean(&values(n))),
            more_than_least_cc: rounded(mean(&more)),
            more_interval_95_cc: interval(&mut more).map(rounded),
            less_than_least: rounded(less / all),
        }
    };
    let rows: Vec<PlanOfHead> = (0..plans.len()).map(row).collect();
    let told = |row: &PlanOfHead| row.more_interval_95_cc[0] > 0.0;
    let others = || rows.iter().enumerate().filter(|(n, _)| *n != least).map(|(_, row)| row);
    let not_told_from: Vec<String> = others().filter(|row| !told(row)).map(|row| row.plan.clone()).collect();
    let least = plans.get(least).map(|p| p.plan.clone()).unwrap_or_default();
    let mut found = PlansOfHead { head: head.to_owned(), plans: rows, least, not_told_from, sentence: String::new() };
    found.sentence = found.in_words();
    let refused: Vec<&str> = plans.iter().filter(|p| p.refused).map(|p| p.plan.as_str()).collect();
    if !refused.is_empty() {
        found.sentence +=
            &format!(" A quality gate has refused {}: do not rely on what is said of it.", refused.join(" and "));
    }
    found
}

impl PlanFigures {
    /// What a reader of the comparison must know before its answer, where a quality gate has refused the plan.
    pub fn refusal_in_words(&self) -> Option<String> {
        let (plan, why) = (&self.plan, self.refusals.join("; "));
        let told = || {
            format!(
                "A quality gate has refused {plan}: {why}. What is said of it beside others is not to be relied on."
            )
        };
        (!self.refusals.is_empty()).then(told)
    }
}

impl PlansOfHead {
    fn in_words(&self) -> String {
        let (head, least) = (&self.head, &self.least);
        if self.not_told_from.is_empty() {
            return format!(
                "With the head {head}, {least} moves least of the tissue that all plans leave: in more than 95 of 100 draws less than each \
                 other plan."
            );
        }
        format!(
            "With the head {head}, which plan moves least of the tissue that all plans leave cannot be told: {least} does on average, but \
             its difference from {} is within its spread.",
            self.not_told_from.join(" and ")
        )
    }
}

fn mean(values: &[(f64, f64)]) -> f64 {
    let all: f64 = values.iter().map(|v| v.1).sum::<f64>().max(f64::MIN_POSITIVE);
    values.iter().map(|(x, w)| x * w / all).sum()
}

#[cfg(test)]
mod tests {
    use super::super::low_discrepancy::normals;
    use super::*;

    /// A patient's draws: what is shared by all plans is large, what is the plan's own is `own`.
    fn plan(name: &str, volume: f64, own: f64, dimension: usize) -> PlanDraws {
        let draw = |n: usize| DrawnState {
            supports: "fixed".to_owned(),
            number: n,
            weight: 0.01,
            over_threshold_cc: 200.0 + volume + 50.0 * normals(n, 0, 1)[0] + own * normals(n, dimension, 1)[0],
            coordinates: Vec::new(),
        };
        of_draws(name, (0..200).map(draw).collect())
    }

    /// Of plans that take nothing from each other.
    fn of_draws(name: &str, draws: Vec<DrawnState>) -> PlanDraws {
        let of_all_cc = draws.iter().map(|draw| draw.over_threshold_cc).collect();
        PlanDraws { plan: name.to_owned(), largest_mm: 3.0, draws, of_all_cc, refused: false }
    }

    #[test]
    fn plans_are_compared_by_what_all_leave_and_their_own_tissue_is_told_beside_it() {
        let mut small = plan("plan-1", 30.0, 0.0, 1);
        small.of_all_cc = plan("plan-1", -10.0, 0.0, 1).of_all_cc;
        let found = compared_plans("supine", &[small, plan("plan-2", 0.0, 1.0, 1)]);
        assert!(found.least == "plan-1" && found.not_told_from.is_empty(), "{found:?}");
        let [small, wide] = [&found.plans[0], &found.plans[1]];
        assert!((small.over_threshold_cc - wide.over_threshold_cc - 30.0).abs() < 0.2, "{found:?}");
        assert!((wide.left_by_all_over_cc - small.left_by_all_over_cc - 10.0).abs() < 0.2, "{found:?}");
        assert!(found.sentence.contains("of the tissue that all plans leave"), "{}", found.sentence);
    }

    #[test]
    fn a_plan_that_a_gate_refused_is_said_to_be_with_the_answer() {
        let mut plans = [plan("plan-1", 10.0, 0.0, 1), plan("plan-2", 0.0, 0.0, 1)];
        assert!(!compared_plans("supine", &plans).sentence.contains("refused"));
        plans[1].refused = true;
        let said = compared_plans("supine", &plans).sentence;
        assert!(said.contains("plan-2 moves least") && said.contains("has refused plan-2"), "{said}");
        let refusals = vec!["the margin is empty".to_owned()];
        let figures = PlanFigures { plan: "plan-2".to_owned(), refusals, ..PlanFigures::default() };
        let said = figures.refusal_in_words().unwrap();
        assert!(said.contains("plan-2: the margin is empty. What"), "{said}");
        assert_eq!(PlanFigures::default().refusal_in_words(), None);
    }

    #[test]
    fn a_small_difference_is_told_where_every_draw_agrees_though_the_draws_lie_far_apart() {
        let found = compared_plans("supine", &[plan("plan-1", 10.0, 0.0, 1), plan("plan-2", 0.0, 1.0, 1)]);
        assert!(found.least == "plan-2" && found.not_told_from.is_empty(), "{found:?}");
        let row = &found.plans[0];
        assert!((row.more_than_least_cc - 10.0).abs() < 0.1 && row.less_than_least == 0.0, "{row:?}");
        assert!(row.interval_95_cc[1] - row.interval_95_cc[0] > 180.0, "alone the plans lie far apart: {row:?}");
        assert!(found.sentence.contains("plan-2 moves least"), "{}", found.sentence);
    }

    #[test]
    fn a_difference_within_its_spread_cannot_be_told() {
        let plans = [plan("plan-1", 5.0, 10.0, 1), plan("plan-2", 0.0, 10.0, 2), plan("plan-3", 200.0, 0.0, 1)];
        let found = compared_plans("left", &plans);
        assert_eq!((found.least.as_str(), found.not_told_from.as_slice()), ("plan-2", &["plan-1".to_owned()][..]));
        assert!(found.sentence.contains("cannot be told") && found.sentence.contains("plan-1"), "{}", found.sentence);
        assert!((0.2..0.5).contains(&found.plans[0].less_than_least), "{found:?}");
    }

    #[test]
    fn a_plan_against_itself_is_never_told_and_lost_supports_are_left_out() {
        let same = compared_plans("supine", &[plan("plan-1", 0.0, 3.0, 1), plan("plan-2", 0.0, 3.0, 1)]);
        assert_eq!(same.not_told_from, ["plan-2"]);
        let mut more = plan("plan-2", 0.0, 3.0, 1).draws;
        more.extend(plan("plan-2", 500.0, 0.0, 1).draws.into_iter().map(|mut d| {
            d.supports = "sliding".to_owned();
            d
        }));
        let found = compared_plans("supine", &[plan("plan-1", 0.0, 3.0, 1), of_draws("plan-2", more)]);
        assert_eq!(found.plans[1].more_interval_95_cc, [0.0, 0.0], "only draws that both have are compared: {found:?}");
    }
}

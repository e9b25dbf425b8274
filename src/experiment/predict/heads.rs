//! Ways of lying side by side: with which the brain moves least, and whether that can be told.
//!
//! A draw of a number is the same patient however the head lies, so heads are compared draw by draw, as plans are.

use super::modes::DrawnState;
use super::plans::{PlanDraws, compared_plans};
use super::support::SupportWeight;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// With which head least tissue moves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeadComparison {
    /// The head with which least moves on average; absent where heads are not compared: the skull does not hold the brain in the
    /// same ways with all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<String>,
    /// Heads that it cannot be told from: the difference is within its spread. Empty where it is told from all.
    pub not_told_from: Vec<String>,
    /// The same in words.
    pub sentence: String,
}

/// A head with its draws.
#[derive(Clone, Debug)]
pub struct HeadDraws {
    /// `supine`, `prone` ...
    pub head: String,
    /// How the brain is supported in them.
    pub supports: Vec<SupportWeight>,
    /// The draws.
    pub draws: Vec<DrawnState>,
}

/// Compares heads; of one there is nothing to say.
pub fn compared_heads(heads: &[HeadDraws]) -> Option<HeadComparison> {
    let (first, others) = heads.split_first()?;
    if others.is_empty() {
        return None;
    }
    if others.iter().any(|head| head.supports != first.supports) {
        let sentence = "With which head least moves is not said: the skull does not hold the brain in the same ways with all of them.";
        return Some(HeadComparison { sentence: sentence.to_owned(), ..HeadComparison::default() });
    }
    // The same tissue is left however the head lies.
    let of = |h: &HeadDraws| PlanDraws {
        plan: h.head.clone(),
        largest_mm: 0.0,
        draws: h.draws.clone(),
        of_all_cc: h.draws.iter().map(|draw| draw.over_threshold_cc).collect(),
        refused: false,
    };
    let found = compared_plans("", &heads.iter().map(of).collect::<Vec<_>>());
    let (least, not_told_from) = (found.least, found.not_told_from);
    let sentence = if not_told_from.is_empty() {
        format!("Least moves with the head {least}: in more than 95 of 100 draws less than with each other one.")
    } else {
        format!(
            "With which head least moves cannot be told: with the head {least} it does on average, but the difference from the head {} \
             is within its spread.",
            not_told_from.join(" and ")
        )
    };
    Some(HeadComparison { least: Some(least), not_told_from, sentence })
}

#[cfg(test)]
mod tests {
    use super::super::low_discrepancy::normals;
    use super::*;

    /// Draws around so many cc that all heads share, but for what is the head's own.
    fn head(name: &str, cc: f64, own: f64, dimension: usize) -> HeadDraws {
        let draw = |n: usize| DrawnState {
            supports: "fixed".to_owned(),
            number: n,
            weight: 0.01,
            over_threshold_cc: 300.0 + cc + 80.0 * normals(n, 0, 1)[0] + own * normals(n, dimension, 1)[0],
            coordinates: Vec::new(),
        };
        let supports = vec![SupportWeight { supports: "fixed".to_owned(), weight: 1.0 }];
        HeadDraws { head: name.to_owned(), supports, draws: (0..100).map(draw).collect() }
    }

    #[test]
    fn a_head_moves_least_only_where_the_draws_agree() {
        let told = compared_heads(&[head("supine", 10.0, 0.0, 1), head("left", 0.0, 1.0, 1)]).unwrap();
        assert!(told.sentence.starts_with("Least moves with the head left: in more than 95"), "{told:?}");
        let untold = compared_heads(&[head("supine", 5.0, 10.0, 1), head("left", 0.0, 10.0, 2)]).unwrap();
        assert!(untold.sentence.contains("cannot be told") && untold.not_told_from == ["supine"], "{untold:?}");
        assert_eq!(compared_heads(&[head("supine", 0.0, 0.0, 1)]), None);
    }

    #[test]
    fn heads_with_unlike_supports_are_not_ranked() {
        let mut other = head("left", -100.0, 0.0, 1);
        other.supports[0].weight = 0.5;
        let found = compared_heads(&[head("supine", 0.0, 0.0, 1), other]).unwrap();
        assert!(found.least.is_none() && found.sentence.contains("not said"), "{found:?}");
    }
}

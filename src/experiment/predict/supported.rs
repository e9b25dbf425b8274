//! How the skull holds the brain, as it was drawn: a way that finds no equilibrium with a head is left out, and the others count
//! for more.

use super::outcome::{HeadPrediction, Prediction};
use super::support::SupportWeight;

impl Prediction {
    /// The ways that a head's draws are of. An earlier version did not keep them.
    pub fn supports_of<'a>(&'a self, head: &'a HeadPrediction) -> &'a [SupportWeight] {
        if head.supports.is_empty() { &self.supports } else { &head.supports }
    }

    /// The ways of every head where all have the same.
    pub fn shared_supports(&self) -> Option<&[SupportWeight]> {
        let Some(first) = self.heads.first().map(|head| self.supports_of(head)) else { return Some(&self.supports) };
        self.heads.iter().all(|head| self.supports_of(head) == first).then_some(first)
    }

    /// How the skull holds the brain: a sentence, or one for each head where a way was left out of some.
    /// `held`: see [`SupportWeight::in_words`].
    pub(super) fn supports_in_words(&self, held: &[String]) -> Vec<String> {
        let of = |with: String, used: &[SupportWeight]| {
            let ways = used.iter().map(|way| way.in_words(held)).collect::<Vec<_>>().join(", or ");
            let left_out = used.len() < self.supports.len();
            let rest = if left_out {
                " Held otherwise it finds no equilibrium under these loads; that is left out."
            } else {
                ""
            };
            format!("How the skull holds the brain{with}: {ways}.{rest}")
        };
        match self.shared_supports() {
            Some(used) => vec![of(String::new(), used)],
            None => self.heads.iter().map(|h| of(format!(" with the head {}", h.head), self.supports_of(h))).collect(),
        }
    }

    /// Whether any draw is of a brain that slides.
    pub(super) fn slides(&self) -> bool {
        let of = |supports: &[SupportWeight]| supports.iter().any(SupportWeight::slides);
        of(self.shared_supports().unwrap_or_default()) || self.heads.iter().any(|head| of(self.supports_of(head)))
    }
}

impl HeadPrediction {
    /// Whether some of its draws are supported so.
    pub fn is_of(&self, supports: &str) -> bool {
        self.supports.iter().any(|way| way.supports == supports)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ways(weights: &[(&str, f64)]) -> Vec<SupportWeight> {
        weights.iter().map(|(name, weight)| SupportWeight { supports: (*name).to_owned(), weight: *weight }).collect()
    }

    fn predicted(heads: &[(&str, &[(&str, f64)])]) -> Prediction {
        let of = |(name, used): &(&str, &[(&str, f64)])| HeadPrediction {
            head: (*name).to_owned(),
            supports: ways(used),
            ..HeadPrediction::default()
        };
        let supports = ways(&[("fixed", 0.5), ("sliding", 0.5)]);
        Prediction { supports, heads: heads.iter().map(of).collect(), ..Prediction::default() }
    }

    #[test]
    fn the_weights_told_are_those_of_the_draws_head_by_head() {
        let (both, held): (&[_], &[_]) = (&[("fixed", 0.5), ("sliding", 0.5)], &[("fixed", 1.0)]);
        let said = |heads: &[(&str, &[(&str, f64)])]| predicted(heads).supports_in_words(&["base".to_owned()]);
        let all = said(&[("supine", both), ("left", both)]);
        assert!(all.len() == 1 && all[0].contains("50 %") && !all[0].contains("left out"), "{all:?}");
        let lost = said(&[("supine", held)]);
        assert!(lost.len() == 1 && lost[0].contains("100 %") && lost[0].contains("left out"), "{lost:?}");
        let unlike = said(&[("supine", both), ("left", held)]);
        assert!(
            unlike.len() == 2
                && unlike[0].contains("50 %")
                && unlike[1].contains("head left: it is held at its base (weight"),
            "{unlike:?}"
        );
        assert!(predicted(&[("supine", both), ("left", held)]).slides() && !predicted(&[("left", held)]).slides());
        assert!(said(&[("supine", &[])])[0].contains("50 %"), "an earlier version's head says nothing of its own");
    }
}

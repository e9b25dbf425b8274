//! A prediction against what was seen, and plans side by side, in a few lines of text.

use super::page::evaluation_in_a_sentence;
use crate::experiment::predict::{PlanComparison, PlanFigures, PredictionEvaluation, Scores};

/// The headline, rows of scores and coverage for each head, one for each landmark, and what the figures do not say.
pub fn evaluation_table(found: &PredictionEvaluation) -> String {
    let mut text = evaluation_in_a_sentence(found) + "\n";
    if let Some(taken) = &found.taken {
        let (planned, cc, dice) = (taken.planned_cc, taken.taken_cc, taken.dice);
        text += &format!("planned {planned:.1} cc, taken {cc:.1} cc, Dice {dice:.2}\n");
    }
    text += "\nhead         over       places  seen (mm)  expected  off by   CRPS  at rest  energy  at rest  draws smaller\n";
    let mut row = |head: &str, over: &str, s: &Scores| {
        text += &format!(
            "{head:<12} {over:<9} {:>7}  {:>9.2}  {:>8.2}  {:>6.2}  {:>5.2}  {:>7.2}  {:>6.2}  {:>7.2}  {:>9.0} %\n",
            s.places,
            s.seen_rms_mm,
            s.expected_rms_mm,
            s.error_rms_mm,
            s.crps_mm,
            s.crps_rest_mm,
            s.energy_score_mm,
            s.energy_score_rest_mm,
            100.0 * s.rank_of_seen
        );
    };
    let all: Vec<(&str, &str, &Scores)> = found
        .heads
        .iter()
        .flat_map(|h| {
            let field = h.field.iter().map(|s| (h.head.as_str(), "tissue", s));
            field.chain(h.landmarks.iter().map(|s| (h.head.as_str(), "landmarks", s)))
        })
        .collect();
    for (head, over, s) in &all {
        row(head, over, s);
    }
    text += "\ninside       over       foretold      50 % reach  95 % reach  50 % ellipsoid  95 % ellipsoid\n";
    for (head, over, s) in &all {
        for (what, c) in [("with error", s.coverage_with_error), ("draws alone", s.coverage)] {
            let [a, b, c, d] = [c.reach50, c.reach95, c.ellipsoid50, c.ellipsoid95].map(|share| 100.0 * share);
            text += &format!("{head:<12} {over:<9} {what:<12} {a:>9.0} %  {b:>8.0} %  {c:>12.0} %  {d:>12.0} %\n");
        }
    }
    text += "(with error: the error of what was seen added to every draw)\n";
    for h in found.heads.iter().filter(|h| !h.landmark.is_empty()) {
        text += &format!("\nlandmark (head {})  lies in   seen (mm)  expected  SD     off by  inside 95 %\n", h.head);
        for l in &h.landmark {
            let dash = || "-".to_owned();
            let inside = l.inside_95.map_or_else(dash, |inside| if inside { "yes" } else { "no" }.to_owned());
            let [expected, sd, error] =
                [l.expected_mm, l.sd_mm, l.error_mm].map(|x| x.map_or_else(dash, |x| format!("{x:.2}")));
            text += &format!(
                "{:<22} {:<9} {:>9.2}  {expected:>8}  {sd:>5}  {error:>6}  {inside}\n",
                l.name, l.place, l.seen_mm
            );
        }
    }
    found.limits.iter().for_each(|limit| text += &format!("\n{limit}\n"));
    text
}

/// What a quality gate refused, then for each head the answer and a row for each plan.
pub fn plans_table(found: &PlanComparison) -> String {
    let mut text = String::new();
    found.plans.iter().filter_map(PlanFigures::refusal_in_words).for_each(|said| text += &(said + "\n"));
    for head in &found.heads {
        text += &format!("{}\n", head.sentence);
        text += &format!(
            "plan         given as        taken (cc)  over {} mm (cc)  95 % between          of what all leave  more than {} (cc)  95 % between\n",
            found.threshold_mm, head.least
        );
        for row in &head.plans {
            let of = found.plans.iter().find(|plan| plan.plan == row.plan);
            let (given, cc) = of.map_or(("", 0.0), |plan| (plan.given.as_str(), plan.resected_cc));
            let ([low, high], [less, more]) = (row.interval_95_cc, row.more_interval_95_cc);
            text += &format!(
                "{:<12} {given:<14} {cc:>11.1}  {:>14.1}  {low:>8.1} to {high:<8.1}  {:>17.1}  {:>22.1}  {less:>8.1} to {more:<8.1}\n",
                row.plan, row.over_threshold_cc, row.left_by_all_over_cc, row.more_than_least_cc
            );
        }
        text += "\n";
    }
    text += &format!(
        "(plans are compared by the {:.0} cc of tissue that all of them leave: what a plan takes cannot move)\n",
        found.left_by_all_cc
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::predict::{HeadEvaluation, LandmarkForecast, PlanOfHead, PlansOfHead};

    #[test]
    fn every_row_of_an_evaluation_and_every_limit_is_printed() {
        let landmark = LandmarkForecast { name: "tip".to_owned(), place: "tissue".to_owned(), ..Default::default() };
        let scores = Scores { places: 7, seen_rms_mm: 4.25, ..Scores::default() };
        let head = HeadEvaluation {
            head: "left".to_owned(),
            landmarks: Some(scores),
            landmark: vec![landmark],
            ..HeadEvaluation::default()
        };
        let found = PredictionEvaluation { heads: vec![head], ..PredictionEvaluation::default() }.with_limits();
        let text = evaluation_table(&found);
        for words in ["4.25", "landmarks", "tip", "without error", "7 places"] {
            assert!(text.contains(words), "{words}: {text}");
        }
        let row = text.lines().find(|line| line.starts_with("tip")).unwrap();
        assert_eq!(row.split_whitespace().collect::<Vec<_>>(), ["tip", "tissue", "0.00", "-", "-", "-", "-"], "{text}");
    }

    #[test]
    fn plans_are_printed_with_what_they_are_and_what_they_differ_by() {
        let row = PlanOfHead { plan: "plan-1".to_owned(), more_than_least_cc: 6.5, ..PlanOfHead::default() };
        let head = PlansOfHead { plans: vec![row], sentence: "Cannot be told.".to_owned(), ..PlansOfHead::default() };
        let plan = PlanFigures {
            plan: "plan-1".to_owned(),
            given: "label 5".to_owned(),
            resected_cc: 12.5,
            refusals: vec!["the margin is empty".to_owned()],
            ..PlanFigures::default()
        };
        let (plans, heads) = (vec![plan], vec![head]);
        let text = plans_table(&PlanComparison { threshold_mm: 2.0, left_by_all_cc: 987.6, plans, heads });
        for words in ["Cannot be told.", "label 5", "12.5", "6.5", "over 2 mm", "the 988 cc of tissue"] {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(text.find("refused plan-1: the margin").unwrap() < text.find("Cannot be told.").unwrap(), "{text}");
    }
}

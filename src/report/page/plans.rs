//! The page of several plans of one patient side by side.

use super::super::html::{fixed, number};
use super::results::{Row, table, words};
use super::{Frame, Section, notice};
use crate::experiment::predict::{PlanComparison, PlanFigures, PlansOfHead};
use crate::layout;
use maud::{Markup, html};

/// One HTML file beside the plans' cases, to whose pages it links.
pub fn plans_page(comparison: &PlanComparison) -> String {
    let frame = Frame {
        title: "Plans of a resection, side by side",
        kicker: "before the operation",
        version: env!("CARGO_PKG_VERSION"),
    };
    let sections = [
        Section { id: "least", heading: "Which moves least", body: answer(comparison) },
        Section { id: "plans", heading: "Plans", body: plans(&comparison.plans) },
    ];
    let refusals: Vec<String> = comparison.plans.iter().filter_map(PlanFigures::refusal_in_words).collect();
    let above = html! {
        @if !refusals.is_empty() { (notice("warn", "Not to be relied on", &refusals)) }
        @for head in &comparison.heads { p class="verdict" { (head.sentence) } "\n" }
    };
    frame.html(&above, &sections, "The page makes no request to any other place.", &html! {})
}

fn answer(comparison: &PlanComparison) -> Markup {
    html! {
        @for head in &comparison.heads { (of_head(head, comparison)) }
        p {
            "Plans are compared by the tissue that all of them leave (" (number(comparison.left_by_all_cc, 3)) " cc), the four columns at \
             the right. What a plan takes cannot move: over its own tissue the plan that takes most has least left to move, and is not the \
             better for it."
        } "\n"
        p {
            "A draw is one possible patient: how stiff, how much fluid drains, how exactly the head lies. The same draw is \
             taken under every plan, and plans are compared draw by draw. Research software: not for surgical planning."
        } "\n"
    }
}

fn of_head(head: &PlansOfHead, comparison: &PlanComparison) -> Markup {
    let columns = [
        "Plan".to_owned(),
        format!("Its own tissue over {} mm (cc)", number(comparison.threshold_mm, 2)),
        "95 % between".to_owned(),
        "Largest mean shift (mm)".to_owned(),
        "Of what all leave (cc)".to_owned(),
        format!("More than {} (cc)", head.least),
        "95 % between".to_owned(),
        "Draws in which it moves less".to_owned(),
    ];
    let between = |[low, high]: [f64; 2]| format!("{} to {}", number(low, 3), number(high, 3));
    let rows: Vec<Row> = head
        .plans
        .iter()
        .map(|row| {
            let least = row.plan == head.least;
            let dash = |text: String| if least { "\u{2013}".to_owned() } else { text };
            let cells = [
                row.plan.clone(),
                number(row.over_threshold_cc, 3),
                between(row.interval_95_cc),
                number(row.largest_mm, 3),
                number(row.left_by_all_over_cc, 3),
                dash(number(row.more_than_least_cc, 3)),
                dash(between(row.more_interval_95_cc)),
                dash(format!("{} %", fixed(100.0 * row.less_than_least, 0))),
            ];
            let refused = comparison.plans.iter().any(|plan| plan.plan == row.plan && !plan.refusals.is_empty());
            (least && head.not_told_from.is_empty() && !refused, words(cells))
        })
        .collect();
    table(&format!("Head {}", head.head), &columns, &rows)
}

fn plans(plans: &[PlanFigures]) -> Markup {
    let columns = ["Plan", "Given as", "Tissue to be taken (cc)"].map(str::to_owned);
    let row = |plan: &PlanFigures| -> Row {
        let link = html! { a href={ (plan.plan) "/" (layout::PAGE) } { (plan.plan) } };
        let cells = [plan.given.clone(), number(plan.resected_cc, 3)];
        (false, [link].into_iter().chain(words(cells)).collect())
    };
    table("What is to be taken", &columns, &plans.iter().map(row).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::predict::PlanOfHead;

    #[test]
    fn the_page_answers_first_and_marks_no_winner_where_none_can_be_told() {
        let row =
            |plan: &str, cc: f64| PlanOfHead { plan: plan.to_owned(), over_threshold_cc: cc, ..PlanOfHead::default() };
        let of = |not_told_from: Vec<String>, refusals: &[&str]| {
            let head = PlansOfHead {
                head: "supine".to_owned(),
                plans: vec![row("plan-1", 31.0), row("plan-2", 12.0)],
                least: "plan-2".to_owned(),
                not_told_from,
                sentence: "The <answer>.".to_owned(),
            };
            let given = |plan: &str| PlanFigures { plan: plan.to_owned(), ..PlanFigures::default() };
            let refused =
                PlanFigures { refusals: refusals.iter().map(|&why| why.to_owned()).collect(), ..given("plan-2") };
            plans_page(&PlanComparison {
                threshold_mm: 2.0,
                left_by_all_cc: 987.6,
                plans: vec![given("plan-1"), refused],
                heads: vec![head],
            })
        };
        let (told, not) = (of(Vec::new(), &[]), of(vec!["plan-1".to_owned()], &[]));
        assert!(told.contains("class=\"best\"") && !not.contains("class=\"best\""));
        assert!(told.contains("The &lt;answer&gt;.") && told.contains("href=\"plan-1/report.html\""));
        assert!(told.find("&lt;answer").unwrap() < told.find("<table").unwrap());
        assert!(
            told.contains("the tissue that all of them leave (988 cc)") && !told.contains("quality gate"),
            "{told}"
        );
        // A plan that a gate has refused is no winner, and that is read before the answer.
        let refused = of(Vec::new(), &["the margin is empty"]);
        assert!(!refused.contains("class=\"best\""));
        assert!(refused.find("the margin is empty").unwrap() < refused.find("&lt;answer").unwrap());
    }
}

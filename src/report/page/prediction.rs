//! Before an operation: how the brain is expected to move, and how sure that is.

use super::super::html::{fixed, number};
use super::results::{Row, table, words};
use crate::experiment::parameter_name::with_unit;
use crate::experiment::predict::{Check, HeadPrediction, Prediction, Shares, SupportWeight, TargetPlace};
use maud::{Markup, html};

/// The section's body.
pub fn section(prediction: &Prediction, figure: Option<Markup>) -> Markup {
    html! {
        p class="lead" { (in_a_sentence(prediction)) } "\n"
        @if let Some(figure) = figure { (figure) }
        (heads(prediction))
        @for head in prediction.heads.iter().filter(|head| !head.targets.is_empty()) { (targets(prediction, head)) }
        h3 { "What is assumed" }
        ul {
            @for sentence in &prediction.assumptions { li { (sentence) } }
            li { "What is not in this list is not in the spread either. Research software: not for surgical planning." }
        } "\n"
        (unknowns(prediction))
        @if !prediction.checks.is_empty() { (checks(&prediction.checks)) }
    }
}

/// The headline.
pub fn in_a_sentence(prediction: &Prediction) -> String {
    let Some(head) = prediction.heads.first() else { return "Nothing was predicted.".to_owned() };
    let [x, y, z] = head.largest_at_mm.map(|v| fixed(v, 0));
    let least = prediction.least.as_ref().map_or_else(String::new, |least| format!(" {}", least.sentence));
    let no_farther = head.farthest_95_mm.map_or_else(String::new, |mm| {
        format!("; in 95 of 100 cases no place moves by more than {} mm", number(mm, 2))
    });
    let drained = if drains(head) { " and fluid drains" } else { "" };
    format!(
        "With the head {}, once {} cc are taken{drained}, the brain is expected to move by about {} mm at most, at ({x}, {y}, {z}) mm \
         of the scan{no_farther}. On average over the draws {} cc of tissue move by more than {} mm. What matters most: {}.{least}",
        head.head,
        number(prediction.plan.resected_cc, 2),
        number(head.largest_mm, 2),
        number(head.over_threshold_cc, 2),
        number(prediction.threshold_mm, 2),
        most(&head.shares),
    )
}

/// Whether any fluid drains in the draws of a head; where its level is not known, some does.
fn drains(head: &HeadPrediction) -> bool {
    let Some(fluid) = &head.fluid else { return true };
    match (fluid.drained, fluid.drained_95) {
        (Some(part), Some([_, most])) => part > 0.0 || most > 0.0,
        _ => fluid.interval_95_mm[1] > 0.0,
    }
}

/// The unknown with the largest share, in words.
fn most(shares: &Shares) -> String {
    let (name, share) =
        named(shares).into_iter().fold(("", 0.0), |best, next| if next.1 > best.1 { next } else { best });
    format!("{name} ({} % of the variance)", fixed(100.0 * share, 0))
}

/// Shares by what they are called to a reader.
fn named(shares: &Shares) -> Vec<(&'static str, f64)> {
    let poisson = shares.poisson.map(|share| ("how compressible the tissue is (Poisson's ratio)", share));
    let mut named = vec![
        ("how stiff the tissue is", shares.stiffness),
        ("how much fluid drains", shares.load),
        ("how exactly the head lies", shares.direction),
        ("the room under the skull", shares.room),
        ("how the skull holds the brain", shares.supports),
        ("several of these together", shares.together),
    ];
    named.splice(4..4, poisson);
    named
}

fn heads(prediction: &Prediction) -> Markup {
    let over = format!("Over {} mm (cc)", number(prediction.threshold_mm, 2));
    let head = ["Head", "Largest (mm)", "Median (mm)", "Median SD (mm)", "95 % reach (mm)", &over].map(str::to_owned);
    let row = |h: &HeadPrediction| -> Row {
        let figures = [h.largest_mm, h.median_mm, h.sd_median_mm, h.reach95_largest_mm, h.over_threshold_cc];
        (false, words([h.head.clone()].into_iter().chain(figures.map(|x| number(x, 3)))))
    };
    let rows: Vec<Row> = prediction.heads.iter().map(row).collect();
    let names = prediction.heads.first().map_or_else(Vec::new, |h| named(&h.shares));
    let shared: Vec<String> = ["Head"].into_iter().chain(names.iter().map(|n| n.0)).map(str::to_owned).collect();
    let shares: Vec<Row> = prediction
        .heads
        .iter()
        .map(|h| {
            let parts = named(&h.shares).into_iter().map(|(_, share)| format!("{} %", fixed(100.0 * share, 0)));
            (false, words([h.head.clone()].into_iter().chain(parts)))
        })
        .collect();
    html! {
        (table("How the head lies, side by side", &head, &rows))
        @if prediction.heads.iter().any(|h| h.fluid.is_some()) { (levels(prediction)) }
        (table("What the spread comes from (shares of the variance)", &shared, &shares))
    }
}

/// Where the fluid stands with each head.
fn levels(prediction: &Prediction) -> Markup {
    let head = [
        "Head",
        "Below the brain's highest point (mm)",
        "95 % between",
        "Highest point at x, y, z (mm)",
        "Drained then",
    ];
    let row = |h: &HeadPrediction| -> Option<Row> {
        let fluid = h.fluid.as_ref()?;
        let [low, high] = fluid.interval_95_mm.map(|mm| fixed(mm, 0));
        let place = fluid.top_at_mm.map(|x| fixed(x, 0)).join(", ");
        let below = number(fluid.below_top_mm, 3);
        let cells = [h.head.clone(), below, format!("{low} to {high}"), place, fluid.drained_in_words()];
        Some((false, words(cells)))
    };
    let rows: Vec<Row> = prediction.heads.iter().filter_map(row).collect();
    table(
        "Where the fluid stands, and how much of the fluid on the scan has drained then",
        &head.map(str::to_owned),
        &rows,
    )
}

fn targets(prediction: &Prediction, head: &HeadPrediction) -> Markup {
    let over = format!("P(over {} mm)", number(prediction.threshold_mm, 2));
    let columns = [
        "Target",
        "Lies in",
        "Expected at x, y, z (mm)",
        "Shift (mm)",
        "SD (mm)",
        "95 % ellipsoid, half axes (mm)",
        &over,
    ]
    .map(str::to_owned);
    let rows: Vec<Row> = head
        .targets
        .iter()
        .map(|t| {
            let three = |v: [f64; 3], decimals: usize| v.map(|x| fixed(x, decimals)).join(", ");
            let cells = if t.place == TargetPlace::Removed {
                ["\u{2013}", "\u{2013}", "\u{2013}", "\u{2013}", "\u{2013}"].map(str::to_owned)
            } else {
                [
                    three(t.expected_mm, 1),
                    number(t.shift_mm, 2),
                    number(t.sd_mm, 2),
                    three(t.half_axes_mm, 1),
                    format!("{} %", fixed(100.0 * t.over_threshold, 0)),
                ]
            };
            (false, words([t.called(), t.place.name().to_owned()].into_iter().chain(cells)))
        })
        .collect();
    html! { (table(&format!("Targets, head {}", head.head), &columns, &rows)) }
}

fn unknowns(prediction: &Prediction) -> Markup {
    let head = ["Not known", "Middle", "95 % between"].map(str::to_owned);
    let mut rows: Vec<Row> = prediction
        .unknowns
        .iter()
        .map(|u| {
            let [low, high] = u.interval_95.map(|x| number(x, 3));
            (false, words([with_unit(&u.name), number(u.median, 3), format!("{low} to {high}")]))
        })
        .collect();
    rows.extend(supports(prediction));
    table("What was drawn from", &head, &rows)
}

/// How the brain was supported in the draws: of every head where they are not alike.
fn supports(prediction: &Prediction) -> Vec<Row> {
    let row = |s: &SupportWeight, with: &str| -> Row {
        let weight = format!("{} %", fixed(100.0 * s.weight, 0));
        (false, words([format!("supports {}{with}", s.supports), weight, "\u{2013}".to_owned()]))
    };
    if let Some(shared) = prediction.shared_supports() {
        return shared.iter().map(|s| row(s, "")).collect();
    }
    let of = |h: &HeadPrediction| -> Vec<Row> {
        prediction.supports_of(h).iter().map(|s| row(s, &format!(", head {}", h.head))).collect()
    };
    prediction.heads.iter().flat_map(of).collect()
}

fn checks(checks: &[Check]) -> Markup {
    let head = ["Supports", "Solved whole", "Displacement (mm, RMS)", "Difference (mm, RMS)"].map(str::to_owned);
    let row = |c: &Check| -> Row {
        let figures = [c.displacement_rms_mm, c.difference_rms_mm].map(|x| number(x, 2));
        (false, words([c.supports.clone(), c.solves.to_string()].into_iter().chain(figures)))
    };
    let rows: Vec<Row> = checks.iter().map(row).collect();
    html! {
        p {
            "Draws are read from a surface through a few solved states; where the brain slides, the heaviest are solved instead, "
            "and in a fluid all of them. Some were solved whole as well: this far the prediction is off."
        }
        (table("The fast way against full solutions", &head, &rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::predict::{FluidOfHead, HeadComparison, TargetPrediction};

    fn prediction() -> Prediction {
        let head = |name: &str, cc: f64| HeadPrediction {
            head: name.to_owned(),
            largest_mm: 6.2,
            reach95_largest_mm: 12.0,
            farthest_95_mm: Some(14.0),
            over_threshold_cc: cc,
            shares: Shares { load: 0.5, stiffness: 0.2, ..Shares::default() },
            targets: vec![
                TargetPrediction {
                    target: 1,
                    name: Some("STN <left>".to_owned()),
                    shift_mm: 3.25,
                    over_threshold: 0.8,
                    ..TargetPrediction::default()
                },
                TargetPrediction {
                    target: 2,
                    place: TargetPlace::Removed,
                    shift_mm: 77.0,
                    ..TargetPrediction::default()
                },
            ],
            ..HeadPrediction::default()
        };
        Prediction {
            threshold_mm: 2.0,
            heads: vec![head("supine", 300.0), head("left", 120.0)],
            least: Some(HeadComparison { sentence: "Least cannot be told.".to_owned(), ..HeadComparison::default() }),
            assumptions: vec!["Nothing <else> happens.".to_owned()],
            ..Prediction::default()
        }
    }

    #[test]
    fn the_headline_says_how_far_how_sure_what_matters_and_whether_a_head_moves_least() {
        let said = in_a_sentence(&prediction());
        for words in ["head supine", "6.2 mm", "14 mm", "how much fluid drains (50 %", "Least cannot be told."] {
            assert!(said.contains(words), "{words}: {said}");
        }
    }

    #[test]
    fn fluid_that_just_covers_the_brain_is_not_said_to_drain() {
        let of = |drained: f64, most: f64| {
            let mut found = prediction();
            let (drained, drained_95) = (Some(drained), Some([0.0, most]));
            found.heads[0].fluid = Some(FluidOfHead { drained, drained_95, ..FluidOfHead::default() });
            in_a_sentence(&found)
        };
        let covered = of(0.0, 0.0);
        assert!(!covered.contains("and fluid drains") && covered.contains("cc are taken, the brain"), "{covered}");
        let drains = [of(0.1, 0.2), of(0.0, 0.1), in_a_sentence(&prediction())];
        assert!(drains.iter().all(|said| said.contains("taken and fluid drains, the brain")), "{drains:?}");
    }

    #[test]
    fn poissons_share_and_the_fluids_level_are_shown_where_they_were_drawn_and_known() {
        let plain = section(&prediction(), None).into_string();
        assert!(!plain.contains("Poisson") && !plain.contains("Where the fluid stands"));
        let mut found = prediction();
        found.heads[0].shares.poisson = Some(0.123);
        found.heads[1].shares.poisson = Some(0.0);
        let (drained, drained_95) = (Some(0.05), Some([0.02, 0.08]));
        let fluid = FluidOfHead { below_top_mm: 25.0, drained, drained_95, ..FluidOfHead::default() };
        found.heads[0].fluid = Some(fluid);
        let page = section(&found, None).into_string();
        for words in ["Poisson's ratio", "12 %", "Where the fluid stands", "5 % (2 to 8 %)"] {
            assert!(page.contains(words), "{words}");
        }
    }

    #[test]
    fn targets_have_their_row_and_of_removed_ones_nothing_is_said() {
        let page = section(&prediction(), None).into_string();
        assert!(page.contains("3.2") && page.contains("80 %") && page.contains("removed") && !page.contains("77"));
        assert!(page.contains("1 STN &lt;left&gt;"));
        assert!(page.contains("&lt;else&gt;") && page.contains("Research software"));
    }
}

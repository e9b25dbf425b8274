//! A prediction against what was seen afterwards.

use super::super::html::{fixed, number};
use super::results::{Row, table, words};
use crate::experiment::predict::{HeadEvaluation, PredictionEvaluation, Scores};
use crate::layout;
use maud::{Markup, html};

/// The section's body.
pub fn section(evaluation: &PredictionEvaluation) -> Markup {
    let with = |of: &dyn Fn(&HeadEvaluation) -> Option<Scores>| -> Vec<(String, Scores)> {
        evaluation.heads.iter().filter_map(|head| Some((head.head.clone(), of(head)?))).collect()
    };
    let (field, landmarks) = (with(&|head| head.field), with(&|head| head.landmarks));
    html! {
        p class="lead" { (in_a_sentence(evaluation)) } "\n"
        @if let Some(taken) = &evaluation.taken {
            p {
                "Planned were " (number(taken.planned_cc, 3)) " cc, taken " (number(taken.taken_cc, 3)) " cc; the two agree to "
                (fixed(taken.dice, 2)) " of 1 (Dice)."
            } "\n"
        }
        @if !field.is_empty() { (sizes("Over the tissue where the later scan shows it", &field)) (cover(&field)) }
        @if !landmarks.is_empty() { (sizes("Over the landmarks", &landmarks)) (cover(&landmarks)) }
        @for head in evaluation.heads.iter().filter(|head| !head.landmark.is_empty()) { (rows_of(head)) }
        ul { @for limit in &evaluation.limits { li { (limit) } } } "\n"
        @if !evaluation.later_sha256.is_empty() {
            p {
                "Held against the later case as its " code { (layout::OUTCOME) } " (SHA-256 "
                (evaluation.later_sha256.chars().take(12).collect::<String>())
                "\u{2026}) had it: where that case has been made again since, evaluate again."
            } "\n"
        }
    }
}

/// The headline: of the first way of lying, over the tissue or, without it, the landmarks.
pub fn in_a_sentence(evaluation: &PredictionEvaluation) -> String {
    let first = evaluation.heads.first();
    let Some((head, scores)) = first.and_then(|h| Some((h, h.field.or(h.landmarks)?))) else {
        return "Nothing was compared.".to_owned();
    };
    let better = 1.0 - scores.energy_score_mm / scores.energy_score_rest_mm.max(f64::MIN_POSITIVE);
    let better = if better > 0.005 {
        format!("{} % better than saying that nothing moves", fixed(100.0 * better, 0))
    } else {
        "no better than saying that nothing moves".to_owned()
    };
    let judged = if scores.is_within_error() {
        " What was seen is smaller than its own error, so this case cannot judge the forecast."
    } else {
        ""
    };
    format!(
        "Expected with the head {}: {} mm (root mean square); seen: {} mm; off by {} mm. Of {} places {} % moved no further than the 95 % \
         reach and {} % no further than the 50 % reach, the draws taken with the error of what was seen. The forecast scores {} mm (energy score), {better}.{judged}",
        head.head,
        number(scores.expected_rms_mm, 2),
        number(scores.seen_rms_mm, 2),
        number(scores.error_rms_mm, 2),
        scores.places,
        fixed(100.0 * scores.coverage_with_error.reach95, 0),
        fixed(100.0 * scores.coverage_with_error.reach50, 0),
        number(scores.energy_score_mm, 2),
    )
}

fn sizes(caption: &str, rows: &[(String, Scores)]) -> Markup {
    let head = [
        "Head",
        "Places",
        "Seen (mm, RMS)",
        "Its SD (mm, median)",
        "Expected (mm, RMS)",
        "Off by (mm, RMS)",
        "CRPS of the size (mm)",
        "CRPS, nothing moves",
        "Energy score (mm)",
        "Energy score, nothing moves",
        "Draws smaller than seen",
    ]
    .map(str::to_owned);
    let row = |(name, s): &(String, Scores)| -> Row {
        let figures = [
            s.seen_rms_mm,
            s.seen_sd_median_mm,
            s.expected_rms_mm,
            s.error_rms_mm,
            s.crps_mm,
            s.crps_rest_mm,
            s.energy_score_mm,
            s.energy_score_rest_mm,
        ]
        .map(|x| number(x, 3));
        let rank = format!("{} %", fixed(100.0 * s.rank_of_seen, 0));
        (false, words([name.clone(), s.places.to_string()].into_iter().chain(figures).chain([rank])))
    };
    table(caption, &head, &rows.iter().map(row).collect::<Vec<_>>())
}

fn cover(rows: &[(String, Scores)]) -> Markup {
    let head = ["Head", "Foretold", "50 % reach", "95 % reach", "50 % ellipsoid", "95 % ellipsoid"].map(str::to_owned);
    let both = |(name, s): &(String, Scores)| {
        [("draws with the error of what was seen", s.coverage_with_error), ("draws alone", s.coverage)].map(
            |(what, c)| -> Row {
                let shares = [c.reach50, c.reach95, c.ellipsoid50, c.ellipsoid95];
                let shares = shares.map(|share| format!("{} %", fixed(100.0 * share, 0)));
                (false, words([name.clone(), what.to_owned()].into_iter().chain(shares)))
            },
        )
    };
    table("How many places lie within what was foretold", &head, &rows.iter().flat_map(both).collect::<Vec<_>>())
}

fn rows_of(head: &HeadEvaluation) -> Markup {
    let columns =
        ["Landmark", "Lies in", "Seen (mm)", "Expected (mm)", "SD (mm)", "Off by (mm)", "In the 95 % ellipsoid"];
    let rows: Vec<Row> = head
        .landmark
        .iter()
        .map(|l| {
            let dash = || "\u{2013}".to_owned();
            let figures =
                [Some(l.seen_mm), l.expected_mm, l.sd_mm, l.error_mm].map(|x| x.map_or_else(dash, |x| fixed(x, 2)));
            let inside = l.inside_95.map_or_else(dash, |inside| if inside { "yes" } else { "no" }.to_owned());
            (false, words([l.name.clone(), l.place.clone()].into_iter().chain(figures).chain([inside])))
        })
        .collect();
    table(&format!("Landmarks, head {}", head.head), &columns.map(str::to_owned), &rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::predict::{Coverage, LandmarkForecast, TakenAgainstPlan};

    fn evaluation(energy_score_mm: f64) -> PredictionEvaluation {
        let scores = Scores {
            places: 321,
            seen_rms_mm: 4.1,
            expected_rms_mm: 3.3,
            coverage_with_error: Coverage { reach95: 0.93, reach50: 0.41, ..Coverage::default() },
            energy_score_mm,
            energy_score_rest_mm: 4.0,
            ..Scores::default()
        };
        let landmark = LandmarkForecast { name: "<1>".to_owned(), inside_95: Some(true), ..Default::default() };
        let taken = LandmarkForecast { name: "2".to_owned(), place: "removed".to_owned(), ..Default::default() };
        let head = HeadEvaluation {
            head: "supine".to_owned(),
            field: Some(scores),
            landmark: vec![landmark, taken],
            ..HeadEvaluation::default()
        };
        PredictionEvaluation {
            against: vec!["observed".to_owned()],
            taken: Some(TakenAgainstPlan::new(20.0, 22.0, 18.0)),
            heads: vec![head],
            ..PredictionEvaluation::default()
        }
        .with_limits()
    }

    #[test]
    fn the_headline_says_expected_seen_coverage_and_whether_it_was_worth_saying() {
        let said = in_a_sentence(&evaluation(1.0));
        for words in ["3.3 mm", "4.1 mm", "321 places 93 %", "41 %", "75 % better than saying that nothing moves"] {
            assert!(said.contains(words), "{words}: {said}");
        }
        assert!(in_a_sentence(&evaluation(4.2)).contains("no better than"));
    }

    #[test]
    fn the_section_holds_every_table_and_the_limits() {
        let page = section(&evaluation(1.0)).into_string();
        for words in ["0.86 of 1", "CRPS", "draws alone", "&lt;1&gt;", "Many patients do", "yes"] {
            assert!(page.contains(words), "{words}");
        }
        // Nothing is foretold of a landmark in what was to be taken: no size, no "no".
        let taken = page.split("<td>removed</td>").nth(1).unwrap();
        assert_eq!(taken.split("</tr>").next().unwrap().matches("\u{2013}").count(), 4, "{taken}");
        assert!(!page.contains("<td>no</td>"));
    }

    #[test]
    fn the_state_of_the_later_case_that_it_was_held_against_is_named() {
        assert!(!section(&evaluation(1.0)).into_string().contains("SHA-256"));
        let found = PredictionEvaluation { later_sha256: "0123456789abcdef".to_owned(), ..evaluation(1.0) };
        assert!(section(&found).into_string().contains("0123456789ab"));
    }
}

//! The brain shift: how far, where, how much of it the model explains; landmarks against it.

use super::super::html::{fixed, number, percent};
use super::results::{Row, table, words};
use crate::experiment::field::{BrainShift, Explained};
use crate::experiment::landmarks::Evaluation;
use maud::{Markup, html};

/// The section's body.
pub fn section(shift: &BrainShift, figure: Option<Markup>, landmarks: Option<&Evaluation>) -> Markup {
    let head = ["State", "Largest (mm)", "Median (mm)", "Median SD (mm)", "Smallest Jacobian"].map(str::to_owned);
    let row = |s: &crate::experiment::field::StateShift| -> Row {
        let figures = [s.largest_mm, s.median_mm, s.sd_median_mm, s.jacobian_min].map(|x| number(x, 3));
        (false, words([s.state.clone()].into_iter().chain(figures)))
    };
    let rows: Vec<Row> = shift.states.iter().map(row).collect();
    html! {
        p class="lead" { (in_a_sentence(shift)) } "\n"
        @if let Some(figure) = figure { (figure) }
        (table("Displacement of the tissue that is left", &head, &rows))
        @if let Some(d) = &shift.discrepancy {
            p {
                @if d.noise_factor > 1.0 {
                    "What the model leaves varies by " (number(d.size_mm, 2)) " mm over " (number(d.length_mm, 2)) " mm"
                } @else {
                    "What the model leaves is no more than the registration's errors"
                }
                " (" (d.nodes) " places), beside a remainder of the rigid registration of " (number(d.rigid_mm, 2))
                " mm; the state " code { "fused" } " puts the model right by both."
            } "\n"
        }
        @if let Some(found) = landmarks { (of_landmarks(found)) }
    }
}

/// The headline.
pub fn in_a_sentence(shift: &BrainShift) -> String {
    let Some(state) = shift.states.first() else { return "No displacement field was made.".to_owned() };
    let [x, y, z] = state.largest_at_mm.map(|v| fixed(v, 0));
    let share = shift.explained.as_ref().map_or_else(String::new, |e| format!(" {}", explained(e)));
    if state.largest_mm == 0.0 {
        return format!("{}, the brain has not moved.{share}", as_begun(&state.state));
    }
    format!(
        "{}, the brain moves by up to {} mm ({} mm in the median), most at ({x}, {y}, {z}) mm in the frame of the pre-operative \
         scan.{share}",
        as_begun(&state.state),
        number(state.largest_mm, 2),
        number(state.median_mm, 2)
    )
}

/// A state as a sentence begins with it.
fn as_begun(state: &str) -> String {
    match state {
        "estimate" => "As estimated".to_owned(),
        "fused" => "By model and images together".to_owned(),
        "observed" => "As the images show it".to_owned(),
        "predicted" => "As predicted".to_owned(),
        sample => format!("In {sample}"),
    }
}

fn explained(e: &Explained) -> String {
    match (e.share, e.share_sd) {
        (Some(share), Some(sd)) => {
            format!(
                "The model explains {} of the shift that the images show (with the registration's own error still in it).",
                percent(share, sd)
            )
        }
        _ => format!(
            "Which share of the shift the model explains is not measurable: the images show {} mm, their noise is {} mm.",
            number(e.seen_rms_mm, 2),
            number(e.noise_rms_mm, 2)
        ),
    }
}

fn of_landmarks(found: &Evaluation) -> Markup {
    let head = ["Carried by", "Landmarks", "Mean (mm)", "Median (mm)", "95 % below (mm)", "Inside 95 % ellipsoid"]
        .map(str::to_owned);
    let rows: Vec<Row> = found
        .summary
        .iter()
        .map(|s| {
            let figures = [s.mean_mm, s.median_mm, s.percentile_95_mm].map(|x| number(x, 3));
            let inside = s
                .inside_95_share
                .map_or_else(|| "\u{2013}".to_owned(), |share| format!("{} %", fixed(100.0 * share, 0)));
            (false, words([s.state.clone(), s.landmarks.to_string()].into_iter().chain(figures).chain([inside])))
        })
        .collect();
    html! { h3 { "Landmarks" } (table("Target registration error", &head, &rows)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::field::StateShift;

    #[test]
    fn where_nothing_moves_no_share_is_claimed() {
        let state = StateShift {
            state: "estimate".to_owned(),
            largest_mm: 6.24,
            median_mm: 1.5,
            largest_at_mm: [10.0, -20.4, 31.0],
            sd_median_mm: 0.2,
            jacobian_min: 0.7,
            smoothed_voxels: 0,
            believed_cc: 1000.0,
        };
        let share = |share: Option<f64>| Explained {
            share,
            share_sd: share.map(|_| 0.05),
            seen_rms_mm: 0.3,
            noise_rms_mm: 0.5,
            left_rms_mm: 0.3,
            nodes: 100,
        };
        let said = |e| {
            in_a_sentence(&BrainShift {
                states: vec![state.clone()],
                explained: Some(share(e)),
                ..BrainShift::default()
            })
        };
        assert!(said(None).contains("not measurable") && !said(None).contains('%'));
        assert!(
            said(Some(0.8)).contains("80 \u{b1} 5 %")
                && said(Some(0.8)).starts_with("As estimated")
                && said(Some(0.8)).contains("(10, \u{2212}20, 31)"),
            "{}",
            said(Some(0.8))
        );
        let still = StateShift { largest_mm: 0.0, median_mm: 0.0, ..state.clone() };
        let said = in_a_sentence(&BrainShift { states: vec![still], ..BrainShift::default() });
        assert_eq!(said, "As estimated, the brain has not moved.");
    }
}

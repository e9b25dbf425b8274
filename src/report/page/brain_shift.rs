//! The brain shift: how far, where, how much of it the model explains; landmarks against it.

use super::super::html::{count, fixed, number, percent};
use super::results::{Row, table, words};
use crate::experiment::field::{BrainShift, Explained, StateShift};
use crate::experiment::landmarks::Evaluation;
use maud::{Markup, html};

/// The section's body.
pub fn section(shift: &BrainShift, figure: Option<Markup>, landmarks: Option<&Evaluation>) -> Markup {
    let head = ["State", "Largest (mm)", "Median (mm)", "Median SD (mm)", "Smallest Jacobian", "Not believed (cc)"]
        .map(str::to_owned);
    let row = |s: &StateShift| -> Row {
        let size = |x: f64| if s.is_believed() { number(x, 3) } else { "\u{2013}".to_owned() };
        let sizes = [s.largest_mm, s.median_mm, s.sd_median_mm].map(size);
        let left_out = match (s.smoothed_voxels, s.not_believed_cc) {
            (0, _) => "0".to_owned(),
            (_, Some(cc)) => number(cc, 3),
            (_, None) => voxels(s),
        };
        (false, words([s.state.clone()].into_iter().chain(sizes).chain([number(s.jacobian_min, 3), left_out])))
    };
    let rows: Vec<Row> = shift.states.iter().map(row).collect();
    html! {
        p class="lead" { (in_a_sentence(shift)) } "\n"
        @if let Some(figure) = figure { (figure) }
        (table("Displacement of the tissue that is left", &head, &rows))
        @if shift.states.iter().any(|s| s.smoothed_voxels > 0) {
            p {
                "Not believed: tissue that a state folds over. Its displacement was smoothed and counts in none of the lengths."
            } "\n"
        }
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
    // Of no tissue the largest displacement is 0 as well.
    if !state.is_believed() {
        return format!(
            "{}, how far the brain moves cannot be told: the displacement of no tissue is believed.{share}",
            as_begun(&state.state)
        );
    }
    let left_out = left_out(state).map_or_else(String::new, |what| format!("; {what}"));
    if state.largest_mm == 0.0 {
        return format!("{}, the brain has not moved{left_out}.{share}", as_begun(&state.state));
    }
    format!(
        "{}, the brain moves by up to {} mm ({} mm in the median), most at ({x}, {y}, {z}) mm in the frame of the pre-operative \
         scan{left_out}.{share}",
        as_begun(&state.state),
        number(state.largest_mm, 2),
        number(state.median_mm, 2)
    )
}

/// The tissue that no size of a state counts, in half a sentence; `None` where it folds nowhere.
pub fn left_out(state: &StateShift) -> Option<String> {
    let much = || state.not_believed_cc.map_or_else(|| voxels(state), |cc| format!("{} cc", number(cc, 2)));
    (state.smoothed_voxels > 0).then(|| format!("tissue that folds over ({}) is not believed and left out", much()))
}

fn voxels(state: &StateShift) -> String {
    format!("{} voxels", count(state.smoothed_voxels))
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
    let head = ["Carried by", "Landmarks", "Mean (mm)", "Median (mm)", "95 % below (mm)", "Inside 95 % sphere"]
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
    html! {
        h3 { "Landmarks" }
        (table("Target registration error", &head, &rows))
        @if found.summary.iter().any(|s| s.inside_95_share.is_some()) {
            p {
                "The sphere is the one that holds 95 % of an error of the predicted size where it is alike in all directions (2.795 \
                 standard deviations of a component); an error that has a direction of its own is not looked at by it."
            } "\n"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::landmarks::StateErrors;

    fn state() -> StateShift {
        StateShift {
            state: "estimate".to_owned(),
            largest_mm: 6.24,
            median_mm: 1.5,
            largest_at_mm: [10.0, -20.4, 31.0],
            sd_median_mm: 0.2,
            jacobian_min: 0.7,
            smoothed_voxels: 0,
            believed_cc: 1000.0,
            not_believed_cc: Some(0.0),
        }
    }

    fn of(state: StateShift) -> BrainShift {
        BrainShift { states: vec![state], ..BrainShift::default() }
    }

    #[test]
    fn tissue_that_is_left_out_of_the_sizes_is_told() {
        let folded = StateShift { smoothed_voxels: 1250, not_believed_cc: Some(1.27), ..state() };
        let said = in_a_sentence(&of(folded.clone()));
        assert!(said.ends_with("scan; tissue that folds over (1.3 cc) is not believed and left out."), "{said}");
        let html = section(&of(folded.clone()), None, None).into_string();
        assert!(html.contains("Not believed (cc)") && html.contains("<td>1.27</td>"), "{html}");
        // A file of an earlier version has the voxels alone.
        let old = section(&of(StateShift { not_believed_cc: None, ..folded }), None, None).into_string();
        assert!(old.contains("voxels</td>") && old.contains("voxels) is not believed"), "{old}");
        let whole = section(&of(state()), None, None).into_string();
        assert!(whole.contains("<td>0</td>") && !whole.contains("folds over"), "{whole}");
    }

    #[test]
    fn where_nothing_is_believed_nothing_is_said_to_stand_still() {
        let none = StateShift {
            largest_mm: 0.0,
            median_mm: 0.0,
            sd_median_mm: 0.0,
            smoothed_voxels: 900,
            believed_cc: 0.0,
            not_believed_cc: Some(0.9),
            ..state()
        };
        let said = in_a_sentence(&of(none.clone()));
        assert!(said.contains("cannot be told") && !said.contains("not moved"), "{said}");
        let html = section(&of(none), None, None).into_string();
        assert_eq!(html.matches("<td>\u{2013}</td>").count(), 3, "{html}");
    }

    #[test]
    fn landmarks_are_held_against_a_sphere_and_its_error_is_said_to_have_no_direction() {
        let row = |inside_95_share| StateErrors {
            state: "fused".to_owned(),
            landmarks: 20,
            mean_mm: 1.0,
            median_mm: 1.0,
            percentile_95_mm: 2.0,
            inside_95_share,
        };
        let page =
            |inside| of_landmarks(&Evaluation { summary: vec![row(inside)], ..Evaluation::default() }).into_string();
        let told = page(Some(0.9));
        assert!(told.contains("Inside 95 % sphere") && told.contains("alike in all directions"), "{told}");
        assert!(!told.contains("ellipsoid") && !page(None).contains("alike in all directions"));
    }

    #[test]
    fn where_nothing_moves_no_share_is_claimed() {
        let state = state();
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

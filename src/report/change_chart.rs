//! What deformation does to an error, subject by subject: undeformed on the left, deformed on the right, a line between.

use super::chart::{Axis, SERIES_COLOURS, open};
use super::html::{escape, number};
use std::fmt::Write;

/// One subject's error before and after, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Whose.
    pub name: String,
    /// At rest.
    pub before: f64,
    /// Deformed.
    pub after: f64,
}

/// Middle and spread of the subjects' errors, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Middle {
    /// Median.
    pub median: f64,
    /// Median absolute deviation from it.
    pub mad: f64,
}

/// The subjects at one set of nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangePanel {
    /// Where the error was measured.
    pub name: String,
    /// The subjects.
    pub changes: Vec<Change>,
    /// Their middle undeformed and deformed.
    pub middle: [Middle; 2],
}

/// Panels side by side over one axis, as Fig. 5 of Granados et al. (2021) sets rest beside simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeChart {
    /// One sentence for those who cannot see it.
    pub description: String,
    /// Label of the axis, with unit.
    pub y_label: String,
    /// Names of the two states.
    pub states: [String; 2],
    /// The panels, left to right.
    pub panels: Vec<ChangePanel>,
    /// The error of the measurement itself.
    pub floor: Option<f64>,
}

const LEFT: f64 = 74.0;
const PANEL: f64 = 236.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 308.0;

impl ChangeChart {
    /// The chart as an SVG element.
    pub fn to_svg(&self) -> String {
        let width = LEFT + PANEL * self.panels.len() as f64 + 18.0;
        let values = self.panels.iter().flat_map(|panel| {
            let whiskers = panel.middle.iter().map(|m| m.median + m.mad);
            panel.changes.iter().flat_map(|c| [c.before, c.after]).chain(whiskers)
        });
        let axis = Axis::over(values.chain(self.floor), false, true, [BOTTOM, TOP]);
        let mut svg = open(width, 360.0, &self.description);
        for (value, text) in axis.ticks(5) {
            let y = axis.at(value);
            let _ = write!(
                svg,
                "<path d=\"M{LEFT} {y:.1}H{:.1}\" stroke=\"currentColor\" opacity=\".13\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"currentColor\">{text}</text>",
                width - 18.0,
                LEFT - 7.0,
                y + 4.0
            );
        }
        let _ = write!(
            svg,
            "<path d=\"M{LEFT} {TOP}V{BOTTOM}H{:.1}\" fill=\"none\" stroke=\"currentColor\"/>\
             <text transform=\"translate(15 {:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>",
            width - 18.0,
            f64::midpoint(TOP, BOTTOM),
            escape(&self.y_label)
        );
        for (n, panel) in self.panels.iter().enumerate() {
            self.draw_panel(&mut svg, n, panel, &axis);
        }
        if let Some(floor) = self.floor {
            let y = axis.at(floor);
            let _ = write!(
                svg,
                "<path d=\"M{LEFT} {y:.1}H{0:.1}\" stroke=\"currentColor\" stroke-dasharray=\"6 4\" opacity=\".65\"/>\
                 <text x=\"{1:.1}\" y=\"{2:.1}\" text-anchor=\"middle\" fill=\"currentColor\">noise floor</text>",
                width - 18.0,
                f64::midpoint(LEFT, width - 18.0),
                if BOTTOM - y > 20.0 { y + 14.0 } else { y - 5.0 }
            );
        }
        svg + "</svg>"
    }

    fn draw_panel(&self, svg: &mut String, n: usize, panel: &ChangePanel, axis: &Axis) {
        let colour = SERIES_COLOURS[n % SERIES_COLOURS.len()];
        let x0 = LEFT + PANEL * n as f64;
        let xs = [x0 + 0.25 * PANEL, x0 + 0.75 * PANEL];
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"16\" text-anchor=\"middle\" fill=\"currentColor\" font-weight=\"600\">{}</text>",
            x0 + PANEL / 2.0,
            escape(&panel.name)
        );
        for ((x, state), middle) in xs.into_iter().zip(&self.states).zip(panel.middle) {
            let figures = format!("{} ± {}", number(middle.median, 3), number(middle.mad, 2));
            for (line, text) in [state, &figures].into_iter().enumerate() {
                let (y, text) = (BOTTOM + 20.0 + 17.0 * line as f64, escape(text));
                let _ = write!(
                    svg,
                    "<text x=\"{x:.1}\" y=\"{y}\" text-anchor=\"middle\" fill=\"currentColor\">{text}</text>"
                );
            }
        }
        // Many subjects are many thin lines: still one picture.
        let opacity = (4.0 / panel.changes.len().max(1) as f64).clamp(0.08, 0.6);
        for change in panel.changes.iter().filter(|c| c.before.is_finite() && c.after.is_finite()) {
            let [before, after] = [axis.at(change.before), axis.at(change.after)];
            let title = format!("{}: {} to {} mm", change.name, number(change.before, 3), number(change.after, 3));
            let _ = write!(
                svg,
                "<g opacity=\"{opacity:.2}\" stroke=\"{colour}\" fill=\"{colour}\"><title>{}</title>\
                 <path d=\"M{1:.1} {before:.1}L{2:.1} {after:.1}\"/><circle cx=\"{1:.1}\" cy=\"{before:.1}\" r=\"3\"/>\
                 <circle cx=\"{2:.1}\" cy=\"{after:.1}\" r=\"3\"/></g>",
                escape(&title),
                xs[0],
                xs[1]
            );
        }
        // Beside the subjects' points, not on them.
        let at = [xs[0] - 14.0, xs[1] + 14.0];
        for (x, middle) in at.into_iter().zip(panel.middle) {
            let y = axis.at(middle.median);
            let (low, high) = (axis.at((middle.median - middle.mad).max(0.0)), axis.at(middle.median + middle.mad));
            let _ = write!(
                svg,
                "<path d=\"M{x:.1} {low:.1}V{high:.1}M{0:.1} {low:.1}h8M{0:.1} {high:.1}h8\" stroke=\"{colour}\" \
                 stroke-width=\"2\"/><circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"{colour}\"/>",
                x - 4.0
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_subject_has_a_line_and_an_error_that_grew_rises() {
        let change = |name: &str, before: f64, after: f64| Change { name: name.to_owned(), before, after };
        let middle = |median: f64| Middle { median, mad: 0.25 };
        let chart = ChangeChart {
            description: "Errors".to_owned(),
            y_label: "RMSE (mm)".to_owned(),
            states: ["rest".to_owned(), "deformed".to_owned()],
            panels: vec![ChangePanel {
                name: "margin <1>".to_owned(),
                changes: vec![change("sub-1", 2.0, 1.0), change("sub-2", 1.0, 2.0), change("sub-3", f64::NAN, 1.0)],
                middle: [middle(1.5), middle(1.25)],
            }],
            floor: Some(0.5),
        };
        let svg = chart.to_svg();
        assert!(svg.contains("margin &lt;1&gt;") && svg.contains("sub-1: 2.00 to 1.00 mm"), "{svg}");
        assert!(!svg.contains("sub-3") && !svg.contains("NaN"), "{svg}");
        let heights: Vec<f64> = svg
            .split("<circle ")
            .skip(1)
            .map(|rest| rest.split("cy=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap())
            .collect();
        let [fell_from, fell_to, rose_from, rose_to, ..] = heights[..] else { panic!("{heights:?}") };
        assert!(fell_from < fell_to && rose_from > rose_to && fell_from == rose_to);
    }
}

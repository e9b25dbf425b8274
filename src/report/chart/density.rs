//! Densities of one quantity over each other, each scaled to its own peak, with their intervals on the foot of the plot.

use super::axis::{Axis, foot, open};
use super::line::Rule;
use super::series_colour::SERIES_COLOURS;
use crate::report::html::escape;
use std::fmt::Write;

/// One density.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityCurve {
    /// What the legend says of it, its interval included.
    pub name: String,
    /// The quantity and the density there, in the order of the quantity; the highest density is 1.
    pub points: Vec<[f64; 2]>,
    /// The interval that is marked.
    pub interval: [f64; 2],
    /// Drawn as what was known before: dashed, in the colour of the text, without a filled interval.
    pub before: bool,
}

/// Densities over one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DensityChart {
    /// One sentence for those who cannot see it.
    pub description: String,
    /// Label of the axis, with unit.
    pub x_label: String,
    /// Logarithmic axis.
    pub x_log: bool,
    /// The densities, the first at the back.
    pub curves: Vec<DensityCurve>,
    /// Values with a meaning of their own; dotted, named in the legend.
    pub rules: Vec<Rule>,
}

const WIDTH: f64 = 640.0;
const LINE: f64 = 18.0;
/// Room between the foot of the curves and the axis, for the bars of the intervals.
const BARS: f64 = 11.0;

impl DensityChart {
    /// The chart as an SVG element, scaling with its container.
    pub fn to_svg(&self) -> String {
        let top = 12.0 + LINE * (self.curves.len() + self.rules.len()) as f64;
        let ground = top + 150.0;
        let bottom = ground + BARS * self.curves.len() as f64 + 4.0;
        let values = self.curves.iter().flat_map(|c| c.points.iter().map(|p| p[0]).chain(c.interval));
        let x_axis = Axis::over(values.chain(self.rules.iter().map(|r| r.at)), self.x_log, false, [24.0, WIDTH - 18.0]);
        let y = |density: f64| ground - (ground - top - 6.0) * density;
        let mut svg = open(WIDTH, bottom + 50.0, &self.description);
        for (n, curve) in self.curves.iter().enumerate() {
            let (stroke, dashes) = look(curve);
            let line = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
                points.map(|p| format!("{:.1} {:.1}", x_axis.at(p[0]), y(p[1]))).collect::<Vec<_>>().join("L")
            };
            let [low, high] = curve.interval.map(|x| x_axis.at(x));
            if !curve.before {
                let inside = |p: &&[f64; 2]| p[0] >= curve.interval[0] && p[0] <= curve.interval[1];
                let edge = line(&mut curve.points.iter().filter(inside));
                if !edge.is_empty() {
                    let _ = write!(
                        svg,
                        "<path d=\"M{low:.1} {ground}L{edge}L{high:.1} {ground}z\" fill=\"{stroke}\" opacity=\".22\"/>"
                    );
                }
            }
            let bar = ground + BARS * (n as f64 + 0.75);
            let _ = write!(
                svg,
                "<path d=\"M{}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"2\"{dashes} stroke-linejoin=\"round\"/>\
                 <path d=\"M{low:.1} {bar:.1}H{high:.1}\" stroke=\"{stroke}\" stroke-width=\"3\"{dashes}/>\
                 <path d=\"M{low:.1} {:.1}v8M{high:.1} {:.1}v8\" stroke=\"{stroke}\" stroke-width=\"1.5\"/>",
                line(&mut curve.points.iter()),
                bar - 4.0,
                bar - 4.0
            );
            Self::legend(&mut svg, n, &curve.name, &format!("stroke=\"{stroke}\" stroke-width=\"2\"{dashes}"));
        }
        for (n, rule) in self.rules.iter().enumerate() {
            let x = x_axis.at(rule.at);
            let _ = write!(svg, "<path d=\"M{x:.1} {bottom:.1}V{top:.1}\" {RULE}/>");
            Self::legend(&mut svg, self.curves.len() + n, &rule.name, RULE);
        }
        foot(&mut svg, &x_axis, bottom, &self.x_label);
        svg + "</svg>"
    }

    fn legend(svg: &mut String, row: usize, name: &str, stroke: &str) {
        let y = 12.0 + LINE * row as f64;
        let _ = write!(
            svg,
            "<path d=\"M24 {y:.1}h34\" {stroke}/><text x=\"66\" y=\"{:.1}\" fill=\"currentColor\">{}</text>",
            y + 4.0,
            escape(name)
        );
    }
}

const RULE: &str = "stroke=\"currentColor\" stroke-width=\"1.6\" stroke-dasharray=\"1.5 3\"";

/// Colour and dashes: neither says anything that the other does not.
fn look(curve: &DensityCurve) -> (&'static str, &'static str) {
    if curve.before { ("currentColor", " stroke-dasharray=\"7 4\"") } else { (SERIES_COLOURS[0], "") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::svg_check::well_formed;

    fn curve(name: &str, middle: f64, before: bool) -> DensityCurve {
        let at = |n: i32| middle * (0.1 * f64::from(n)).exp();
        let points = (-5..=5).map(|n| [at(n), (-0.05 * f64::from(n * n)).exp()]).collect();
        DensityCurve { name: name.to_owned(), points, interval: [at(-3), at(3)], before }
    }

    #[test]
    fn prior_and_posterior_differ_in_dashes_as_well_as_in_colour_and_only_one_is_filled() {
        let chart = DensityChart {
            description: "a < b".to_owned(),
            x_log: true,
            curves: vec![curve("prior & more", 500.0, true), curve("posterior", 900.0, false)],
            rules: vec![Rule { at: 700.0, name: "what went in".to_owned() }],
            ..DensityChart::default()
        };
        let svg = chart.to_svg();
        well_formed(&svg);
        assert!(svg.contains("prior &amp; more") && svg.contains("what went in") && !svg.contains("NaN"));
        // Curve, bar and legend of the prior.
        assert_eq!(svg.matches("stroke-dasharray=\"7 4\"").count(), 3);
        assert_eq!(svg.matches("opacity=\".22\"").count(), 1);
    }

    #[test]
    fn a_higher_value_lies_further_right_and_no_curve_leaves_the_picture() {
        let chart = DensityChart { x_log: true, curves: vec![curve("p", 500.0, false)], ..DensityChart::default() };
        let svg = chart.to_svg();
        let path = svg.split("<path d=\"M").find(|p| p.contains("stroke-linejoin")).unwrap();
        let points: Vec<Vec<f64>> = path[..path.find('"').unwrap()]
            .split('L')
            .map(|p| p.split(' ').map(|n| n.parse().unwrap()).collect())
            .collect();
        assert_eq!(points.len(), 11);
        assert!(points.windows(2).all(|w| w[0][0] < w[1][0]));
        assert!(points.iter().all(|p| p[0] >= 24.0 && p[0] <= 622.0 && p[1] > 12.0 && p[1] < 200.0));
    }
}

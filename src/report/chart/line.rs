//! Lines through points over linear or logarithmic axes, with legend and named rules.

use super::axis::{Axis, frame, open};
use super::series_colour::SERIES_COLOURS;
use crate::report::html::escape;
use std::fmt::Write;

const MARKERS: [Marker; 3] = [Marker::Disc, Marker::Square, Marker::Diamond];

#[derive(Clone, Copy)]
enum Marker {
    Disc,
    Square,
    Diamond,
}

/// A point of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct DataPoint {
    /// Abscissa.
    pub x: f64,
    /// Ordinate; not finite: left out (a gap in the line).
    pub y: f64,
    /// Half length of the error bar.
    pub y_error: Option<f64>,
    /// What the reader sees when pointing at it.
    pub note: String,
    /// Drawn with a ring around it: the best sample.
    pub chosen: bool,
}

/// A line through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in the order of the line.
    pub points: Vec<DataPoint>,
}

/// A line of constant x or y, with its meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// Where.
    pub at: f64,
    /// What it says.
    pub name: String,
}

/// Lines over linear or logarithmic axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LineChart {
    /// What the picture shows, one sentence for those who cannot see it.
    pub description: String,
    /// Label of the x axis, with unit.
    pub x_label: String,
    /// Label of the y axis, with unit.
    pub y_label: String,
    /// Logarithmic x axis.
    pub x_log: bool,
    /// Logarithmic y axis.
    pub y_log: bool,
    /// Whether y = 0 is part of a linear axis.
    pub y_from_zero: bool,
    /// The lines.
    pub series: Vec<Series>,
    /// Horizontal lines.
    pub y_rules: Vec<Rule>,
    /// Vertical lines.
    pub x_rules: Vec<Rule>,
}

fn marker(svg: &mut String, kind: Marker, x: f64, y: f64, colour: &str, note: &str) {
    let title = if note.is_empty() { String::new() } else { format!("<title>{}</title>", escape(note)) };
    let _ = match kind {
        Marker::Disc => write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\">{title}</circle>"),
        Marker::Square => {
            let (x, y) = (x - 3.6, y - 3.6);
            write!(svg, "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"7.2\" height=\"7.2\" fill=\"{colour}\">{title}</rect>")
        }
        Marker::Diamond => {
            write!(svg, "<path d=\"M{x:.1} {:.1}l5 5-5 5-5-5z\" fill=\"{colour}\">{title}</path>", y - 5.0)
        }
    };
}

impl LineChart {
    /// The chart as an SVG element, 640 x 360 units, scaling with its container.
    pub fn to_svg(&self) -> String {
        let (width, height) = (640.0, 360.0);
        let legend = self.legend(width);
        let rows = legend.last().map_or(0.0, |(_, row)| row + 1.0);
        let top = 14.0 + 22.0 * rows;
        let points = || self.series.iter().flat_map(|s| &s.points).filter(|p| p.y.is_finite());
        let xs = points().map(|p| p.x).chain(self.x_rules.iter().map(|r| r.at));
        let x_axis = Axis::over(xs, self.x_log, false, [74.0, width - 18.0]);
        let ys = points()
            .flat_map(|p| [p.y - p.y_error.unwrap_or(0.0), p.y + p.y_error.unwrap_or(0.0)])
            .chain(self.y_rules.iter().map(|r| r.at));
        let y_axis = Axis::over(ys, self.y_log, self.y_from_zero, [height - 52.0, top]);
        let mut svg = open(width, height, &self.description);
        frame(&mut svg, &x_axis, &y_axis, &self.x_label, &self.y_label);
        let levels: Vec<f64> = self.y_rules.iter().map(|rule| y_axis.at(rule.at)).collect();
        for ((rule, &y), label) in self.y_rules.iter().zip(&levels).zip(apart(&levels, top)) {
            let text = escape(&rule.name);
            let [x0, x1] = x_axis.pixels;
            let _ = write!(
                svg,
                "<path d=\"M{x0} {y:.1}H{x1}\" stroke=\"currentColor\" stroke-dasharray=\"6 4\" opacity=\".65\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"currentColor\">{text}</text>",
                x1 - 4.0,
                label
            );
        }
        for rule in &self.x_rules {
            let (x, text) = (x_axis.at(rule.at), escape(&rule.name));
            let [bottom, top] = y_axis.pixels;
            let near_right = x > width * 0.7;
            let _ = write!(
                svg,
                "<path d=\"M{x:.1} {bottom}V{top}\" stroke=\"currentColor\" stroke-dasharray=\"2 3\" opacity=\".8\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{}\" fill=\"currentColor\">{text}</text>",
                if near_right { x - 5.0 } else { x + 5.0 },
                top + 12.0,
                if near_right { "end" } else { "start" }
            );
        }
        for (n, series) in self.series.iter().enumerate() {
            self.draw_series(&mut svg, n, series, &x_axis, &y_axis);
        }
        for (n, (x, row)) in legend.into_iter().enumerate() {
            let (y, name) = (14.0 + 22.0 * row, escape(&self.series[n].name));
            marker(&mut svg, shape(n), x, y, SERIES_COLOURS[n % SERIES_COLOURS.len()], "");
            let _ = write!(svg, "<text x=\"{:.1}\" y=\"{}\" fill=\"currentColor\">{name}</text>", x + 11.0, y + 4.0);
        }
        svg + "</svg>"
    }

    fn draw_series(&self, svg: &mut String, n: usize, series: &Series, x_axis: &Axis, y_axis: &Axis) {
        let colour = SERIES_COLOURS[n % SERIES_COLOURS.len()];
        let usable = |p: &DataPoint| p.y.is_finite() && (!self.y_log || p.y > 0.0) && (!self.x_log || p.x > 0.0);
        let mut line = String::new();
        let mut pen_down = false;
        for p in &series.points {
            if usable(p) {
                let _ = write!(line, "{}{:.1} {:.1}", if pen_down { "L" } else { "M" }, x_axis.at(p.x), y_axis.at(p.y));
            }
            pen_down = usable(p);
        }
        let _ = write!(
            svg,
            "<path d=\"{line}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\" stroke-linejoin=\"round\"/>"
        );
        for p in series.points.iter().filter(|p| usable(p)) {
            let (x, y) = (x_axis.at(p.x), y_axis.at(p.y));
            if let Some(error) = p.y_error.filter(|e| e.is_finite() && *e > 0.0 && !self.y_log) {
                let (low, high) = (y_axis.at(p.y - error), y_axis.at(p.y + error));
                let (l, r) = (x - 4.0, x + 4.0);
                let _ = write!(
                    svg,
                    "<path d=\"M{x:.1} {low:.1}V{high:.1}M{l:.1} {low:.1}H{r:.1}M{l:.1} {high:.1}H{r:.1}\" \
                     stroke=\"{colour}\" stroke-width=\"1.5\"/>"
                );
            }
            marker(svg, shape(n), x, y, colour, &p.note);
            if p.chosen {
                let _ = write!(
                    svg,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"9\" fill=\"none\" stroke=\"currentColor\" \
                     stroke-width=\"1.8\"/>"
                );
            }
        }
    }

    /// Place and row of every series' name, in as many rows as the names need; none for a single series.
    fn legend(&self, width: f64) -> Vec<(f64, f64)> {
        if self.series.len() < 2 {
            return Vec::new();
        }
        let (mut x, mut row) = (80.0, 0.0);
        let place = |series: &Series| {
            let needed = 34.0 + 6.6 * series.name.chars().count() as f64;
            if x > 80.0 && x + needed > width {
                (x, row) = (80.0, row + 1.0);
            }
            let at = (x, row);
            x += needed;
            at
        };
        self.series.iter().map(place).collect()
    }
}

/// Where the names of horizontal lines stand: above their line where there is room, and never over each other.
fn apart(levels: &[f64], top: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..levels.len()).collect();
    order.sort_by(|a, b| levels[*a].total_cmp(&levels[*b]));
    let (mut places, mut above) = (vec![0.0; levels.len()], f64::NEG_INFINITY);
    for n in order {
        let wanted = if levels[n] < top + 16.0 { levels[n] + 14.0 } else { levels[n] - 5.0 };
        above = wanted.max(above + LINE);
        places[n] = above;
    }
    places
}

/// From one line of text to the next.
const LINE: f64 = 14.0;

/// The marker of series number `n`: where colours come round again the shape is another.
fn shape(n: usize) -> Marker {
    MARKERS[(n + n / SERIES_COLOURS.len()) % MARKERS.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::svg_check::well_formed;

    fn point(x: f64, y: f64) -> DataPoint {
        DataPoint { x, y, y_error: Some(0.1), note: "a <b>".to_owned(), chosen: x == 2.0 }
    }

    #[test]
    fn names_that_do_not_fit_a_row_go_to_the_next_and_no_two_series_look_alike() {
        let series = |n: usize| Series { name: format!("hyperelastic healthy {n}"), points: vec![point(1.0, 1.0)] };
        let chart = LineChart { series: (0..9).map(series).collect(), ..LineChart::default() };
        let places = chart.legend(640.0);
        assert!(places.iter().all(|(x, _)| x + 34.0 + 6.6 * 22.0 <= 640.0), "{places:?}");
        assert!(places.windows(2).all(|w| w[0].1 < w[1].1 || w[0].0 < w[1].0));
        let looks: Vec<_> = (0..9).map(|n| (SERIES_COLOURS[n % SERIES_COLOURS.len()], shape(n) as usize)).collect();
        assert!((0..9).all(|n| !looks[..n].contains(&looks[n])));
        well_formed(&chart.to_svg());
    }

    #[test]
    fn points_lie_on_a_line_of_their_own_scale_and_gaps_break_it() {
        let points = vec![point(1.0, 3.0), point(2.0, 1.0), point(3.0, f64::NAN), point(4.0, 2.0), point(5.0, 2.0)];
        let chart = LineChart {
            description: "a & b".to_owned(),
            series: vec![Series { name: "s".to_owned(), points }],
            y_rules: vec![Rule { at: 4.0, name: "rest".to_owned() }],
            x_rules: vec![Rule { at: 2.5, name: "true".to_owned() }],
            ..LineChart::default()
        };
        let svg = chart.to_svg();
        well_formed(&svg);
        let line = svg.split("<path d=\"").find(|s| s.contains("stroke-width=\"2\"")).unwrap();
        assert_eq!(line.matches('M').count(), 2, "{line}");
        assert!(svg.contains("a &lt;b&gt;") && svg.contains("rest") && !svg.contains("NaN"));
        assert_eq!(svg.matches("r=\"9\"").count(), 1);
    }

    #[test]
    fn names_of_lines_stand_apart() {
        let places = apart(&[100.0, 101.5, 250.0, 16.0], 14.0);
        let mut sorted = places.clone();
        sorted.sort_by(f64::total_cmp);
        assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] >= LINE), "{places:?}");
        assert_eq!((places[0], places[2]), (95.0, 245.0));
    }
}

//! Charts as plain SVG: no script, no style sheet needed; colours follow the page's text colour.

use super::colour::{ColourScale, hex, tick_label, ticks};
use super::html::{escape, number};
use std::fmt::Write;

/// Okabe-Ito colours that keep 3:1 contrast on white and on near-black.
pub const SERIES_COLOURS: [&str; 6] = ["#2878b5", "#d55e00", "#1b9e77", "#b8609a", "#8f7a00", "#6b7280"];
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

/// One axis: values to pixels.
pub(super) struct Axis {
    low: f64,
    high: f64,
    log: bool,
    pixels: [f64; 2],
}

impl Axis {
    pub(super) fn over(values: impl Iterator<Item = f64>, log: bool, from_zero: bool, pixels: [f64; 2]) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.filter(|v| v.is_finite() && (!log || *v > 0.0)) {
            low = low.min(v);
            high = high.max(v);
        }
        if low > high {
            (low, high) = if log { (0.1, 1.0) } else { (0.0, 1.0) };
        }
        if log {
            let pad = (high / low).powf(0.05).max(1.05);
            return Self { low: low / pad, high: high * pad, log, pixels };
        }
        if from_zero {
            low = low.min(0.0);
        }
        let pad = if high > low { 0.06 * (high - low) } else { 0.5 * high.abs().max(1.0) };
        Self { low: if from_zero && low == 0.0 { 0.0 } else { low - pad }, high: high + pad, log, pixels }
    }

    pub(super) fn at(&self, value: f64) -> f64 {
        let t = if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        self.pixels[0] + t * (self.pixels[1] - self.pixels[0])
    }

    pub(super) fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        if !self.log {
            let values = ticks(self.low, self.high, count);
            let step = if values.len() > 1 { values[1] - values[0] } else { values[0].abs().max(1.0) };
            return values.into_iter().map(|v| (v, grouped(&tick_label(v, step)))).collect();
        }
        let decades = (self.high / self.low).log10();
        let multiples: &[f64] = if decades > 2.5 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let every = ((last - first) / 6).max(1);
        let mut marks = Vec::new();
        for power in (first..=last).filter(|p| p % every == 0) {
            for m in multiples {
                let v = m * 10f64.powi(power);
                if v >= self.low && v <= self.high {
                    let text = if decades > 4.0 { power_of_ten(power) } else { number(v, 1) };
                    marks.push((v, text));
                }
            }
        }
        if marks.len() < 2 {
            // A range within a step of 1, 2, 5 is as good as linear.
            return Self { log: false, ..*self }.ticks(count);
        }
        marks
    }
}

fn power_of_ten(power: i32) -> String {
    let digits = power.to_string();
    let raised = digits.chars().map(|c| match c {
        '-' => '\u{207b}',
        '1' => '\u{b9}',
        '2' => '\u{b2}',
        '3' => '\u{b3}',
        digit => char::from_u32(0x2070 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    });
    format!("10{}", raised.collect::<String>())
}

/// A tick's text with a true minus sign and thousands apart.
fn grouped(text: &str) -> String {
    match text.parse::<f64>() {
        Ok(v) if v.abs() >= 10000.0 && !text.contains('.') => number(v, text.trim_start_matches('-').len()),
        _ => text.replace('-', "\u{2212}"),
    }
}

pub(super) fn open(width: f64, height: f64, description: &str) -> String {
    format!(
        "<svg class=\"chart\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{0}\" \
         font-family=\"inherit\" font-size=\"12\"><title>{0}</title>",
        escape(description)
    )
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

/// Axes, ticks, grid lines, labels.
pub(super) fn frame(svg: &mut String, x_axis: &Axis, y_axis: &Axis, x_label: &str, y_label: &str) {
    let ([x0, x1], [bottom, top]) = (x_axis.pixels, y_axis.pixels);
    for (value, text) in y_axis.ticks(5) {
        let y = y_axis.at(value);
        let _ = write!(
            svg,
            "<path d=\"M{x0} {y:.1}H{x1}\" stroke=\"currentColor\" opacity=\".13\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"currentColor\">{text}</text>",
            x0 - 7.0,
            y + 4.0
        );
    }
    for (value, text) in x_axis.ticks(7) {
        let x = x_axis.at(value);
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} {bottom}v5\" stroke=\"currentColor\"/>\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\" fill=\"currentColor\">{text}</text>",
            bottom + 18.0
        );
    }
    let _ = write!(
        svg,
        "<path d=\"M{x0} {top}V{bottom}H{x1}\" fill=\"none\" stroke=\"currentColor\"/>\
         <text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>\
         <text transform=\"translate(15 {:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>",
        f64::midpoint(x0, x1),
        bottom + 40.0,
        escape(x_label),
        f64::midpoint(bottom, top),
        escape(y_label)
    );
}

/// A colour bar with ticks and its title, lying on its side, 320 units wide; the ends are the range, in numbers.
pub fn colour_bar(scale: &ColourScale) -> String {
    let (width, x0, x1) = (340.0, 24.0, 316.0);
    let above = if scale.and_above { " and above" } else { "" };
    let description = format!(
        "Colour bar: {} from {} (dark) to {} (bright){above}",
        scale.title,
        number(scale.low, 3),
        number(scale.high, 3)
    );
    let mut svg = open(width, 62.0, &description);
    svg = svg.replacen("class=\"chart\"", "class=\"bar\"", 1);
    let steps = 73;
    for n in 0..steps {
        let t = (f64::from(n) + 0.5) / f64::from(steps);
        let x = x0 + (x1 - x0) * f64::from(n) / f64::from(steps);
        let colour = hex(super::colour::viridis(t));
        let _ = write!(svg, "<path fill=\"{colour}\" d=\"M{x:.2} 22h4.6v14h-4.6z\"/>");
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"14\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>",
        f64::midpoint(x0, x1),
        escape(&scale.title)
    );
    let span = scale.high - scale.low;
    let inner = ticks(scale.low, scale.high, 4);
    let step = if inner.len() > 1 { inner[1] - inner[0] } else { 1.0 };
    // Round numbers inside, the exact range at the ends.
    let mut marks = vec![(scale.low, number(scale.low, 3))];
    for v in inner.into_iter().filter(|v| v - scale.low > 0.14 * span && scale.high - v > 0.14 * span) {
        marks.push((v, grouped(&tick_label(v, step))));
    }
    if span > 0.0 {
        let and_above = if scale.and_above { "\u{2265}\u{2009}" } else { "" };
        marks.push((scale.high, format!("{and_above}{}", number(scale.high, 3))));
    }
    for (value, text) in marks {
        let x = if span > 0.0 { x0 + (x1 - x0) * (value - scale.low) / span } else { x0 };
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} 36v4\" stroke=\"currentColor\"/>\
             <text x=\"{x:.1}\" y=\"54\" text-anchor=\"middle\" fill=\"currentColor\">{text}</text>"
        );
    }
    svg + "</svg>"
}

/// A table of values as coloured cells: the RMSE over the samples of two tissues.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// One sentence for those who cannot see it.
    pub description: String,
    /// Label of the columns, with unit.
    pub x_label: String,
    /// Label of the rows, with unit.
    pub y_label: String,
    /// Names of the columns, left to right.
    pub columns: Vec<String>,
    /// Names of the rows, bottom to top.
    pub rows: Vec<String>,
    /// `values[row][column]`; NaN where there is none.
    pub values: Vec<Vec<f64>>,
    /// The cell with a frame: (row, column).
    pub chosen: Option<(usize, usize)>,
    /// What the colours mean.
    pub scale: ColourScale,
}

impl HeatMap {
    /// The map as an SVG element; every cell carries its number.
    pub fn to_svg(&self) -> String {
        let (cell_w, cell_h, left, top) = (58.0, 34.0, 78.0, 10.0);
        let width = left + cell_w * self.columns.len() as f64 + 14.0;
        let plot_h = cell_h * self.rows.len() as f64;
        let height = top + plot_h + 50.0;
        let mut svg = open(width, height, &self.description);
        for (r, row) in self.values.iter().enumerate() {
            let y = top + plot_h - cell_h * (r + 1) as f64;
            for (c, &value) in row.iter().enumerate() {
                let x = left + cell_w * c as f64;
                let rgb = self.scale.colour(value);
                let brightness = 0.299 * f64::from(rgb[0]) + 0.587 * f64::from(rgb[1]) + 0.114 * f64::from(rgb[2]);
                let ink = if brightness > 120.0 { "#111" } else { "#fff" };
                let _ = write!(
                    svg,
                    "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{cell_w}\" height=\"{cell_h}\" fill=\"{}\"/>\
                     <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{ink}\">{}</text>",
                    hex(rgb),
                    x + cell_w / 2.0,
                    y + cell_h / 2.0 + 4.0,
                    number(value, 3)
                );
            }
            let _ = write!(
                svg,
                "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"currentColor\">{}</text>",
                left - 7.0,
                y + cell_h / 2.0 + 4.0,
                escape(&self.rows[r])
            );
        }
        if let Some((r, c)) = self.chosen {
            let (x, y) = (left + cell_w * c as f64, top + plot_h - cell_h * (r + 1) as f64);
            let _ = write!(
                svg,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#fff\" \
                 stroke-width=\"5\"/><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{}\" height=\"{}\" fill=\"none\" \
                 stroke=\"#d55e00\" stroke-width=\"3\"/>",
                x + 1.5,
                y + 1.5,
                cell_w - 3.0,
                cell_h - 3.0,
                x + 1.5,
                y + 1.5,
                cell_w - 3.0,
                cell_h - 3.0
            );
        }
        for (c, name) in self.columns.iter().enumerate() {
            let x = left + cell_w * (c as f64 + 0.5);
            let y = top + plot_h + 16.0;
            let name = escape(name);
            let _ = write!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" fill=\"currentColor\">{name}</text>"
            );
        }
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>",
            left + cell_w * self.columns.len() as f64 / 2.0,
            top + plot_h + 38.0,
            escape(&self.x_label),
            top + plot_h / 2.0,
            escape(&self.y_label)
        );
        svg + "</svg>"
    }
}

/// Counts of the finite values in `bins` equal parts of their range from `low` to `high`; the last part holds `high`.
pub fn counts(values: &[f64], low: f64, high: f64, bins: usize) -> Vec<usize> {
    let mut counts = vec![0; bins];
    for v in values.iter().filter(|v| **v >= low && **v <= high) {
        let n = if high > low { ((v - low) / (high - low) * bins as f64) as usize } else { 0 };
        counts[n.min(bins - 1)] += 1;
    }
    counts
}

/// A histogram of values over their range, bars in the colours of `scale` when there is one.
pub fn histogram(values: &[f64], x_label: &str, y_label: &str, scale: Option<&ColourScale>) -> String {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let high = finite.iter().copied().fold(0.0, f64::max);
    let low = finite.iter().copied().fold(0.0, f64::min);
    let bins = 32;
    let counts = counts(&finite, low, high, bins);
    let (width, height) = (640.0, 260.0);
    let mut x_axis = Axis::over([low, high].into_iter(), false, true, [74.0, width - 18.0]);
    (x_axis.low, x_axis.high) = (low, if high > low { high } else { low + 1.0 });
    let y_axis = Axis::over(counts.iter().map(|c| *c as f64), false, true, [height - 52.0, 14.0]);
    let description =
        format!("Histogram of {} values: {x_label} from {} to {}", finite.len(), number(low, 3), number(high, 3));
    let mut svg = open(width, height, &description);
    frame(&mut svg, &x_axis, &y_axis, x_label, y_label);
    for (n, &count) in counts.iter().enumerate().filter(|(_, c)| **c > 0) {
        let edge = |n: usize| x_axis.at(x_axis.low + (x_axis.high - x_axis.low) * n as f64 / bins as f64);
        let middle = x_axis.low + (x_axis.high - x_axis.low) * (n as f64 + 0.5) / bins as f64;
        let colour = scale.map_or_else(|| SERIES_COLOURS[0].to_owned(), |s| hex(s.colour(middle)));
        let y = y_axis.at(count as f64);
        let _ = write!(
            svg,
            "<rect x=\"{:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{colour}\" \
             stroke=\"currentColor\" stroke-opacity=\".4\" stroke-width=\".6\"><title>{count}</title></rect>",
            edge(n),
            edge(n + 1) - edge(n),
            y_axis.pixels[0] - y
        );
    }
    svg + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;

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

    fn well_formed(svg: &str) {
        let mut reader = quick_xml::Reader::from_str(svg);
        loop {
            match reader.read_event().unwrap() {
                quick_xml::events::Event::Eof => break,
                quick_xml::events::Event::Text(t) => assert!(!t.is_empty()),
                _ => {}
            }
        }
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
    fn a_logarithmic_axis_puts_decades_at_equal_distances() {
        let axis = Axis { low: 1.0, high: 1000.0, log: true, pixels: [0.0, 300.0] };
        assert!((axis.at(10.0) - 100.0).abs() < 1e-9 && (axis.at(100.0) - 200.0).abs() < 1e-9);
        assert_eq!(power_of_ten(-12), "10\u{207b}\u{b9}\u{b2}");
    }

    #[test]
    fn counts_add_up_and_the_highest_value_is_in_the_last_part() {
        let values = [0.0, 0.1, 0.5, 1.0, f64::NAN];
        assert_eq!(counts(&values, 0.0, 1.0, 2), [2, 2]);
        well_formed(&histogram(&values, "x (mm)", "nodes", None));
        well_formed(&histogram(&[], "x (mm)", "nodes", None));
    }

    #[test]
    fn the_bar_names_its_unit_and_both_ends() {
        let scale = ColourScale { low: 0.123, high: 4.56, title: "RMSE (mm)".to_owned(), and_above: false };
        let svg = colour_bar(&scale);
        well_formed(&svg);
        assert!(svg.contains("RMSE (mm)") && svg.contains(">0.123<") && svg.contains(">4.56<"));
    }

    #[test]
    fn names_of_lines_stand_apart_and_every_axis_has_marks() {
        let places = apart(&[100.0, 101.5, 250.0, 16.0], 14.0);
        let mut sorted = places.clone();
        sorted.sort_by(f64::total_cmp);
        assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] >= LINE), "{places:?}");
        assert_eq!((places[0], places[2]), (95.0, 245.0));
        let narrow = Axis::over([310.0, 330.0].into_iter(), true, false, [0.0, 100.0]);
        assert!(narrow.ticks(7).len() >= 2 && narrow.ticks(7).iter().all(|(v, _)| *v > 290.0 && *v < 360.0));
    }

    #[test]
    fn every_cell_of_a_map_shows_its_number() {
        let map = HeatMap {
            description: "valley".to_owned(),
            x_label: "grey (Pa)".to_owned(),
            y_label: "white (Pa)".to_owned(),
            columns: vec!["1".to_owned(), "2".to_owned()],
            rows: vec!["3".to_owned(), "4".to_owned()],
            values: vec![vec![0.5, 1.5], vec![f64::NAN, 2.5]],
            chosen: Some((0, 0)),
            scale: ColourScale { low: 0.5, high: 2.5, title: "RMSE (mm)".to_owned(), and_above: false },
        };
        let svg = map.to_svg();
        well_formed(&svg);
        for text in ["0.500", "1.50", "2.50", "–"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}

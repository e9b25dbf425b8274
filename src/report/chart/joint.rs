//! Two quantities at once: contours of Gaussians over their logarithms, and the direction in which they cannot be told apart.

use super::axis::{Axis, frame, open};
use super::series_colour::SERIES_COLOURS;
use crate::report::html::escape;
use std::fmt::Write;

/// A Gaussian over the natural logarithms of both quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct JointGaussian {
    /// Name in the legend.
    pub name: String,
    /// Means of the logarithms.
    pub mean: [f64; 2],
    /// Their covariance.
    pub covariance: [[f64; 2]; 2],
    /// Drawn as what was known before: dashed, in the colour of the text, not filled.
    pub before: bool,
}

/// A line in the plane of the logarithms.
#[derive(Clone, Debug, PartialEq)]
pub struct Valley {
    /// A point of it.
    pub through: [f64; 2],
    /// Where it leads.
    pub direction: [f64; 2],
}

/// Contours over two axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointChart {
    /// One sentence for those who cannot see it.
    pub description: String,
    /// Labels of both axes, with unit.
    pub labels: [String; 2],
    /// The Gaussians, the first at the back.
    pub gaussians: Vec<JointGaussian>,
    /// Along it the data alone hardly change.
    pub valley: Option<Valley>,
    /// Known values, where there are any.
    pub truth: Option<[f64; 2]>,
    /// Logarithms from which the axes count in per cent; else the axes are logarithmic and show the quantities.
    pub percent_of: Option<[f64; 2]>,
}

/// Shares of the probability inside the contours, the inner one first.
const SHARES: [f64; 2] = [0.5, 0.95];
const WIDTH: f64 = 560.0;
const LINE: f64 = 18.0;
const SIDE: f64 = 380.0;
const VALLEY: &str = "stroke=\"#d55e00\" stroke-width=\"1.8\" stroke-dasharray=\"9 3 2 3\"";

/// The contour of a Gaussian that holds a share of the probability (exactly, in two dimensions: a chi-square of two degrees
/// of freedom is an exponential), as points in the plane of its numbers.
fn contour(gaussian: &JointGaussian, share: f64) -> Vec<[f64; 2]> {
    let radius = (-2.0 * (1.0 - share).ln()).sqrt();
    let [[a, b], [_, c]] = gaussian.covariance;
    // The Cholesky factor carries the unit circle onto the ellipse.
    let first = a.max(0.0).sqrt();
    let across = if first > 0.0 { b / first } else { 0.0 };
    let second = (c - across * across).max(0.0).sqrt();
    let steps = 120;
    (0..=steps)
        .map(|n| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(n) / f64::from(steps)).sin_cos();
            let [x, y] = [radius * cos, radius * sin];
            [gaussian.mean[0] + first * x, gaussian.mean[1] + across * x + second * y]
        })
        .collect()
}

/// The part of a line that lies in a box, as its two ends.
fn inside(valley: &Valley, low: [f64; 2], high: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for a in 0..2 {
        let step = valley.direction[a];
        if step.abs() < 1e-12 {
            if valley.through[a] < low[a] || valley.through[a] > high[a] {
                return None;
            }
            continue;
        }
        let ends = [low[a], high[a]].map(|edge| (edge - valley.through[a]) / step);
        from = from.max(ends[0].min(ends[1]));
        to = to.min(ends[0].max(ends[1]));
    }
    let at = |t: f64| [0, 1].map(|a| valley.through[a] + t * valley.direction[a]);
    (from < to && from.is_finite() && to.is_finite()).then(|| [at(from), at(to)])
}

impl JointChart {
    /// What is read off the axis, from the logarithm.
    fn shown(&self, axis: usize, number: f64) -> f64 {
        match self.percent_of {
            Some(from) => 100.0 * (number - from[axis]).exp_m1(),
            None => number.exp(),
        }
    }

    /// The logarithm, from what is read off the axis.
    fn number(&self, axis: usize, shown: f64) -> f64 {
        match self.percent_of {
            Some(from) => from[axis] + (shown / 100.0).max(-0.999_999).ln_1p(),
            None => shown.ln(),
        }
    }

    /// The chart as an SVG element, scaling with its container.
    pub fn to_svg(&self) -> String {
        let rows = self.gaussians.len() + usize::from(self.valley.is_some()) + usize::from(self.truth.is_some());
        let top = 12.0 + LINE * rows as f64;
        let bottom = top + SIDE;
        let contours: Vec<[Vec<[f64; 2]>; 2]> =
            self.gaussians.iter().map(|g| SHARES.map(|share| contour(g, share))).collect();
        let axes = [[96.0, WIDTH - 24.0], [bottom, top]];
        let axes: Vec<Axis> = (0..2)
            .map(|a| {
                let outer = contours.iter().flat_map(|c| c[1].iter().map(|p| p[a]));
                let all = outer.chain(self.truth.map(|t| t[a].ln())).map(|z| self.shown(a, z));
                Axis::over(all, self.percent_of.is_none(), false, axes[a])
            })
            .collect();
        let place = |z: &[f64; 2]| [axes[0].at(self.shown(0, z[0])), axes[1].at(self.shown(1, z[1]))];
        let path = |points: &[[f64; 2]]| {
            let at = |p: &[f64; 2]| {
                let [x, y] = place(p);
                format!("{x:.1} {y:.1}")
            };
            points.iter().map(at).collect::<Vec<_>>().join("L")
        };
        let mut svg = open(WIDTH, bottom + 50.0, &self.description);
        frame(&mut svg, &axes[0], &axes[1], &self.labels[0], &self.labels[1]);
        let mut row = 0;
        let mut legend = |svg: &mut String, mark: &str, name: &str| {
            let y = 12.0 + LINE * f64::from(row);
            row += 1;
            let _ = write!(
                svg,
                "<g transform=\"translate(96 {y:.1})\">{mark}</g><text x=\"140\" y=\"{:.1}\" fill=\"currentColor\">{}</text>",
                y + 4.0,
                escape(name)
            );
        };
        for (gaussian, contours) in self.gaussians.iter().zip(&contours) {
            let (stroke, dashes) =
                if gaussian.before { ("currentColor", " stroke-dasharray=\"7 4\"") } else { (SERIES_COLOURS[0], "") };
            let fill = if gaussian.before { "none" } else { stroke };
            for contour in contours.iter().rev() {
                let _ = write!(
                    svg,
                    "<path d=\"M{}z\" fill=\"{fill}\" fill-opacity=\".16\" stroke=\"{stroke}\" stroke-width=\"1.8\"{dashes}/>",
                    path(contour)
                );
            }
            let [x, y] = place(&gaussian.mean);
            let middle = if gaussian.before {
                format!(
                    "<path d=\"M{:.1} {y:.1}h10M{x:.1} {:.1}v10\" stroke=\"{stroke}\" stroke-width=\"1.8\"/>",
                    x - 5.0,
                    y - 5.0
                )
            } else {
                format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{stroke}\"/>")
            };
            svg.push_str(&middle);
            let mark = format!("<path d=\"M0 0h34\" stroke=\"{stroke}\" stroke-width=\"2\"{dashes}/>");
            legend(&mut svg, &mark, &gaussian.name);
        }
        if let Some(valley) = &self.valley {
            let low = [0, 1].map(|a| self.number(a, axes[a].low));
            let high = [0, 1].map(|a| self.number(a, axes[a].high));
            if let Some(ends) = inside(valley, low, high) {
                // Straight in the logarithms: bent where the axes count in per cent.
                let steps = 40;
                let along = |n: i32| {
                    let t = f64::from(n) / f64::from(steps);
                    [0, 1].map(|a| ends[0][a] + t * (ends[1][a] - ends[0][a]))
                };
                let points: Vec<[f64; 2]> = (0..=steps).map(along).collect();
                let _ = write!(svg, "<path d=\"M{}\" fill=\"none\" {VALLEY}/>", path(&points));
            }
            legend(&mut svg, &format!("<path d=\"M0 0h34\" {VALLEY}/>"), "valley: along it the data alone hardly tell");
        }
        if let Some(truth) = &self.truth {
            let [x, y] = place(&truth.map(f64::ln));
            let diamond = "fill=\"none\" stroke=\"currentColor\" stroke-width=\"1.8\"";
            let _ = write!(svg, "<path d=\"M{x:.1} {:.1}l9 9-9 9-9-9z\" {diamond}/>", y - 9.0);
            legend(&mut svg, &format!("<path d=\"M17-7l7 7-7 7-7-7z\" {diamond}/>"), "what went in");
        }
        svg + "</svg>"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::svg_check::well_formed;

    fn gaussian(before: bool) -> JointGaussian {
        let covariance = [[0.16, -0.09], [-0.09, 0.25]];
        JointGaussian { name: "p & q".to_owned(), mean: [6.0, 7.0], covariance, before }
    }

    #[test]
    fn every_point_of_a_contour_has_the_distance_of_its_share() {
        let g = gaussian(false);
        let [[a, b], [_, c]] = g.covariance;
        let determinant = a * c - b * b;
        for (share, expected) in [(0.5, 1.386_294), (0.95, 5.991_465)] {
            for p in contour(&g, share) {
                let [x, y] = [p[0] - g.mean[0], p[1] - g.mean[1]];
                let distance = (c * x * x - 2.0 * b * x * y + a * y * y) / determinant;
                assert!((distance - expected).abs() < 1e-5, "{share} {distance}");
            }
        }
    }

    #[test]
    fn the_valley_ends_at_the_frame_and_is_not_drawn_where_it_does_not_pass() {
        let valley = Valley { through: [0.0, 0.0], direction: [1.0, -2.0] };
        let [from, to] = inside(&valley, [-1.0, -1.0], [1.0, 1.0]).unwrap();
        assert!((from[0] + 0.5).abs() < 1e-12 && (from[1] - 1.0).abs() < 1e-12);
        assert!((to[0] - 0.5).abs() < 1e-12 && (to[1] + 1.0).abs() < 1e-12);
        assert!(inside(&Valley { through: [5.0, 0.0], direction: [0.0, 1.0] }, [-1.0; 2], [1.0; 2]).is_none());
    }

    #[test]
    fn contours_valley_and_truth_are_drawn_on_either_kind_of_axes_and_named() {
        for percent_of in [None, Some([6.0, 7.0])] {
            let chart = JointChart {
                description: "a < b".to_owned(),
                gaussians: vec![gaussian(true), gaussian(false)],
                valley: Some(Valley { through: [6.0, 7.0], direction: [0.6, -0.8] }),
                truth: Some([400.0, 1100.0]),
                percent_of,
                ..JointChart::default()
            };
            let svg = chart.to_svg();
            well_formed(&svg);
            assert!(svg.contains("p &amp; q") && svg.contains("what went in") && !svg.contains("NaN"));
            // Two contours for each Gaussian, only the later one filled.
            assert_eq!(svg.matches("fill-opacity").count(), 4);
            assert_eq!(svg.matches("fill=\"none\" fill-opacity").count(), 2);
            // In the plot and in the legend.
            assert_eq!(svg.matches("stroke-dasharray=\"9 3 2 3\"").count(), 2);
        }
    }
}

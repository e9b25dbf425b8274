//! All subjects in one figure: a point each along the figure's axis, the middle half of them as a box.

use super::chart::{Axis, SERIES_COLOURS, open};
use super::html::{escape, number};
use std::fmt::Write;

/// A subject's figure.
#[derive(Clone, Debug, PartialEq)]
pub struct StripPoint {
    /// Whose: what the page's script knows it by.
    pub name: String,
    /// The figure.
    pub value: f64,
    /// Whether it lies apart from the others.
    pub apart: bool,
    /// Whether it counts for median and box; drawn hollow otherwise.
    pub counted: bool,
    /// The subject's page, where it has one.
    pub page: Option<String>,
}

/// One figure over the subjects.
#[derive(Clone, Debug, PartialEq)]
pub struct StripChart {
    /// What it is, with its unit.
    pub name: String,
    /// The subjects that have it.
    pub points: Vec<StripPoint>,
}

const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 92.0;
const MIDDLE: f64 = 46.0;
const FOOT: f64 = 68.0;
const SIDES: [f64; 2] = [14.0, WIDTH - 14.0];
/// Radius of a point, and how many rows of them stand above and below the first.
const RADIUS: f64 = 4.0;
const ROWS: i32 = 2;
/// Subjects from which on quartiles are drawn.
const BOX_FROM: usize = 5;

impl StripChart {
    /// The chart as an SVG element; `None` where no two subjects differ.
    pub fn to_svg(&self) -> Option<String> {
        let mut sorted: Vec<&StripPoint> = self.points.iter().filter(|p| p.value.is_finite()).collect();
        sorted.sort_by(|a, b| a.value.total_cmp(&b.value).then_with(|| a.name.cmp(&b.name)));
        let (first, last) = (sorted.first()?.value, sorted.last()?.value);
        if first >= last {
            return None;
        }
        let counted: Vec<&StripPoint> = sorted.iter().copied().filter(|p| p.counted).collect();
        let middle = (!counted.is_empty()).then(|| quantile(&counted, 0.5));
        let description = format!(
            "{} of {} subjects: from {} to {}{}{}",
            self.name,
            sorted.len(),
            number(first, 3),
            number(last, 3),
            middle.map_or_else(String::new, |middle| format!(", median {}", number(middle, 3))),
            if counted.len() < sorted.len() { format!(" of {}", counted.len()) } else { String::new() },
        );
        let axis = Axis::over(sorted.iter().map(|p| p.value), false, false, SIDES);
        let mut svg = open(WIDTH, HEIGHT, &description);
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"13\" fill=\"currentColor\" font-weight=\"600\">{}</text>\
             <path d=\"M{} {FOOT}H{}\" stroke=\"currentColor\" opacity=\".5\"/>",
            SIDES[0],
            escape(&self.name),
            SIDES[0],
            SIDES[1]
        );
        for (value, text) in axis.ticks(5) {
            let x = axis.at(value);
            let _ = write!(
                svg,
                "<path d=\"M{x:.1} {FOOT}v4\" stroke=\"currentColor\"/><text x=\"{x:.1}\" y=\"{:.1}\" \
                 text-anchor=\"middle\" fill=\"currentColor\">{text}</text>",
                FOOT + 17.0
            );
        }
        if let (true, Some(middle)) = (counted.len() >= BOX_FROM, middle) {
            let [low, high] = [0.25, 0.75].map(|q| axis.at(quantile(&counted, q)));
            let _ = write!(
                svg,
                "<rect x=\"{low:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"36\" fill=\"currentColor\" opacity=\".1\"/>\
                 <path d=\"M{2:.1} {0:.1}v36\" stroke=\"currentColor\" stroke-width=\"2\" opacity=\".6\"/>",
                MIDDLE - 18.0,
                high - low,
                axis.at(middle)
            );
        }
        let places: Vec<f64> = sorted.iter().map(|p| axis.at(p.value)).collect();
        for ((point, x), row) in sorted.iter().zip(&places).zip(rows(&places)) {
            draw(&mut svg, point, [*x, MIDDLE + f64::from(row) * 1.9 * RADIUS]);
        }
        Some(svg + "</svg>")
    }
}

fn draw(svg: &mut String, point: &StripPoint, [x, y]: [f64; 2]) {
    let (colour, form) = if point.apart {
        // Told by its shape as well as by its colour.
        let r = 1.3 * RADIUS;
        (SERIES_COLOURS[1], format!("M{x:.1} {:.1}l{r:.1} {:.1}h{:.1}z", y - r, 2.0 * r, -2.0 * r))
    } else {
        let r = RADIUS;
        (SERIES_COLOURS[0], format!("M{:.1} {y:.1}a{r} {r} 0 1 0 {1} 0a{r} {r} 0 1 0 -{1} 0z", x - r, 2.0 * r))
    };
    // A path that is not filled takes no pointer inside: it is filled without being seen.
    let opacity = if point.counted { ".75" } else { "0" };
    let page = point.page.as_ref().map_or_else(String::new, |page| format!(" data-page=\"{}\"", escape(page)));
    let _ = write!(
        svg,
        "<path class=\"subject\" data-of=\"{0}\"{page} d=\"{form}\" fill=\"{colour}\" fill-opacity=\"{opacity}\" \
         stroke=\"{colour}\"><title>{0}: {1}</title></path>",
        escape(&point.name),
        number(point.value, 4)
    );
}

/// The value below which a share of the sorted points lies, between two of them where it must.
fn quantile(sorted: &[&StripPoint], share: f64) -> f64 {
    let at = share * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[at.floor() as usize].value, sorted[at.ceil() as usize].value);
    below + at.fract() * (above - below)
}

/// Rows for points at these places, from left to right, so that neighbours do not hide each other while there are rows left.
fn rows(places: &[f64]) -> Vec<i32> {
    let mut ends = std::collections::BTreeMap::new();
    let order = |n: i32| if n % 2 == 0 { n / 2 } else { -(n + 1) / 2 };
    places
        .iter()
        .map(|x| {
            let free = |row: &i32| ends.get(row).is_none_or(|end: &f64| x - end >= 2.0 * RADIUS);
            let row = (0..=2 * ROWS).map(order).find(free).unwrap_or(0);
            ends.insert(row, *x);
            row
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::svg_check::well_formed;

    fn chart(values: &[f64]) -> StripChart {
        let point = |(n, &value): (usize, &f64)| StripPoint {
            name: format!("sub-<{n}>"),
            value,
            apart: n == 0,
            counted: true,
            page: (n > 0).then(|| format!("sub-{n}.html")),
        };
        StripChart { name: "cavity (cc)".to_owned(), points: values.iter().enumerate().map(point).collect() }
    }

    #[test]
    fn every_subject_with_a_figure_has_a_point_and_equal_figures_make_no_chart() {
        let svg = chart(&[9.0, 1.0, 2.0, f64::NAN, 3.0, 2.0]).to_svg().unwrap();
        well_formed(&svg);
        assert_eq!((svg.matches("class=\"subject\"").count(), svg.matches("<rect").count()), (5, 1));
        assert!(svg.contains("from 1.00 to 9.00, median 2.00") && svg.contains("data-page=\"sub-5.html\""), "{svg}");
        assert!(!chart(&[1.0, 2.0]).to_svg().unwrap().contains("<rect"), "two have no quartiles");
        assert!(chart(&[2.0, 2.0]).to_svg().is_none() && chart(&[2.0]).to_svg().is_none());
    }

    #[test]
    fn who_does_not_count_is_hollow_and_moves_neither_median_nor_box() {
        let mut with_refused = chart(&[1.0, 2.0, 3.0, 4.0, 5.0, 90.0, 91.0, 92.0]);
        with_refused.points[5..].iter_mut().for_each(|point| point.counted = false);
        let svg = with_refused.to_svg().unwrap();
        assert!(svg.contains("8 subjects: from 1.00 to 92.0, median 3.00 of 5"), "{svg}");
        assert_eq!(svg.matches("fill-opacity=\"0\"").count(), 3);
        with_refused.points.iter_mut().for_each(|point| point.counted = false);
        assert!(!with_refused.to_svg().unwrap().contains("median"));
    }

    #[test]
    fn points_of_one_row_do_not_overlap_while_rows_are_left() {
        let places = [0.0, 1.0, 2.0, 3.0, 4.0, 20.0];
        let rows = rows(&places);
        assert_eq!(rows, [0, -1, 1, -2, 2, 0]);
    }

    #[test]
    fn quartiles_lie_between_the_sorted_values() {
        let chart = chart(&[1.0, 2.0, 3.0, 4.0]);
        let sorted: Vec<&StripPoint> = chart.points.iter().collect();
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(|q| quantile(&sorted, q)), [1.0, 1.75, 2.5, 4.0]);
    }
}

//! How many values lie where.

use super::axis::{Axis, frame, open};
use super::series_colour::SERIES_COLOURS;
use crate::report::colour::{ColourScale, hex};
use crate::report::html::{count as rounded, number};
use std::fmt::Write;

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
             stroke=\"currentColor\" stroke-opacity=\".4\" stroke-width=\".6\"><title>{}</title></rect>",
            edge(n),
            edge(n + 1) - edge(n),
            y_axis.pixels[0] - y,
            rounded(count)
        );
    }
    svg + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::svg_check::well_formed;

    #[test]
    fn counts_add_up_and_the_highest_value_is_in_the_last_part() {
        let values = [0.0, 0.1, 0.5, 1.0, f64::NAN];
        assert_eq!(counts(&values, 0.0, 1.0, 2), [2, 2]);
        well_formed(&histogram(&values, "x (mm)", "nodes", None));
        well_formed(&histogram(&[], "x (mm)", "nodes", None));
    }
}

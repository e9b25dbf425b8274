//! One axis, and the frame of ticks and labels around a plot.

use crate::report::colour::{tick_label, ticks};
use crate::report::html::{escape, number};
use std::fmt::Write;

/// One axis: values to pixels.
pub(in crate::report) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    log: bool,
    pub(super) pixels: [f64; 2],
}

impl Axis {
    pub(in crate::report) fn over(
        values: impl Iterator<Item = f64>,
        log: bool,
        from_zero: bool,
        pixels: [f64; 2],
    ) -> Self {
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

    pub(in crate::report) fn at(&self, value: f64) -> f64 {
        let t = if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        self.pixels[0] + t * (self.pixels[1] - self.pixels[0])
    }

    pub(in crate::report) fn ticks(&self, count: usize) -> Vec<(f64, String)> {
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
                    let text = match *m {
                        _ if decades <= 4.0 && v >= 1e-3 => number(v, 1),
                        1.0 => power_of_ten(power),
                        m => format!("{m}\u{b7}{}", power_of_ten(power)),
                    };
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
pub(super) fn grouped(text: &str) -> String {
    match text.parse::<f64>() {
        Ok(v) if v.abs() >= 10000.0 && !text.contains('.') => number(v, text.trim_start_matches('-').len()),
        _ => text.replace('-', "\u{2212}"),
    }
}

pub(in crate::report) fn open(width: f64, height: f64, description: &str) -> String {
    format!(
        "<svg class=\"chart\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{0}\" \
         font-family=\"inherit\" font-size=\"12\"><title>{0}</title>",
        escape(description)
    )
}

/// Axes, ticks, grid lines, labels.
pub(in crate::report) fn frame(svg: &mut String, x_axis: &Axis, y_axis: &Axis, x_label: &str, y_label: &str) {
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
    foot(svg, x_axis, bottom, x_label);
    let _ = write!(
        svg,
        "<path d=\"M{x0} {top}V{bottom}\" fill=\"none\" stroke=\"currentColor\"/>\
         <text transform=\"translate(15 {:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>",
        f64::midpoint(bottom, top),
        escape(y_label)
    );
}

/// The x axis: its line at the height `bottom`, ticks and label below.
pub(in crate::report) fn foot(svg: &mut String, x_axis: &Axis, bottom: f64, x_label: &str) {
    let [x0, x1] = x_axis.pixels;
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
        "<path d=\"M{x0} {bottom}H{x1}\" fill=\"none\" stroke=\"currentColor\"/>\
         <text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>",
        f64::midpoint(x0, x1),
        bottom + 40.0,
        escape(x_label)
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithmic_axis_puts_decades_at_equal_distances() {
        let axis = Axis { low: 1.0, high: 1000.0, log: true, pixels: [0.0, 300.0] };
        assert!((axis.at(10.0) - 100.0).abs() < 1e-9 && (axis.at(100.0) - 200.0).abs() < 1e-9);
        assert_eq!(power_of_ten(-12), "10\u{207b}\u{b9}\u{b2}");
    }

    #[test]
    fn small_numbers_are_powers_of_ten() {
        let axis = Axis::over([6e-7, 3e-6].into_iter(), true, false, [0.0, 300.0]);
        let said: Vec<String> = axis.ticks(5).into_iter().map(|(_, text)| text).collect();
        assert_eq!(said, ["10\u{207b}\u{2076}", "2\u{b7}10\u{207b}\u{2076}"]);
    }

    #[test]
    fn every_axis_has_marks() {
        let narrow = Axis::over([310.0, 330.0].into_iter(), true, false, [0.0, 100.0]);
        assert!(narrow.ticks(7).len() >= 2 && narrow.ticks(7).iter().all(|(v, _)| *v > 290.0 && *v < 360.0));
    }
}

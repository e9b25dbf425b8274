//! A table of values as coloured cells.

use super::axis::open;
use crate::report::colour::{ColourScale, hex};
use crate::report::html::{escape, number};
use std::fmt::Write;

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

/// Black or white, whichever is told better from a colour: never less than 4.58 to 1 (WCAG 2.2, relative luminance and contrast
/// ratio).
fn ink_on(rgb: [u8; 3]) -> &'static str {
    let linear = |channel: u8| {
        let x = f64::from(channel) / 255.0;
        if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
    };
    let luminance = 0.2126 * linear(rgb[0]) + 0.7152 * linear(rgb[1]) + 0.0722 * linear(rgb[2]);
    let [on_black, on_white] = [(luminance + 0.05) / 0.05, 1.05 / (luminance + 0.05)];
    if on_black >= on_white { "#000" } else { "#fff" }
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
                let ink = ink_on(rgb);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::svg_check::well_formed;

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

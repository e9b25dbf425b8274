//! What the colours of a picture mean.

use super::axis::{grouped, open};
use crate::report::colour::{ColourScale, hex, tick_label, ticks, viridis};
use crate::report::html::{escape, number};
use std::fmt::Write;

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
        let colour = hex(viridis(t));
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
        // A long number at the end would be cut off by the picture's edge.
        let half = 3.4 * text.chars().count() as f64;
        let middle = x.clamp(half, width - half);
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} 36v4\" stroke=\"currentColor\"/>\
             <text x=\"{middle:.1}\" y=\"54\" text-anchor=\"middle\" fill=\"currentColor\">{text}</text>"
        );
    }
    svg + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::svg_check::well_formed;

    #[test]
    fn the_bar_names_its_unit_and_both_ends() {
        let scale = ColourScale { low: 0.123, high: 4.56, title: "RMSE (mm)".to_owned(), and_above: false };
        let svg = colour_bar(&scale);
        well_formed(&svg);
        assert!(svg.contains("RMSE (mm)") && svg.contains(">0.123<") && svg.contains(">4.56<"));
    }
}

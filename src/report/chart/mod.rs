//! Charts as plain SVG: no script, no style sheet needed; colours follow the page's text colour.

mod axis;
mod colour_bar;
mod density;
mod heat_map;
mod histogram;
mod joint;
mod line;
mod series_colour;
#[cfg(test)]
pub(super) mod svg_check;

pub(super) use axis::{Axis, frame, open};
pub use colour_bar::colour_bar;
pub use density::{DensityChart, DensityCurve};
pub use heat_map::HeatMap;
pub use histogram::{counts, histogram};
pub use joint::{JointChart, JointGaussian, Valley};
pub use line::{DataPoint, LineChart, Rule, Series};
pub use series_colour::SERIES_COLOURS;

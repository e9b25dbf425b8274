//! HTML page, figures, tables, VTK series.

pub mod colour;
pub mod html;
pub mod picture;
pub mod slice;

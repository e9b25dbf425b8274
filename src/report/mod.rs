//! HTML page, figures, tables, VTK series.

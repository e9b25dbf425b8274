//! HTML page, figures, tables, VTK series.

pub mod case;
pub mod change_chart;
pub mod chart;
pub mod cohort;
pub mod cohort_population;
pub mod colour;
pub mod derivatives;
pub mod figure;
pub mod glance_figure;
pub mod hand_off;
pub mod html;
pub mod in_words;
pub mod lettering;
pub mod material_figure;
pub mod material_tables;
pub mod median_samples;
pub mod mesh_figure;
pub mod page;
pub mod picture;
pub mod refusal;
pub mod render;
pub mod shift_figure;
pub mod slice;
pub mod study_level_figure;
pub mod study_level_tables;
pub mod viewer;

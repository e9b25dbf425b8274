//! Words that images, meshes and pages share: label numbers and names, and the label tables of other tools.

pub mod label;
mod recognise;
mod table;
mod tables;
mod tsv;

pub use recognise::{LabelCount, LabelError, Recognised, recognise};
pub use table::{LabelTable, Side, Structure, Tissue};
pub use tables::{built_in, named};
pub use tsv::{TsvError, table_from_tsv};

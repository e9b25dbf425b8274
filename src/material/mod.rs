//! Constitutive laws, published literature, the multi-task Gaussian process over it, meta-models.

pub mod csv;
pub mod form;
pub mod generative;
pub mod gp;
pub mod law;
pub mod literature;
pub mod meta_model;
pub mod published;
pub mod random;
pub mod rank_test;
pub mod rheometry;
mod slope;
pub mod statistics;
pub mod study_level;
pub mod task;
pub mod toml_text;
pub mod training;

pub use gp::TissuePrior;
pub use law::Hyperelastic;
pub use task::{Region, StudyKind, Task};

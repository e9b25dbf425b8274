//! Constitutive laws, published literature, the multi-task Gaussian process over it, meta-models.

pub mod law;

pub use law::Hyperelastic;

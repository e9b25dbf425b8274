//! The published constitutive models of brain tissue behind the generative model.
//!
//! `studies.csv` is the table itself, one row a model: where it was published, what tissue it speaks of, form and
//! parameters (Pa), the window of stretches it is trusted in and the grid the curves are taken on. `citations.csv`
//! holds the full citations. Two rows name besides the right curve the one that the published program used
//! ([`Curves`]).

mod model;
mod studies;
mod table;

pub use model::{Branches, Curve, Curves, LiteratureModel, Points};
pub use studies::{Refusal, StudyError, merge, read_studies};
pub use table::{STUDIES_CSV, citation, listed, table};

#[cfg(test)]
mod tests;

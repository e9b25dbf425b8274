//! Why landmarks cannot be compared with a case.

use thiserror::Error;

/// Why landmarks cannot be compared.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum LandmarkError {
    #[error("{file}: holds the landmarks of one scan alone; give those of the post-operative scan too")]
    NoPairs { file: String },
    #[error(
        "{pre} and {post}: not one landmark of the first has a name of the second, and they hold {of_pre} and {of_post}"
    )]
    NoMatch { pre: String, post: String, of_pre: usize, of_post: usize },
    #[error(
        "{file}: the name `{name}` stands there twice, and nobody knows which is meant: give each landmark a name of its own"
    )]
    Twice { file: String, name: String },
    #[error(
        "{file}: by the rigid motion between the scans the landmarks lie {given_mm:.0} mm apart as they stand, and {other_mm:.0} mm if \
         {how}: give them in their scanners' frames (mm, RAS+), the pre-operative ones first"
    )]
    FitsAs { file: String, given_mm: f64, other_mm: f64, how: String },
    #[error(
        "{file}: not one landmark lies in the brain or beside it; landmarks are in their scanners' frames (mm, RAS+)"
    )]
    NoneInside { file: String },
    #[error("{file}: holds no landmark")]
    Empty { file: String },
}

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
    #[error("{file}: holds no landmark")]
    Empty { file: String },
}

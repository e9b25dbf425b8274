//! Why something of the user's cannot be carried.

use thiserror::Error;

/// Why something cannot be carried.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum WarpError {
    #[error("{output}: the result of {file} is written in the same format: end the name in {ending}")]
    Ending { file: String, output: String, ending: &'static str },
}

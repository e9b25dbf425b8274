//! Why something of the user's cannot be carried.

use thiserror::Error;

/// Why something cannot be carried.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum WarpError {
    #[error("{output}: the result of {file} is written in the same format: end the name in {ending}")]
    Ending { file: String, output: String, ending: &'static str },
    #[error(
        "{file}: {says} that it lies in MNI space, and what a case carries lies in its scans' own frames: give the file as it was before it was \
         taken there; where {that} and it does lie in the scan's frame, {otherwise}",
        says = if *by_name { "its name says" } else { "its header says (code 4)" },
        that = if *by_name { "the name is wrong" } else { "the header is wrong" },
        otherwise = if *by_name { "rename it" } else { "set sform_code and qform_code to 1" }
    )]
    OfMni { file: String, by_name: bool },
}

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
        says = by.says(),
        that = by.that(),
        otherwise = by.otherwise()
    )]
    OfMni { file: String, by: SaysMni },
}

/// What of a file says that it lies in MNI space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaysMni {
    /// `space-MNI` in its name.
    Name,
    /// Code 4 of its header.
    Header,
    /// Its grid, which is the template's and not the scan's.
    Grid,
}

impl SaysMni {
    fn says(self) -> &'static str {
        match self {
            Self::Name => "its name says",
            Self::Header => "its header says (code 4)",
            Self::Grid => "its grid, that of the template, says",
        }
    }

    fn that(self) -> &'static str {
        match self {
            Self::Name => "the name is wrong",
            Self::Header => "the header is wrong",
            Self::Grid => "this is chance",
        }
    }

    fn otherwise(self) -> &'static str {
        match self {
            Self::Name => "rename it",
            Self::Header => "set sform_code and qform_code to 1",
            Self::Grid => "resample it onto the scan's grid",
        }
    }
}

//! `hgm register MOVING FIXED -o XFM`: the rigid motion from one T1 image to another, or to the template.

use super::{Failure, Session, session::warn};
use crate::workflow::{Layer, Onto, RegisterFiles, WorkflowError, register_files};
use std::path::PathBuf;

/// Find the rigid motion that takes the MOVING image onto the FIXED one
///
/// Writes the motion twice: as a 4x4 text (RAS mm, maps a MOVING point to FIXED) and, beside it, as an ITK transform (.tfm)
/// that other programs read.
///
/// Example: hgm register post.nii.gz pre.nii.gz -o from-post_to-pre.txt
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// T1 image to be moved (NIfTI)
    pub moving: PathBuf,
    /// T1 image that stays (NIfTI), or the word MNI for the built-in template
    pub fixed: PathBuf,
    /// Where to write the 4x4 text; the ITK transform gets the same name with .tfm
    #[arg(short, long, value_name = "XFM")]
    pub output: PathBuf,
    /// Compare only inside this mask of the MOVING image
    #[arg(long, value_name = "FILE")]
    pub moving_mask: Option<PathBuf>,
    /// Compare only inside this mask of the FIXED image
    #[arg(long, value_name = "FILE")]
    pub fixed_mask: Option<PathBuf>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let Args { moving, fixed, output, moving_mask, fixed_mask } = args.clone();
    let files = RegisterFiles { moving, onto: Onto::named(fixed, moving_mask, fixed_mask)?, output };
    let found = register_files(&files, &session.settings(Layer::default())?, &mut *session.listener())?;
    warn(&found.warnings);
    session.emit(&found, &format!("{}\n{}", found.transform.display(), found.itk_transform.display()))?;
    if found.refused.is_empty() { Ok(()) } else { Err(WorkflowError::QualityGate(found.refused).into()) }
}

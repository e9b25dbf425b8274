//! `hgm segment`: one T1 to a label map.

use super::{Failure, Session, session::warn};
use crate::workflow::{Layer, SegmentFiles, WorkflowError, results_in_words, segment_file};
use std::path::PathBuf;

/// A T1 to labels in its own grid: 1 CSF, 2 grey matter, 3 white matter, 4 ventricle
///
/// Example: hgm segment t1.nii.gz -o dseg.nii.gz
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// T1-weighted scan (.nii or .nii.gz)
    t1: PathBuf,
    /// Label map to write (.nii.gz)
    #[arg(short, long, value_name = "DSEG")]
    output: PathBuf,
    /// A brain mask of your own in the scan's grid (wins over the computed one)
    #[arg(long, value_name = "FILE")]
    brain_mask: Option<PathBuf>,
    /// Also write the brain mask here
    #[arg(long, value_name = "FILE")]
    write_brain_mask: Option<PathBuf>,
    /// Labels on the 1 mm MNI grid instead of the scan's own: what `hgm mesh` needs for its boundary sets
    #[arg(long)]
    mni: bool,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let Args { t1, output, brain_mask, write_brain_mask, mni: in_mni } = args.clone();
    let files = SegmentFiles { t1, output, brain_mask, write_brain_mask, in_mni };
    let found = segment_file(&files, &session.settings(Layer::default())?, &mut *session.listener())?;
    warn(&found.warnings);
    session.emit(&found, &results_in_words::segmented(&found))?;
    if found.refused.is_empty() { Ok(()) } else { Err(WorkflowError::QualityGate(found.refused).into()) }
}

//! `hgm evaluate`: landmarks against a case.

use super::{Failure, Session};
use crate::report::in_words::landmark_table;
use crate::workflow::{Landmarks, evaluate_landmarks};
use std::path::PathBuf;

/// Target registration error of landmarks on both scans: rigid motion alone, seen displacement, model, both together
///
/// Example: hgm evaluate case --landmarks pre.fcsv --landmarks-post post.fcsv
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run` or `hgm estimate`
    case: PathBuf,
    /// Landmarks on the pre-operative scan (.csv, .fcsv, .mrk.json), or pairs (.tag)
    #[arg(long, value_name = "FILE")]
    landmarks: PathBuf,
    /// The same landmarks on the post-operative scan, by name or in the same order
    #[arg(long, value_name = "FILE")]
    landmarks_post: Option<PathBuf>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let landmarks = Landmarks { pre: args.landmarks.clone(), post: args.landmarks_post.clone() };
    let found = evaluate_landmarks(&args.case, &landmarks)?;
    session.emit(&found, &landmark_table(&found))
}

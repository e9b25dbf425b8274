//! `hgm evaluate`: landmarks against a case, and a prediction against what was seen afterwards.

use super::{Failure, Session, session::warn};
use crate::report::forecast_in_words::evaluation_table;
use crate::report::in_words::landmark_table;
use crate::workflow::{Evaluated, Landmarks, SeenAfterwards, evaluate_case};
use std::path::PathBuf;

/// Landmarks against a case (target registration error), or a prediction against the later case (coverage, scores)
///
/// Example: hgm evaluate plan --against case
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run` or `hgm estimate`; or by `hgm predict`, to see how well it foretold
    case: PathBuf,
    /// The later case of the same patient, made by `hgm run` from the same pre-operative scan: what a prediction is compared with
    #[arg(long, value_name = "CASE")]
    against: Option<PathBuf>,
    /// Which state of the later case is taken for true: of the images alone, or with the model [default: observed]
    #[arg(long, value_name = "STATE", value_parser = ["observed", "fused"], requires = "against")]
    seen: Option<String>,
    /// Landmarks on the pre-operative scan (.csv, .fcsv, .mrk.json), or pairs (.tag)
    #[arg(long, value_name = "FILE")]
    landmarks: Option<PathBuf>,
    /// The same landmarks on the post-operative scan, by name or in the same order
    #[arg(long, value_name = "FILE", requires = "landmarks")]
    landmarks_post: Option<PathBuf>,
    /// How the post-operative scan lies to the pre-operative one, for landmarks on a prediction without --against: a rigid
    /// transform as `hgm register POST PRE` writes it (4x4 text in RAS, or .tfm)
    #[arg(long, value_name = "FILE", requires = "landmarks", conflicts_with = "against")]
    post_to_pre: Option<PathBuf>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let seen = SeenAfterwards {
        case: args.against.clone(),
        state: args.seen.clone(),
        landmarks: args.landmarks.clone().map(|pre| Landmarks { pre, post: args.landmarks_post.clone() }),
        pre_from_post: args.post_to_pre.clone(),
    };
    let found = evaluate_case(&args.case, &seen)?;
    warn(&seen.doubts(&args.case)?);
    match found {
        Evaluated::Landmarks(found) => session.emit(&found, &landmark_table(&found)),
        Evaluated::Prediction(found) => session.emit(&found, &evaluation_table(&found)),
    }
}

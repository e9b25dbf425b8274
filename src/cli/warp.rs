//! `hgm warp`: a user's image, points, streamlines or surface carried by a case.

use super::flags::word;
use super::{Failure, Session, session::warn};
use crate::report::in_words::warped;
use crate::workflow::{Layer, Through, Warp, WarpTo, warp};
use anyhow::anyhow;
use std::path::PathBuf;

/// Carry a file of one scan to the other by brain shift and rigid motion: images, label maps (.nii.gz), points (.csv, .fcsv,
/// .mrk.json, .tag), streamlines (.tck, .trk), surfaces (.gii, .stl, .ply, .vtk)
///
/// Example: hgm warp case tracts.trk -o tracts_post.trk --to post
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The case and the file; with --field the file alone
    #[arg(required = true, num_args = 1..=2, value_names = ["CASE", "FILE"])]
    paths: Vec<PathBuf>,
    /// What to write, in the same format
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// post: from the pre-operative scan to the post-operative one; deformed: brain shift alone; pre: from the post-operative
    /// scan back; mni: rigidly to MNI space
    #[arg(long, value_parser = word::<WarpTo>, value_name = "post|deformed|pre|mni", default_value = "post")]
    to: WarpTo,
    /// estimate, fused, observed or a sample such as sample-05 [default: the estimate, else the best sample]
    #[arg(long)]
    state: Option<String>,
    /// A displacement field of your own (NIfTI, as ITK or ANTs write it) instead of a case
    #[arg(long, value_name = "FILE", conflicts_with_all = ["to", "state"])]
    field: Option<PathBuf>,
    /// Whether the image is a map of labels [default: found out]
    #[arg(long, value_name = "true|false")]
    labels: Option<bool>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let (through, file) = match (&args.paths[..], &args.field) {
        ([file], Some(field)) => (Through::Field(field.clone()), file),
        ([case, file], None) => (Through::Case { folder: case.clone(), to: args.to, state: args.state.clone() }, file),
        (_, Some(_)) => {
            return Err(Failure::Rejected(anyhow!("--field takes the place of the case: name the file alone")));
        }
        (_, None) => return Err(Failure::Rejected(anyhow!("name the case and the file"))),
    };
    let reading = session.settings(Layer::default())?.image;
    let asked = Warp { file: file.clone(), output: args.output.clone(), through, labels: args.labels, reading };
    let done = warp(&asked)?;
    warn(&done.warnings);
    session
        .emit(&done, &warped(&done.output, done.kind, &done.state, done.points.map(|p| [p.all, p.removed, p.outside])))
}

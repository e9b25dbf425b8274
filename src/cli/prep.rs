//! `hgm prep`: a T1 pair to registered images, masks and a tagged mesh.

use super::flags::PairOptions;
use super::run::in_words;
use super::{Failure, Session};
use crate::workflow::{Goal, Layer, run_to};

/// T1 pair -> registered images, masks, tagged mesh and a page to check them
///
/// Example: hgm prep pre.nii.gz post.nii.gz -o case
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pair: PairOptions,
    /// Stop at the registered images and masks
    #[arg(long, conflicts_with_all = ["mesher", "cells", "edge_mm", "edge_in", "edge_near"])]
    no_mesh: bool,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Layer::default();
    args.pair.mesh.over(&mut flags);
    let goal = if args.no_mesh { Goal::Images } else { Goal::Mesh };
    let (settings, place) = (session.settings(flags)?, session.place(&args.pair.output));
    let case = run_to(goal, &args.pair.inputs(), &place, &settings, &mut *session.listener())?;
    session.emit(&case.outcome()?, &in_words(&case)?)?;
    Ok(if goal == Goal::Mesh { case.quality_gate() } else { case.image_gate() }?)
}

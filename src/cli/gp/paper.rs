//! `hgm gp paper`: every figure and table of the paper.

use super::options::emit;
use crate::cli::{Failure, Session};
use crate::mesh::engine::Engine;
use crate::workflow::{Layer, paper};
use std::path::PathBuf;

/// Every figure and table of the paper in one command, beside the printed numbers, with what differs and why
///
/// Writes paper.md, fig-2-posterior.svg, fig-3-meta-models.svg, table-1.csv, fig-4-phantom.svg with its numbers, and the phantom's
/// case, in a coarse mesh of the embedded engine.
///
/// Example: hgm gp paper -o paper
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Tetrahedra of the phantom
    #[arg(long, value_name = "N", default_value_t = 15_000)]
    cells: usize,
    /// Where to write
    #[arg(short, long, value_name = "DIR", default_value = "paper")]
    output: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Layer::default();
    flags.set("mesh.engine", Some(Engine::LATTICE));
    flags.set("mesh.size.cells", Some(args.cells));
    flags.set("phantom.tissues", Some(1));
    let settings = session.settings(flags)?;
    emit(paper(&session.place(&args.output), &settings, &mut *session.listener())?, session)
}

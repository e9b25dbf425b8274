//! `hgm demo`: the bundled pair and the phantom, without network.

use super::case::MeshOptions;
use super::{Failure, Session, phantom, run};
use crate::artefact::write_whole;
use crate::mesh::engine::Engine;
use std::path::PathBuf;

const PRE: &[u8] = include_bytes!("../../sample-data/pre.nii.gz");
const POST: &[u8] = include_bytes!("../../sample-data/post.nii.gz");

/// Tetrahedra of the demo's meshes.
const CELLS: usize = 15_000;

/// The bundled T1 pair through the whole job, and the phantom beside it; needs no network
///
/// Example: hgm demo -o hgm-demo
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Where to write: the pair into DIR/pair, the phantom into DIR/phantom
    #[arg(short, long, value_name = "DIR", default_value = "hgm-demo")]
    output: PathBuf,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let input = args.output.join("input");
    let (pre, post) = (input.join("pre.nii.gz"), input.join("post.nii.gz"));
    write_whole(&pre, PRE)?;
    write_whole(&post, POST)?;
    // The embedded engine and a coarse mesh: the same bytes on every machine, whatever is installed, within a minute.
    let mesh = || MeshOptions { mesher: Some(Engine::Lattice), cells: Some(CELLS), ..MeshOptions::default() };
    let pair = run::analyse(&run::Args::demo(pre, post, args.output.join("pair"), mesh()), session)?;
    let (phantom, text) = phantom::analyse(&phantom::Args::demo(args.output.join("phantom"), mesh()), session)?;
    let both = serde_json::json!({ "pair": pair.outcome, "phantom": phantom });
    session.emit(&both, &format!("{}\n{text}", pair.text.trim_end()))?;
    pair.patient.quality_gate()
}

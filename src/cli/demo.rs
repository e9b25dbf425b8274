//! `hgm demo`: the bundled pair and the phantom, without network.

use super::flags::{Flags, MeshOptions};
use super::{Failure, Session, phantom, run};
use crate::artefact::write_whole;
use crate::mesh::engine::Engine;
use crate::workflow::{Goal, Inputs, run_to};
use anyhow::Context;
use std::path::PathBuf;

const PRE: &[u8] = include_bytes!("../../sample-data/pre.nii.gz");
const POST: &[u8] = include_bytes!("../../sample-data/post.nii.gz");
/// How that patient lay, how much fluid was lost, and a coarse mesh.
const SETTINGS: &str = include_str!("../../sample-data/settings.toml");

/// Tetrahedra of the phantom's mesh.
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
    let own = toml::from_str(SETTINGS).context("the settings of the bundled pair")?;
    let settings = session.settings_over(&own, Flags::default())?;
    let place = session.place(&args.output.join("pair"));
    let pair = run_to(Goal::Estimate, &Inputs::pair(pre, post), &place, &settings, &mut session.listener())?;
    // The embedded engine and a coarse mesh, as for the pair: the same bytes on every machine, whatever is installed, and soon.
    let mesh = MeshOptions { mesher: Some(Engine::LATTICE), cells: Some(CELLS), ..MeshOptions::default() };
    let mut flags = Flags::default();
    flags.set("phantom.tissues", Some(1));
    mesh.over(&mut flags);
    let (phantom, text) = phantom::made(flags, false, &args.output.join("phantom"), session)?;
    let both = serde_json::json!({ "pair": pair.outcome()?, "phantom": phantom });
    let words = run::in_words(&pair)?;
    let live = format!("pull at it in a browser: hgm live {}", args.output.join("pair").display());
    session.emit(&both, &format!("{words}\n{}\n{live}", text.trim_end()))?;
    Ok(pair.quality_gate()?)
}

//! `hgm demo`: the bundled pair and the phantom, without network.

use super::run::in_words;
use super::{Failure, Session};
use crate::workflow::{Layer, demo, demo_pair_settings, demo_phantom_settings};
use serde_json::json;
use std::path::PathBuf;

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
    let of_pair = session.settings_over(&demo_pair_settings()?, Layer::default())?;
    let of_phantom = session.settings(demo_phantom_settings())?;
    let place = session.place(&args.output);
    let [pair, phantom] = demo(&place, [&of_pair, &of_phantom], &mut *session.listener())?;
    let live = format!("pull at it in a browser: hgm live {}", pair.folder().display());
    session.emit(
        &json!({ "pair": pair.outcome()?, "phantom": phantom.outcome()? }),
        &format!("{}\n{}\n{live}", in_words(&pair)?, in_words(&phantom)?),
    )?;
    Ok(pair.quality_gate()?)
}

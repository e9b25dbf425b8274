//! `hgm schema`: what `--json` prints, as a JSON Schema.

use super::{Failure, Session};

const SCHEMA: &str = include_str!("schema.json");

/// Print the JSON Schema of what every command prints with --json
///
/// Example: hgm schema > hgm.schema.json
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    session.emit(&serde_json::from_str::<serde_json::Value>(SCHEMA)?, SCHEMA)
}

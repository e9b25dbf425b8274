//! `hgm schema`: what `--json` prints, as a JSON Schema.

use super::{Failure, Session};
use crate::manual::schema::schema;

/// Print the JSON Schema of what every command prints with --json
///
/// Example: hgm schema > hgm.schema.json
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let schema = schema()?;
    session.emit(&schema, &format!("{schema:#}\n"))
}

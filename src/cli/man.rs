//! `hgm man`: the program's description of itself.

use super::{Failure, Session};
use crate::artefact::write_whole;
use crate::manual::Form;
use std::path::PathBuf;

/// Write man pages, one per command; or the reference pages of the documentation, or the descriptor of the BIDS App
///
/// Example: hgm man -o ~/.local/share/man/man1
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder to write into
    #[arg(short, long, default_value = "man")]
    output: PathBuf,
    /// What to write
    #[arg(long, value_enum, value_name = "FORM", default_value = "man")]
    form: Form,
}

pub fn run(args: &Args, hgm: clap::Command, session: &Session) -> Result<(), Failure> {
    let mut files = Vec::new();
    for (name, text) in args.form.pages(hgm)? {
        let file = args.output.join(name);
        write_whole(&file, &text)?;
        files.push(file.display().to_string());
    }
    session.emit(&serde_json::json!({ "files": files }), "")
}

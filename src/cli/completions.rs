//! `hgm completions`: shell completions from the command line's own definition.

use super::{Failure, Session};

/// Print shell completions
///
/// Example: hgm completions bash > ~/.local/share/bash-completion/completions/hgm
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell to complete for
    shell: clap_complete::Shell,
}

pub fn run(args: &Args, mut hgm: clap::Command, session: &Session) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut hgm, "hgm", &mut script);
    let script = String::from_utf8(script)?;
    session.emit(&serde_json::json!({ "shell": args.shell.to_string(), "script": script }), &script)
}

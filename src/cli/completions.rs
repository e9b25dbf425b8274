//! `hgm completions`: shell completions from the command line's own definition.

use super::{Failure, Hgm, Session};
use clap::CommandFactory;

/// Print shell completions
///
/// Example: hgm completions bash > ~/.local/share/bash-completion/completions/hgm
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell to complete for
    shell: clap_complete::Shell,
}

pub fn run(args: &Args, _session: &Session) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Hgm::command(), "hgm", &mut script);
    print!("{}", String::from_utf8(script)?);
    Ok(())
}

//! `hgm man`: man pages from the command line's own definition.

use super::{Failure, Hgm, Session};
use crate::artefact::write_whole;
use clap::CommandFactory;
use std::path::PathBuf;

/// Write man pages, one per command
///
/// Example: hgm man -o ~/.local/share/man/man1
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder to write into
    #[arg(short, long, default_value = "man")]
    output: PathBuf,
}

pub fn run(args: &Args, _session: &Session) -> Result<(), Failure> {
    let whole = Hgm::command();
    let page = |command: clap::Command, name: &str| -> Result<(), Failure> {
        let mut bytes = Vec::new();
        clap_mangen::Man::new(command).render(&mut bytes)?;
        Ok(write_whole(&args.output.join(format!("{name}.1")), &bytes)?)
    };
    for sub in whole.get_subcommands() {
        let name = format!("hgm-{}", sub.get_name());
        page(sub.clone().name(name.clone().leak() as &'static str), &name)?;
    }
    page(whole, "hgm")
}

//! `hgm doctor`: what is installed, what is missing, the command that installs it.

use super::{Failure, Session};
use crate::workflow::{Known, known};
use serde::Serialize;
use std::fmt::Write;

/// Tell what is installed, what is missing and the command that installs it
///
/// Example: hgm doctor
#[derive(Debug, clap::Args)]
pub struct Args {}

/// One thing hgm can use but does not need.
#[derive(Debug, Serialize)]
struct Finding {
    what: &'static str,
    used_for: &'static str,
    found: bool,
    location: Option<String>,
    install: &'static str,
}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let finding = |known: Known| {
        let location = session.programs.find(known.name).map(|path| path.display().to_string());
        let Known { name: what, used_for, install, .. } = known;
        Finding { what, used_for, found: location.is_some(), location, install }
    };
    let findings: Vec<Finding> = known().map(finding).collect();
    let mut text = String::from("Needed: nothing beyond this program. Optional:\n");
    for f in &findings {
        let state = f.location.clone().unwrap_or_else(|| format!("missing; install: {}", f.install));
        writeln!(text, "  {:<18} {:<48} {state}", f.what, f.used_for)?;
    }
    session.emit(&findings, &text)
}

//! `hgm doctor`: what is installed, what is missing, the command that installs it.

use super::{Failure, Session};
use crate::workflow::results_in_words;

/// Tell what is installed, what is missing and the command that installs it
///
/// Example: hgm doctor
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let findings = session.programs.findings();
    session.emit(&findings, &results_in_words::programs(&findings))
}

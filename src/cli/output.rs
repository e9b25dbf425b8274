//! Lines on stdout, to readers who may go away.

use anyhow::Context;
use std::io::{ErrorKind, Write};

/// A line on stdout; a reader who has gone away (`hgm ... | head -1`) wants no more, and that is no fault.
///
/// # Errors
/// A disk that is full, where stdout is a file.
pub fn print_line(text: &str) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("standard output cannot be written"),
        _ => Ok(()),
    }
}

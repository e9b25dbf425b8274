//! How a program ends that is told to: between two files.

use super::write::no_more_writes;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::sync::OnceLock;

/// What ends a command that runs until it is told to, in the place of ending at once.
static AT_SIGNAL: OnceLock<Box<dyn Fn() + Send + Sync>> = OnceLock::new();

/// Has the first Ctrl-C (or closed terminal, or SIGTERM) call this instead of ending the program; the next one ends it.
pub fn at_signal(end: impl Fn() + Send + Sync + 'static) {
    // A program runs one command.
    AT_SIGNAL.set(Box::new(end)).ok();
}

/// On Ctrl-C, a closed terminal or a scheduler's SIGTERM: lets the file that is being written become whole, then ends.
///
/// # Errors
/// The system's, where it lets no handler be set.
pub fn end_between_files() -> std::io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    std::thread::spawn(move || {
        for (earlier, signal) in signals.forever().enumerate() {
            if let (0, Some(end)) = (earlier, AT_SIGNAL.get()) {
                end();
                continue;
            }
            let _whole = no_more_writes();
            // As shells tell it.
            std::process::exit(128 + signal);
        }
    });
    Ok(())
}

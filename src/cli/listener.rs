//! Listens to a job for the terminal: bars while it runs, log lines as stages end.

use crate::workflow::{Progress, StageEnded};
use indicatif::{ProgressBar, ProgressStyle};

/// Log lines about what a file was taken for: told at every level but the quietest.
pub const TAKEN_FOR: &str = "hgm::taken_for";

/// Bars and log lines on stderr.
pub struct Listener {
    shown: bool,
    bar: ProgressBar,
}

impl Listener {
    /// With bars where they are wanted.
    pub fn new(shown: bool) -> Self {
        Self { shown, bar: ProgressBar::hidden() }
    }
}

impl Progress for Listener {
    fn begin(&mut self, part: &'static str, steps: usize) {
        self.bar.finish_and_clear();
        self.bar = if self.shown { bar(steps as u64, part) } else { ProgressBar::hidden() };
    }

    fn doing(&mut self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    fn step(&mut self) {
        self.bar.inc(1);
    }

    fn end(&mut self) {
        self.bar.finish_and_clear();
    }

    fn stage(&mut self, ended: &StageEnded<'_>) {
        let name = ended.stage.shown();
        tracing::info!("{name}: {}", if ended.skipped { "already there, skipped" } else { "done" });
        for reason in ended.reasons {
            tracing::info!("{name}: it ran because {reason}");
        }
        for warning in ended.warnings {
            // Some say themselves whose they are, for the page.
            let told = warning.strip_prefix(&format!("{name}: ")).unwrap_or(warning);
            tracing::warn!("{name}: {told}");
        }
    }

    fn odd(&mut self, file: &str, what: &str) {
        tracing::warn!("{file}: {what}");
    }

    fn taken_for(&mut self, what: &str) {
        tracing::info!(target: TAKEN_FOR, "{what}");
    }

    fn noted(&mut self, what: &str) {
        tracing::info!("{what}");
    }

    fn detail(&mut self, of: &str, what: &str) {
        tracing::debug!("{of}: {what}");
    }
}

/// A bar with the time left.
fn bar(steps: u64, what: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix:>14} [{bar:30}] {pos}/{len} {msg} (left {eta})")
        .expect("the template is constant")
        .progress_chars("=> ");
    ProgressBar::new(steps).with_style(style).with_prefix(what)
}

//! How a job tells whoever started it what it is doing.

use super::stage_name::StageName;
use crate::artefact::Reason;
use std::sync::{Arc, Mutex, PoisonError};

/// Listens to a job. Every method may be left out.
#[allow(unused_variables, reason = "the names say what is handed over")]
pub trait Progress {
    /// A part of the job of this many steps begins.
    fn begin(&mut self, part: &'static str, steps: usize) {}
    /// What is being done within the step.
    fn doing(&mut self, what: &str) {}
    /// One step is done.
    fn step(&mut self) {}
    /// The part has ended.
    fn end(&mut self) {}
    /// A stage is there: made now, or from before.
    fn stage(&mut self, ended: &StageEnded<'_>) {}
    /// Something odd about a file that was given.
    fn odd(&mut self, file: &str, what: &str) {}
    /// What a file that was given was taken for: whoever gave it must hear it.
    fn taken_for(&mut self, what: &str) {}
    /// What goes on, for whoever follows the job.
    fn noted(&mut self, what: &str) {}
    /// What only somebody looking for a fault wants to know.
    fn detail(&mut self, of: &str, what: &str) {}
}

/// A stage whose files are there.
#[derive(Clone, Copy, Debug)]
pub struct StageEnded<'a> {
    /// Which.
    pub stage: &'a StageName,
    /// Whether its files were there already.
    pub skipped: bool,
    /// Why it was made again; empty where it was skipped, new or asked for.
    pub reasons: &'a [Reason],
    /// What a reader must know of its files.
    pub warnings: &'a [String],
}

/// Listens to nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {}

/// One that whoever asked for the job keeps a hold of. A caller that breaks a job off does so by unwinding out of it, which
/// must not silence it.
#[derive(Clone)]
pub struct Shared(pub Arc<Mutex<dyn Progress + Send>>);

impl Shared {
    fn tell(&self, what: impl FnOnce(&mut dyn Progress)) {
        what(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Progress for Shared {
    fn begin(&mut self, part: &'static str, steps: usize) {
        self.tell(|p| p.begin(part, steps));
    }

    fn doing(&mut self, what: &str) {
        self.tell(|p| p.doing(what));
    }

    fn step(&mut self) {
        self.tell(|p| p.step());
    }

    fn end(&mut self) {
        self.tell(|p| p.end());
    }

    fn stage(&mut self, ended: &StageEnded<'_>) {
        self.tell(|p| p.stage(ended));
    }

    fn odd(&mut self, file: &str, what: &str) {
        self.tell(|p| p.odd(file, what));
    }

    fn taken_for(&mut self, what: &str) {
        self.tell(|p| p.taken_for(what));
    }

    fn noted(&mut self, what: &str) {
        self.tell(|p| p.noted(what));
    }

    fn detail(&mut self, of: &str, what: &str) {
        self.tell(|p| p.detail(of, what));
    }
}

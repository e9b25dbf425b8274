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
    /// What a file that was given was taken for.
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

/// What a job told that ran beside another, kept to be told after that one; its steps are nobody's.
#[derive(Debug, Default)]
pub(super) struct Later(Vec<Told>);

#[derive(Debug)]
enum Told {
    Stage { stage: StageName, skipped: bool, reasons: Vec<Reason>, warnings: Vec<String> },
    Odd { file: String, what: String },
    Noted(String),
    Detail { of: String, what: String },
}

impl Later {
    /// Tells it all, in its order.
    pub(super) fn tell(&self, progress: &mut dyn Progress) {
        for told in &self.0 {
            match told {
                Told::Stage { stage, skipped, reasons, warnings } => {
                    progress.stage(&StageEnded { stage, skipped: *skipped, reasons, warnings });
                }
                Told::Odd { file, what } => progress.odd(file, what),
                Told::Noted(what) => progress.noted(what),
                Told::Detail { of, what } => progress.detail(of, what),
            }
        }
    }
}

impl Progress for Later {
    fn stage(&mut self, ended: &StageEnded<'_>) {
        self.0.push(Told::Stage {
            stage: ended.stage.clone(),
            skipped: ended.skipped,
            reasons: ended.reasons.to_vec(),
            warnings: ended.warnings.to_vec(),
        });
    }

    fn odd(&mut self, file: &str, what: &str) {
        self.0.push(Told::Odd { file: file.to_owned(), what: what.to_owned() });
    }

    fn noted(&mut self, what: &str) {
        self.0.push(Told::Noted(what.to_owned()));
    }

    fn detail(&mut self, of: &str, what: &str) {
        self.0.push(Told::Detail { of: of.to_owned(), what: what.to_owned() });
    }
}

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

    fn noted(&mut self, what: &str) {
        self.tell(|p| p.noted(what));
    }

    fn detail(&mut self, of: &str, what: &str) {
        self.tell(|p| p.detail(of, what));
    }
}

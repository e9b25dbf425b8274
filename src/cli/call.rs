//! A command asked for by another program in this process: same words, same files, same messages as at the terminal. The result
//! comes back as JSON; nothing is printed, no signal is taken, no thread pool built.

use super::failure::Failure;
use crate::workflow::Progress;
use std::sync::{Arc, Mutex, PoisonError};

/// What a command has left.
#[derive(Debug)]
pub struct Called {
    /// What it prints with `--json`; a quality gate may refuse it all the same.
    pub result: Option<String>,
    /// How it ended.
    pub ended: Result<(), Failure>,
}

/// The program that asked for the command.
#[derive(Clone)]
pub struct Caller {
    /// Listens in place of the terminal.
    pub progress: Arc<Mutex<dyn Progress + Send>>,
    /// Takes the result, as JSON, in place of stdout.
    pub result: Arc<Mutex<Option<String>>>,
}

impl Caller {
    /// What has come back, and how the command ended.
    pub fn called(&self, ended: Result<(), Failure>) -> Called {
        Called { result: self.result.lock().unwrap_or_else(PoisonError::into_inner).take(), ended }
    }
}

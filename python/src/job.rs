//! A job of the library beside Python: it runs in a thread of its own without Python's lock; the calling thread hands what
//! the job tells to the caller's function and watches for Ctrl-C.

use hgm::workflow::{Progress, StageEnded};
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;
use std::time::Duration;

/// How long Ctrl-C may wait to be seen.
const LOOK: Duration = Duration::from_millis(50);
/// As much as a program's first thread has.
const STACK_BYTES: usize = 8 << 20;

/// Levels of Python's `logging`.
const DEBUG: u8 = 10;
const INFO: u8 = 20;
const WARNING: u8 = 30;

/// What a job tells.
enum Told {
    Begin(&'static str, usize),
    Doing(String),
    Step,
    End,
    Log(u8, String),
}

/// What a job unwinds with when it was broken off: it has ended between two files.
struct BrokenOff;

/// Hands on what the job tells; breaks it off when asked to.
pub struct Ear {
    to: Sender<Told>,
    stop: Arc<AtomicBool>,
}

impl Ear {
    fn tell(&mut self, told: Told) {
        self.breathe();
        // Nobody listens after a second Ctrl-C.
        self.to.send(told).ok();
    }

    /// Breaks the job off where it was asked to.
    pub fn breathe(&self) {
        if self.stop.load(Ordering::Relaxed) {
            // Not a fault: the hook that prints panics is passed by.
            resume_unwind(Box::new(BrokenOff));
        }
    }
}

impl Progress for Ear {
    fn begin(&mut self, part: &'static str, steps: usize) {
        self.tell(Told::Begin(part, steps));
    }

    fn doing(&mut self, what: &str) {
        self.tell(Told::Doing(what.to_owned()));
    }

    fn step(&mut self) {
        self.tell(Told::Step);
    }

    fn end(&mut self) {
        self.tell(Told::End);
    }

    fn stage(&mut self, ended: &StageEnded<'_>) {
        let name = ended.stage.shown();
        let how = if ended.skipped { "already there, skipped" } else { "done" };
        self.tell(Told::Log(INFO, format!("{name}: {how}")));
        for warning in ended.warnings {
            let told = warning.strip_prefix(&format!("{name}: ")).unwrap_or(warning);
            self.tell(Told::Log(WARNING, format!("{name}: {told}")));
        }
    }

    fn odd(&mut self, file: &str, what: &str) {
        self.tell(Told::Log(WARNING, format!("{file}: {what}")));
    }

    fn taken_for(&mut self, what: &str) {
        self.tell(Told::Log(INFO, what.to_owned()));
    }

    fn noted(&mut self, what: &str) {
        self.tell(Told::Log(INFO, what.to_owned()));
    }

    fn detail(&mut self, of: &str, what: &str) {
        self.tell(Told::Log(DEBUG, format!("{of}: {what}")));
    }
}

/// Where a part of the job stands, as the caller's function hears it.
#[derive(Default)]
struct Standing {
    part: &'static str,
    done: usize,
    total: usize,
    doing: String,
}

impl Standing {
    /// Hands one thing on.
    fn hear(&mut self, py: Python<'_>, progress: Option<&Py<PyAny>>, told: Told) -> PyResult<()> {
        match told {
            Told::Log(level, text) => {
                let logger = py.import("logging")?.call_method1("getLogger", ("hgm",))?;
                return logger.call_method1("log", (level, "%s", text)).map(|_| ());
            }
            Told::Begin(part, total) => *self = Self { part, total, ..Self::default() },
            Told::Doing(what) => self.doing = what,
            Told::Step => self.done += 1,
            Told::End => self.done = self.total,
        }
        match progress {
            Some(progress) => progress.call1(py, (self.part, self.done, self.total, &self.doing)).map(|_| ()),
            None => Ok(()),
        }
    }
}

/// Runs `work` to its end, or until Ctrl-C or an exception of `progress`: then the job ends at its next step, every file
/// whole, and the exception is returned. A second Ctrl-C does not wait for that.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(Arc<Mutex<Ear>>) -> T + Send + 'static,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (to, from) = channel();
    let ear = Arc::new(Mutex::new(Ear { to, stop: Arc::clone(&stop) }));
    let job = Builder::new().name("hgm".to_owned()).stack_size(STACK_BYTES).spawn(move || work(ear))?;
    let (from, mut standing, mut broken) = (Mutex::new(from), Standing::default(), None);
    loop {
        let told = py.detach(|| from.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK));
        let heard = match told {
            Ok(told) if broken.is_none() => standing.hear(py, progress, told),
            Ok(_) | Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        for error in [heard.err(), py.check_signals().err()].into_iter().flatten() {
            stop.store(true, Ordering::Relaxed);
            if broken.is_some() {
                return Err(error);
            }
            broken = Some(error);
        }
    }
    let ended = py.detach(|| job.join());
    match (ended, broken) {
        (_, Some(error)) => Err(error),
        (Ok(found), None) => Ok(found),
        // A fault of the library: Python's PanicException.
        (Err(panic), None) => resume_unwind(panic),
    }
}

//! What every subcommand shares: global options, settings from a file, output, progress, input files.

use super::call::Caller;
use super::failure::Failure;
use super::flags::word;
use super::listener::{Listener, TAKEN_FOR};
use super::output::print_line;
use crate::artefact::end_between_files;
use crate::image::nifti::Orientation;
use crate::workflow::{Case, Layer, Place, Programs, Progress, Settings, Shared, read_text};
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError};

/// Whether a result has been printed: then stdout is whole, and a failure is told on stderr and by the exit code alone.
static EMITTED: AtomicBool = AtomicBool::new(false);

/// See [`EMITTED`].
pub fn has_emitted() -> bool {
    EMITTED.load(Ordering::Relaxed)
}

/// Options of every command.
#[derive(Clone, Debug, clap::Args)]
pub struct GlobalOptions {
    /// Settings file (TOML, one table for each part; `hgm settings` prints one with every setting)
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Machine-readable result on stdout (see `hgm schema`), logs on stderr
    #[arg(long, global = true)]
    pub json: bool,
    /// Threads to use (results do not depend on it) [default: all cores]
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// Seed of everything random
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u64).range(..1 << 53))]
    pub seed: Option<u64>,
    /// Which volume, from 0, of a NIfTI file that holds several [default: such a file is refused]
    #[arg(long, global = true, value_name = "N")]
    pub volume: Option<usize>,
    /// Which affine to believe where a NIfTI file's two disagree: sform or qform [default: such a file is refused]
    #[arg(long, global = true, value_name = "FORM", value_parser = word::<Orientation>)]
    pub prefer: Option<Orientation>,
    /// Compute again what is already there
    #[arg(long, global = true)]
    pub force: bool,
    /// More log lines (twice: even more)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// Only errors
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

/// The global options, resolved: thread pool built, settings file parsed, logging on.
pub struct Session {
    /// The options as given.
    pub options: GlobalOptions,
    /// The programs of this machine.
    pub programs: Programs,
    config: toml::Table,
    caller: Option<Caller>,
}

impl Session {
    /// Starts logging and the thread pool and reads the settings file.
    pub fn open(options: GlobalOptions) -> Result<Self, Failure> {
        let level = match (options.quiet, options.verbose) {
            (true, _) => "error",
            (false, 0) => "warn",
            (false, 1) => "info",
            (false, _) => "debug",
        };
        // What a file was taken for is said unless nothing is to be.
        let taken_for = if options.quiet { "error" } else { "info" };
        let filter = format!("hgm={level},{TAKEN_FOR}={taken_for}");
        let subscriber = tracing_subscriber::fmt()
            .with_env_filter(tracing_subscriber::EnvFilter::new(filter))
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none())
            .without_time()
            .with_target(false);
        // Fails only when a test has set one up before; the first stays.
        subscriber.try_init().ok();
        end_between_files().context("the system lets no signal handler be set")?;
        if options.threads == Some(0) {
            return Err(Failure::Rejected(anyhow!("--threads 0: give 1 or more, or leave it out for all cores")));
        }
        rayon::ThreadPoolBuilder::new().num_threads(options.threads.unwrap_or(0)).build_global().ok();
        let config = config(&options)?;
        let programs = Programs::look_up(std::env::current_exe().ok().as_deref(), |name| std::env::var_os(name));
        Ok(Self { options, programs, config, caller: None })
    }

    /// For a caller: no signal handlers, no thread pool, no logs, nothing printed. `beside` is where programs are looked for
    /// before the `PATH`.
    pub fn within(options: GlobalOptions, beside: Option<&Path>, caller: Caller) -> Result<Self, Failure> {
        let config = config(&options)?;
        let programs = Programs::look_up(beside, |name| std::env::var_os(name));
        Ok(Self { options, programs, config, caller: Some(caller) })
    }

    /// The settings of a job that makes something new: the defaults, over them the settings file, over that the options.
    pub fn settings(&self, flags: Layer) -> Result<Settings, Failure> {
        self.settings_over(&toml::Table::new(), flags)
    }

    /// The settings of a job on a case: its own come between the defaults and the settings file.
    pub fn settings_of(&self, folder: &Path, flags: Layer) -> Result<Settings, Failure> {
        self.settings_over(&Case::open(folder)?.settings()?, flags)
    }

    /// The settings over those of a job's own, which take the place of the defaults.
    pub fn settings_over(&self, own: &toml::Table, mut flags: Layer) -> Result<Settings, Failure> {
        flags.set("image.prefer", self.options.prefer);
        flags.set("image.volume", self.options.volume);
        for room in ["register", "gp", "synth", "predict"] {
            flags.set(&format!("{room}.seed"), self.options.seed);
        }
        Ok(Settings::resolve([own, &self.config, &flags.0])?)
    }

    /// Where a job is done.
    pub fn place(&self, folder: &Path) -> Place {
        Place { folder: folder.to_path_buf(), programs: self.programs.clone(), force: self.options.force }
    }

    /// Whoever listens to a job.
    pub fn listener(&self) -> Box<dyn Progress> {
        match &self.caller {
            Some(caller) => Box::new(Shared(Arc::clone(&caller.progress))),
            None => Box::new(Listener::new(!self.options.quiet && std::io::stderr().is_terminal())),
        }
    }

    /// Prints the result: `value` with `--json`, else the text.
    pub fn emit(&self, value: &impl Serialize, text: &str) -> Result<(), Failure> {
        if let Some(caller) = &self.caller {
            *caller.result.lock().unwrap_or_else(PoisonError::into_inner) = Some(serde_json::to_string(value)?);
            return Ok(());
        }
        EMITTED.store(true, Ordering::Relaxed);
        if self.options.json {
            print_line(&serde_json::to_string_pretty(value)?)?;
        } else if !text.is_empty() {
            print_line(text.trim_end())?;
        }
        Ok(())
    }
}

/// Log lines of what a reader must know of a result.
pub fn warn<W: std::fmt::Display>(warnings: &[W]) {
    for warning in warnings {
        tracing::warn!("{warning}");
    }
}

fn config(options: &GlobalOptions) -> Result<toml::Table, Failure> {
    Ok(match &options.config {
        None => toml::Table::new(),
        Some(path) => Settings::layer(&read_text(path)?, &path.display().to_string())?,
    })
}

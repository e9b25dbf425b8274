//! What every subcommand shares: global options, settings from a file, output, progress, input files.

use super::failure::{Failure, Reject};
use super::settings_file;
use crate::artefact::no_more_writes;
use crate::image::nifti::{Orientation, ReadOptions};
use anyhow::{Context, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde::de::DeserializeOwned;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a result has been printed: then stdout is whole, and a failure is told on stderr and by the exit code alone.
static EMITTED: AtomicBool = AtomicBool::new(false);

/// See [`EMITTED`].
pub fn has_emitted() -> bool {
    EMITTED.load(Ordering::Relaxed)
}

/// Options of every command.
#[derive(Clone, Debug, clap::Args)]
pub struct GlobalOptions {
    /// Settings file (TOML, one table for each part: register, segment, mesh, gp, law ...)
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Machine-readable result on stdout (see `hgm schema`), logs on stderr
    #[arg(long, global = true)]
    pub json: bool,
    /// Threads to use (results do not depend on it) [default: all cores]
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// Seed of everything random
    #[arg(long, global = true, value_name = "N")]
    pub seed: Option<u64>,
    /// Which volume, from 0, of a NIfTI file that holds several [default: such a file is refused]
    #[arg(long, global = true, value_name = "N")]
    pub volume: Option<usize>,
    /// Which affine to believe where a NIfTI file's two disagree: sform or qform [default: such a file is refused]
    #[arg(long, global = true, value_name = "FORM", value_parser = orientation)]
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

fn orientation(name: &str) -> Result<Orientation, String> {
    serde_json::from_value(name.into()).map_err(|_| format!("`{name}` is neither sform nor qform"))
}

/// The global options, resolved: thread pool built, settings file parsed, logging on.
#[derive(Debug)]
pub struct Session {
    /// The options as given.
    pub options: GlobalOptions,
    config: toml::Table,
}

impl Session {
    /// Starts logging and the thread pool and reads the settings file.
    ///
    /// # Errors
    /// A settings file that cannot be read or parsed is rejected.
    pub fn open(options: GlobalOptions) -> Result<Self, Failure> {
        let level = match (options.quiet, options.verbose) {
            (true, _) => "error",
            (false, 0) => "warn",
            (false, 1) => "info",
            (false, _) => "debug",
        };
        let subscriber = tracing_subscriber::fmt()
            .with_env_filter(tracing_subscriber::EnvFilter::new(format!("hgm={level}")))
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
        let config = match &options.config {
            None => toml::Table::new(),
            Some(path) => settings_file::tables(&read_text(path)?, &path.display().to_string())?,
        };
        Ok(Self { options, config })
    }

    /// The settings of one room: the table `[room]` of the settings file over the defaults. Command-line options go
    /// over the result in the subcommand.
    ///
    /// # Errors
    /// Unknown or ill-typed keys are rejected by name.
    pub fn settings<T: DeserializeOwned + Default>(&self, room: &str) -> Result<T, Failure> {
        match self.config.get(room) {
            None => Ok(T::default()),
            Some(table) => {
                settings_file::typed(table).map_err(|e| anyhow!("{}: table [{room}]: {e}", self.config_name())).reject()
            }
        }
    }

    /// How NIfTI files that leave a choice open are read: `--volume` and `--prefer` over the table `[image]`.
    ///
    /// # Errors
    /// As [`Session::settings`].
    pub fn reading(&self) -> Result<ReadOptions, Failure> {
        let settings: ReadOptions = self.settings("image")?;
        Ok(ReadOptions {
            prefer: self.options.prefer.or(settings.prefer),
            volume: self.options.volume.or(settings.volume),
        })
    }

    /// Whether the settings file has a table of this room.
    pub fn has_table(&self, room: &str) -> bool {
        self.config.contains_key(room)
    }

    /// Whether the settings file names this key of this room.
    pub fn has_settings(&self, room: &str, key: &str) -> bool {
        self.config.get(room).and_then(|table| table.get(key)).is_some()
    }

    fn config_name(&self) -> String {
        self.options.config.as_ref().map_or_else(String::new, |path| path.display().to_string())
    }

    /// Prints the result: `value` with `--json`, else the text.
    ///
    /// # Errors
    /// A value that cannot be serialised.
    pub fn emit(&self, value: &impl Serialize, text: &str) -> Result<(), Failure> {
        EMITTED.store(true, Ordering::Relaxed);
        if self.options.json {
            println!("{}", serde_json::to_string_pretty(value)?);
        } else if !text.is_empty() {
            println!("{}", text.trim_end());
        }
        Ok(())
    }

    /// A progress bar of `steps` steps with time left; hidden when stderr is not a terminal or with `-q`.
    ///
    /// # Panics
    /// Never: the template is a constant.
    pub fn progress(&self, steps: u64, what: &'static str) -> ProgressBar {
        if self.options.quiet || !std::io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let style = ProgressStyle::with_template("{prefix:>14} [{bar:30}] {pos}/{len} {msg} (left {eta})")
            .expect("the template is constant")
            .progress_chars("=> ");
        ProgressBar::new(steps).with_style(style).with_prefix(what)
    }
}

/// On Ctrl-C, a closed terminal or a scheduler's SIGTERM: lets the file that is being written become whole, then ends.
fn end_between_files() -> std::io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            let _whole = no_more_writes();
            // As shells tell it.
            std::process::exit(128 + signal);
        }
    });
    Ok(())
}

/// A file the user named, whole.
///
/// # Errors
/// Rejected with the file's name and what to do.
pub fn read_input(path: &Path) -> Result<Vec<u8>, Failure> {
    if path.is_dir() {
        return Err(Failure::Rejected(anyhow!("{}: is a folder; name a file", path.display())));
    }
    std::fs::read(path).with_context(|| format!("{}: cannot be read; check the path", path.display())).reject()
}

/// A text file the user named.
///
/// # Errors
/// As [`read_input`]; also when it is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    let said = |_| anyhow!("{}: not UTF-8 text; save the file as UTF-8", path.display());
    String::from_utf8(read_input(path)?).map_err(said).reject()
}

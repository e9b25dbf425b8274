//! One file per subcommand: options to settings, a call of the workflow, print. No algorithm lives here.
//!
//! A subcommand file has an `Args` struct (clap) and a `run(args, &Session) -> Result<(), Failure>`. Results go to
//! stdout (JSON with `--json`), logs and progress to stderr. Exit codes: 0 done, 1 failed, 2 usage, 3 input rejected,
//! 4 computed but the quality gate refused it (outputs kept).

mod bids;
mod call;
mod compare;
mod completions;
mod demo;
mod doctor;
mod estimate;
mod evaluate;
mod failure;
mod flags;
mod gp;
mod law;
mod layout;
mod listener;
mod live;
mod man;
mod mesh;
mod output;
mod phantom;
mod population;
mod predict;
mod prep;
mod reduce;
mod register;
mod remedy;
mod report;
mod run;
mod schema;
mod segment;
mod session;
mod settings;
mod simulate;
mod sweep;
mod synth;
mod warp;
mod why;

pub use call::Called;
pub use failure::Failure;

use crate::manual::help;
use crate::workflow::Progress;
use anyhow::anyhow;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use session::{GlobalOptions, Session};
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

/// From a pre- and post-operative T1 pair to a biomechanical answer. Research software, not a medical device.
#[derive(Debug, Parser)]
#[command(name = "hgm", version, max_term_width = 110)]
pub struct Hgm {
    #[command(flatten)]
    global: GlobalOptions,
    #[command(subcommand)]
    command: Command,
}

/// The commands: what each is called, and the file that has its options and runs it; `of` hands it more.
macro_rules! commands {
    ($($name:ident: $file:ident $(of $more:ident)?,)*) => {
        #[derive(Debug, Subcommand)]
        enum Command {
            $($name($file::Args),)*
        }

        fn dispatch(command: Command, session: &Session) -> Result<(), Failure> {
            match command {
                $(Command::$name(args) => $file::run(&args, $($more(),)? session),)*
            }
        }
    };
}

commands! {
    Demo: demo,
    Prep: prep,
    Run: run,
    Phantom: phantom,
    Predict: predict,
    Sweep: sweep,
    Reduce: reduce,
    Estimate: estimate,
    Warp: warp,
    Evaluate: evaluate,
    Compare: compare,
    Simulate: simulate,
    Live: live,
    Synth: synth,
    Gp: gp,
    Law: law,
    Doctor: doctor,
    Completions: completions of command_line,
    Man: man of command_line,
    Register: register,
    Mesh: mesh,
    Segment: segment,
    Report: report,
    Bids: bids,
    Population: population,
    Why: why,
    Layout: layout,
    Schema: schema,
    Settings: settings,
}

/// The whole command line, as it is parsed and shown.
pub fn command_line() -> clap::Command {
    help::command(Hgm::command())
}

fn parsed(words: impl IntoIterator<Item = OsString>) -> Result<Hgm, clap::Error> {
    let mut matches = command_line().try_get_matches_from(words)?;
    Hgm::from_arg_matches_mut(&mut matches)
}

/// Help, version, or what is wrong with the command line, with the commands that a mistyped word may mean.
fn said(error: &clap::Error) -> u8 {
    // Whoever reads no further (`hgm --help | head -1`) has what was wanted.
    error.print().ok();
    let meant = help::meant_by(&Hgm::command(), error);
    if !meant.is_empty() {
        eprintln!("hgm: there is `{}`", meant.join("` and `"));
    }
    u8::try_from(error.exit_code()).unwrap_or(2)
}

/// Entry point of the program: parses, runs, turns failures into exit codes.
pub fn main() -> ExitCode {
    ExitCode::from(main_with(std::env::args_os()))
}

/// The same from the words of a command line, the program's own name first; returns the exit code. It is for the one command
/// of a process: it takes the signals and builds the thread pool.
pub fn main_with(words: impl IntoIterator<Item = OsString>) -> u8 {
    let mut hgm = match parsed(words) {
        Ok(hgm) => hgm,
        Err(error) => return said(&error),
    };
    let json = hgm.global.json;
    if let Command::Bids(args) = &hgm.command {
        hgm.global.threads = hgm.global.threads.or(args.nprocs);
    }
    match Session::open(hgm.global).and_then(|session| dispatch(hgm.command, &session)) {
        Ok(()) => 0,
        Err(failure) => {
            failure.report(json && !session::has_emitted());
            failure.code()
        }
    }
}

/// One command for another program in this process: `words` without the program's name; other programs are looked for beside
/// the file `beside`, then on the `PATH`. A `progress` that unwinds breaks the command off between two files.
pub fn call(words: &[OsString], beside: Option<&Path>, progress: Arc<Mutex<dyn Progress + Send>>) -> Called {
    let caller = call::Caller { progress, result: Arc::default() };
    let ended = parsed(std::iter::once("hgm".into()).chain(words.iter().cloned()))
        .map_err(|error| Failure::Rejected(anyhow!(help::in_one_line(&error))))
        .and_then(|hgm| dispatch(hgm.command, &Session::within(hgm.global, beside, caller.clone())?));
    caller.called(ended)
}

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
#[cfg(test)]
mod documented;
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
mod manual;
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
pub use failure::{Failure, Reject};
pub use session::{GlobalOptions, Session};

use crate::workflow::Progress;
use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
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

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Prep(prep::Args),
    Run(run::Args),
    Phantom(phantom::Args),
    Predict(predict::Args),
    Sweep(sweep::Args),
    Reduce(reduce::Args),
    Estimate(estimate::Args),
    Warp(warp::Args),
    Evaluate(evaluate::Args),
    Compare(compare::Args),
    Simulate(simulate::Args),
    Live(live::Args),
    Synth(synth::Args),
    Gp(gp::Args),
    Law(law::Args),
    Doctor(doctor::Args),
    Completions(completions::Args),
    Man(man::Args),
    Register(register::Args),
    Mesh(mesh::Args),
    Segment(segment::Args),
    Report(report::Args),
    Bids(bids::Args),
    Population(population::Args),
    Why(why::Args),
    Layout(layout::Args),
    Schema(schema::Args),
    Settings(settings::Args),
}

fn parsed(words: impl IntoIterator<Item = OsString>) -> Result<Hgm, clap::Error> {
    let mut matches = manual::command(Hgm::command()).try_get_matches_from(words)?;
    Hgm::from_arg_matches_mut(&mut matches)
}

/// Help, version, or what is wrong with the command line, with the commands that a mistyped word may mean.
fn said(error: &clap::Error) -> u8 {
    // Whoever reads no further (`hgm --help | head -1`) has what was wanted.
    error.print().ok();
    let word = error.get(ContextKind::InvalidSubcommand).and_then(|value| match value {
        ContextValue::String(word) => Some(word.clone()),
        _ => None,
    });
    let meant = word.map(|word| manual::meant_below(&Hgm::command(), &word)).unwrap_or_default();
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
    let caller = call::Caller::new(progress);
    let ended = parsed(std::iter::once("hgm".into()).chain(words.iter().cloned()))
        .map_err(|error| call::misspoken(&error))
        .and_then(|hgm| dispatch(hgm.command, &Session::within(hgm.global, beside, caller.clone())?));
    caller.called(ended)
}

fn dispatch(command: Command, session: &Session) -> Result<(), Failure> {
    match command {
        Command::Demo(args) => demo::run(&args, session),
        Command::Prep(args) => prep::run(&args, session),
        Command::Run(args) => run::run(&args, session),
        Command::Phantom(args) => phantom::run(&args, session),
        Command::Predict(args) => predict::run(&args, session),
        Command::Sweep(args) => sweep::run(&args, session),
        Command::Reduce(args) => reduce::run(&args, session),
        Command::Estimate(args) => estimate::run(&args, session),
        Command::Warp(args) => warp::run(&args, session),
        Command::Evaluate(args) => evaluate::run(&args, session),
        Command::Compare(args) => compare::run(&args, session),
        Command::Simulate(args) => simulate::run(&args, session),
        Command::Live(args) => live::run(&args, session),
        Command::Synth(args) => synth::run(&args, session),
        Command::Gp(args) => gp::run(&args, session),
        Command::Law(args) => law::run(&args, session),
        Command::Doctor(args) => doctor::run(&args, session),
        Command::Completions(args) => completions::run(&args, manual::command(Hgm::command()), session),
        Command::Man(args) => man::run(&args, manual::command(Hgm::command()), session),
        Command::Mesh(args) => mesh::run(&args, session),
        Command::Register(args) => register::run(&args, session),
        Command::Segment(args) => segment::run(&args, session),
        Command::Report(args) => report::run(&args, session),
        Command::Bids(args) => bids::run(&args, session),
        Command::Population(args) => population::run(&args, session),
        Command::Why(args) => why::run(&args, session),
        Command::Layout(args) => layout::run(&args, session),
        Command::Schema(args) => schema::run(&args, session),
        Command::Settings(args) => settings::run(&args, session),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::Silent;

    fn called(words: &[&str]) -> Called {
        let words: Vec<OsString> = words.iter().map(OsString::from).collect();
        call(&words, None, Arc::new(Mutex::new(Silent)))
    }

    #[test]
    fn a_called_command_returns_what_it_would_print_and_says_what_it_would_say() {
        let layout = called(&["layout"]);
        assert!(layout.ended.is_ok());
        let told: serde_json::Value = serde_json::from_str(&layout.result.unwrap()).unwrap();
        assert!(told["files"].as_array().unwrap().len() > 50);

        let none = called(&["report", "no-such-folder"]);
        let failure = none.ended.unwrap_err();
        assert_eq!((failure.code(), none.result), (3, None));
        assert!(failure.message().contains("no-such-folder"), "{}", failure.message());

        let usage = called(&["simulate", "mesh.vtu"]).ended.unwrap_err();
        assert_eq!(usage.code(), 3);
        assert!(usage.message().contains("SCENARIO.toml"), "{}", usage.message());
    }
}

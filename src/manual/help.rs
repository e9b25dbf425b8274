//! The command line as help, man pages and completions show it: commands by task, options under headings, and what a script
//! needs to know besides (exit codes, variables of the environment).

use crate::material::meta_model::MetaModel;
use crate::workflow::known;
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, ArgAction, Command};

/// The commands by what one wants to do; one that stands in no list comes last, under [`OTHERS`].
const TASKS: [(&str, &[&str]); 6] = [
    (
        "A patient, from scans to page",
        &["run", "demo", "prep", "sweep", "reduce", "estimate", "compare", "predict", "report"],
    ),
    ("Many patients", &["bids", "population"]),
    ("Carry to the other scan, and check", &["warp", "evaluate"]),
    ("One step alone", &["register", "segment", "mesh", "simulate", "live"]),
    ("Materials and validation", &["gp", "law", "phantom", "synth"]),
    ("The program itself", &["doctor", "settings", "why", "layout", "schema", "completions", "man", "help"]),
];
const OTHERS: &str = "More";

/// Heading of the options that every command has.
pub const COMMON: &str = "Common";

/// Where common options begin: behind all that a command has itself.
const COMMON_ORDER: usize = 900;

/// Columns of the list of commands.
const WIDTH: usize = 100;

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  failed: the computation broke down, a file could not be written, or another job holds the folder
  2  usage: the command line cannot be understood
  3  input rejected: the message names file, field and remedy; no result was written, nothing is half-written
  4  computed (outputs kept), but not to be believed: no operation is seen, the scans do not show one person, the
     second scan cuts the cavity, masks given are not of this brain, a boundary set is implausible, tissue is cut
     off, or ventricles are lost
  128 + N  ended by signal N; the same command goes on where it was";

/// The whole command line, as it is parsed and shown.
pub fn command(command: Command) -> Command {
    let after =
        format!("{EXIT_CODES}\n\n{}\n\n{}", environment(), "`hgm COMMAND --help` shows all options with an example.");
    let commands = by_task(&command);
    let mut place = COMMON_ORDER;
    let command = command.mut_args(|arg| {
        place += 1;
        if arg.is_global_set() { arg.help_heading(COMMON).display_order(place) } else { arg }
    });
    let command = command.mut_subcommands(|sub| told_of_codes(sub, &after)).disable_help_flag(true).arg(help());
    let version = Arg::new("version").short('V').long("version").action(ArgAction::Version).help("Print the version");
    let command = command.disable_version_flag(true).arg(version.help_heading(COMMON).display_order(COMMON_ORDER + 98));
    command
        .help_template(format!(
            "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{commands}{COMMON}:\n{{options}}\n\n{{after-help}}"
        ))
        .after_help(after)
}

/// The variables that hgm reads.
fn environment() -> String {
    let mut text = String::from(
        "Environment:\n  NO_COLOR  no colours on a terminal\n  PATH      where optional programs are looked for",
    );
    for (name, variable) in known().filter_map(|known| Some((known.name, known.variable?))) {
        text += &format!("\n  {variable}  the program {name}, wherever it lies");
    }
    text
}

/// A subcommand with exit codes and variables at the end of its long help and its man page, and so on downwards.
fn told_of_codes(command: Command, after: &str) -> Command {
    let command = command.mut_subcommands(|sub| told_of_codes(sub, after));
    command.after_long_help(after.to_owned()).disable_help_flag(true).arg(help())
}

/// The option that asks for this text.
fn help() -> Arg {
    let arg = Arg::new("help").short('h').long("help").action(ArgAction::Help).help("Print help (-h: a summary)");
    arg.help_heading(COMMON).display_order(COMMON_ORDER + 99)
}

/// The commands by task, in the order of the lists; what stands in none comes last.
pub fn by_tasks(command: &Command) -> Vec<(&'static str, Vec<String>)> {
    let listed = |name: &str| TASKS.iter().any(|(_, names)| names.contains(&name));
    let rest = command.get_subcommands().map(Command::get_name).filter(|name| !listed(name)).map(str::to_owned);
    let mut all: Vec<_> =
        TASKS.iter().map(|(task, names)| (*task, names.iter().map(|name| (*name).to_owned()).collect())).collect();
    all.push((OTHERS, rest.collect::<Vec<_>>()));
    all
}

/// The list of commands, each with its one line.
fn by_task(command: &Command) -> String {
    let mut text = String::new();
    for (heading, names) in by_tasks(command) {
        let lines: String = names.iter().filter_map(|name| line(command, name)).collect();
        if !lines.is_empty() {
            text += &format!("{heading}:\n{lines}\n");
        }
    }
    text
}

fn line(command: &Command, name: &str) -> Option<String> {
    let about = match name {
        "help" => "Print the help of a command".to_owned(),
        _ => command.find_subcommand(name)?.get_about()?.to_string(),
    };
    let indent = 14;
    let mut text = format!("  {name:<12}");
    let mut column = indent;
    for (n, word) in about.split_whitespace().enumerate() {
        if column + word.chars().count() + 1 > WIDTH {
            text += &format!("\n{:indent$}", "");
            column = indent;
        } else if n > 0 {
            text.push(' ');
            column += 1;
        }
        text += word;
        column += word.chars().count();
    }
    Some(text + "\n")
}

/// The commands that an unknown one may mean; none where something else was wrong with the words.
pub fn meant_by(command: &Command, error: &clap::Error) -> Vec<String> {
    match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(word)) => meant_below(command, word),
        _ => Vec::new(),
    }
}

/// Where a mistyped command is the name of a command below another one: `fit` for `gp fit` and `law fit`.
pub fn meant_below(command: &Command, word: &str) -> Vec<String> {
    let below = |holder: &Command| {
        let names = holder.get_subcommands().filter(|sub| sub.get_name() == word);
        names.map(|sub| format!("hgm {} {}", holder.get_name(), sub.get_name())).collect::<Vec<_>>()
    };
    command.get_subcommands().flat_map(below).collect()
}

/// A help text with the names of the laws that can be fitted in place of `{}`.
pub fn laws(help: &str) -> String {
    let names = MetaModel::names();
    let (last, others) = names.split_last().map_or(("", &[][..]), |(last, others)| (*last, others));
    help.replace("{}", &format!("{} or {last}", others.join(", ")))
}

/// What is wrong with words that are no command, in one line.
pub fn in_one_line(error: &clap::Error) -> String {
    let said = error.to_string();
    let said = said.split("\n\n").next().unwrap_or_default().trim_start_matches("error: ");
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

//! The reference pages of the documentation: every command, every setting, every file of a case.

use super::help::by_tasks;
use crate::layout::TABLE;
use crate::workflow::{Setting, Settings, every_setting};
use clap::{Arg, ArgAction, Command};

/// Above each page: whoever edits it by hand would lose what was edited.
const MADE: &str = "<!-- Written by `hgm man --form markdown -o docs/reference` (./run reference): not by hand. -->\n";

/// The pages with their names.
pub fn pages(hgm: Command) -> Vec<(String, Vec<u8>)> {
    let pages = [("commands.md", commands(hgm)), ("settings.md", settings()), ("files.md", files())];
    pages.map(|(name, text)| (name.to_owned(), text.into_bytes())).into()
}

fn commands(mut hgm: Command) -> String {
    // Usage lines need what parents hand down.
    hgm.build();
    let mut text = format!("{MADE}# Commands\nWhat `hgm COMMAND --help` says, on one page.\n\n");
    for (task, names) in by_tasks(&hgm) {
        let mut listed = String::new();
        let mut told = String::new();
        for command in names.iter().filter(|name| *name != "help").filter_map(|name| hgm.find_subcommand(name)) {
            let name = format!("hgm {}", command.get_name());
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            listed += &format!("- [`{name}`](#{}): {}\n", name.replace(' ', "-"), escaped(&about));
            told += &page_of(command, &name, 3);
        }
        if !listed.is_empty() {
            text += &format!("## {task}\n{listed}\n{told}");
        }
    }
    let common: String = hgm.get_arguments().filter(|arg| listed_here(arg)).map(option).collect();
    text += &format!("## Options of every command\n{common}\n");
    let after = hgm.get_after_help().map(ToString::to_string).unwrap_or_default();
    let after = after.rsplit_once("\n\n").map_or(after.as_str(), |(facts, _)| facts);
    text + &format!("## Exit codes and environment\n```text\n{after}\n```\n")
}

/// A command, then the commands below it.
fn page_of(command: &Command, name: &str, level: usize) -> String {
    let (about, examples) = told(command);
    let mut text = format!("{} {name}\n{about}\n\n", "#".repeat(level));
    if !examples.is_empty() {
        text += &format!("```console\n$ {}\n```\n\n", examples.join("\n$ "));
    }
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").trim();
    text += &format!("Usage: `{}`\n\n", usage.split_whitespace().collect::<Vec<_>>().join(" "));
    let own = || command.get_arguments().filter(|arg| !arg.is_global_set() && listed_here(arg));
    let mut headings: Vec<Option<&str>> = Vec::new();
    for arg in own() {
        if !headings.contains(&arg.get_help_heading()) {
            headings.push(arg.get_help_heading());
        }
    }
    // What stands under no heading first.
    headings.sort_by_key(Option::is_some);
    for heading in headings {
        let lines: String = own().filter(|arg| arg.get_help_heading() == heading).map(option).collect();
        text += &heading.map(|heading| format!("*{heading}*\n\n")).unwrap_or_default();
        text += &format!("{lines}\n");
    }
    let below = command.get_subcommands().filter(|sub| sub.get_name() != "help");
    text + &below.map(|sub| page_of(sub, &format!("{name} {}", sub.get_name()), level + 1)).collect::<String>()
}

/// What a command does, and its examples.
fn told(command: &Command) -> (String, Vec<String>) {
    let long = command.get_long_about().or(command.get_about()).map(ToString::to_string).unwrap_or_default();
    let (about, examples) = long.split_once("Example: ").unwrap_or((&long, ""));
    let examples = examples.split("Example: ").map(str::trim).filter(|line| !line.is_empty());
    (escaped(about.trim()), examples.map(str::to_owned).collect())
}

fn listed_here(arg: &Arg) -> bool {
    !arg.is_hide_set() && arg.get_id() != "help" && arg.get_id() != "version"
}

/// One option or argument as an entry of a list.
fn option(arg: &Arg) -> String {
    let mut names: Vec<String> = arg.get_short().map(|short| format!("-{short}")).into_iter().collect();
    names.extend(arg.get_long_and_visible_aliases().into_iter().flatten().map(|long| format!("--{long}")));
    let values = arg.get_value_names().unwrap_or_default().iter().map(|name| format!("<{name}>"));
    let values = if takes_value(arg) { values.collect::<Vec<_>>().join(" ") } else { String::new() };
    let name = [names.join(", "), values].join(" ");
    let mut text = format!("- `{}`", name.trim());
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    text += &format!(": {}", escaped(&help));
    let words: Vec<_> = arg.get_possible_values().iter().map(|word| format!("`{}`", word.get_name())).collect();
    let end = if help.ends_with(['.', ']']) { "" } else { "." };
    if takes_value(arg) && !words.is_empty() {
        text += &format!("{end} One of: {}", words.join(", "));
    }
    let defaults: Vec<_> = arg.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
    if takes_value(arg) && !defaults.is_empty() {
        let end = if words.is_empty() { end } else { "." };
        text += &format!("{end} Default: `{}`", defaults.join(" "));
    }
    text + "\n"
}

fn takes_value(arg: &Arg) -> bool {
    matches!(arg.get_action(), ArgAction::Set | ArgAction::Append)
}

/// A text without anything that Markdown would take for its own; what stands between backticks is left as it is.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    let mut literal = false;
    for character in text.chars() {
        literal ^= character == '`';
        match character {
            '*' | '_' | '[' | ']' | '\\' | '|' if !literal => out.extend(['\\', character]),
            '<' if !literal => out += "&lt;",
            _ => out.push(character),
        }
    }
    out
}

fn settings() -> String {
    let mut text = format!("{MADE}# Settings\n{SETTINGS}");
    let all = every_setting(&Settings::default());
    let mut table = None;
    for setting in &all {
        if table != Some(&setting.table) {
            let heading = if setting.table.is_empty() { "At the top" } else { setting.table.as_str() };
            text += &format!("\n## {heading}\n");
            table = Some(&setting.table);
        }
        text += &entry(setting);
    }
    text
}

const SETTINGS: &str = "\
What `hgm settings` prints: every table and key of a settings file (`--config FILE.toml`) with its default, unit and what it is. The command
line beats the file, the file beats the default. `hgm settings --used CASE` shows the settings of a case; `settings.toml` in the case folder keeps them.
";

fn entry(setting: &Setting) -> String {
    let default = setting.default.as_ref().and_then(|value| toml::Value::try_from(value).ok());
    let value = default.map_or_else(|| "not set".to_owned(), |value| format!("`{value}`"));
    let unit = setting.unit.map(|unit| format!(" {unit}")).unwrap_or_default();
    format!("- `{}` = {value}{unit}: {}\n", setting.name, escaped(&setting.description))
}

fn files() -> String {
    let mut text = format!(
        "{MADE}# Files of a case\n{FILES}\n| file | what | frame | stage | name in BIDS derivatives |\n|---|---|---|---|---|\n"
    );
    for file in TABLE {
        let word = |value: serde_json::Result<serde_json::Value>| {
            value.ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
        };
        let bids = file.bids.map(|bids| format!("`{}`", bids.spelt())).unwrap_or_default();
        let (space, maker) = (word(serde_json::to_value(file.space)), word(serde_json::to_value(file.maker)));
        text += &format!("| `{}` | {} | {space} | {maker} | {bids} |\n", file.path, escaped(file.what));
    }
    text
}

const FILES: &str = "\
What `hgm layout` prints: every file that a case folder may hold. Words in braces stand for members of a family (`{sample}`: `sample-00` and on).
Lengths are mm, RAS+; `mni` is the template's frame reached rigidly: sizes stay the patient's.
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_a_help_text_is_text() {
        assert_eq!(escaped("sub-*/a_b [default: `x_y*`] <N>"), "sub-\\*/a\\_b \\[default: `x_y*`\\] &lt;N>");
    }
}

//! Every command that a document shows is one that this program takes: parsed to the end, required and conflicting options
//! included, not run.

use crate::docs::documents;
use clap::FromArgMatches;
use clap::error::ErrorKind;
use hgm::cli::{Hgm, command_line};

/// The command lines in a document's blocks of commands that call hgm, as words.
fn commands(text: &str) -> Vec<Vec<String>> {
    let mut all = Vec::new();
    let mut inside = false;
    let mut line = String::new();
    for part in text.lines() {
        if let Some(fence) = part.trim_start().strip_prefix("```") {
            inside = !inside && matches!(fence.trim(), "console" | "sh" | "bash");
            continue;
        }
        if !inside {
            continue;
        }
        line += part.trim_end().trim_end_matches('\\');
        if part.trim_end().ends_with('\\') {
            continue;
        }
        let told = line.split(" #").next().unwrap_or_default().trim_start_matches("$ ").to_owned();
        line.clear();
        for command in told.split("&&").flat_map(|command| command.split(" | ")) {
            let words: Vec<String> =
                command.split_whitespace().take_while(|word| *word != ">").map(str::to_owned).collect();
            if words.first().is_some_and(|first| first == "hgm" || first.ends_with("/hgm")) {
                all.push(words);
            }
        }
    }
    all
}

fn taken(words: &[String]) -> Result<(), clap::Error> {
    let parsed =
        command_line().try_get_matches_from(words).and_then(|mut matches| Hgm::from_arg_matches_mut(&mut matches));
    match parsed {
        Err(error) if !matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => Err(error),
        _ => Ok(()),
    }
}

#[test]
fn every_command_that_a_document_shows_is_taken_as_it_stands() {
    let mut seen = 0;
    for (document, text) in documents() {
        for words in commands(&text) {
            seen += 1;
            if let Err(error) = taken(&words) {
                panic!("{}: `{}`: {error}", document.display(), words.join(" "));
            }
        }
    }
    assert!(seen > 80, "only {seen} commands were found");
}

#[test]
fn every_command_named_within_a_sentence_exists() {
    let hgm = command_line();
    for (document, text) in documents() {
        for span in text.split('`').filter_map(|span| span.strip_prefix("hgm ")) {
            let word = span.split_whitespace().next().unwrap_or_default();
            // `hgm COMMAND`: any of them.
            let any = word.starts_with('-') || word.chars().all(char::is_uppercase);
            let known = any || word == "help" || hgm.find_subcommand(word).is_some();
            assert!(known, "{}: there is no `hgm {word}`", document.display());
        }
    }
}

#[test]
fn a_wrong_command_in_a_document_is_seen() {
    let text = "```console\n$ hgm run pre.nii \\\n  -o case  # one scan\n$ hgm doctor | head && hgm settigns > x\n```\nhgm nonsense\n";
    let found = commands(text);
    let words: Vec<String> = found.iter().map(|words| words.join(" ")).collect();
    assert_eq!(words, ["hgm run pre.nii -o case", "hgm doctor", "hgm settigns"]);
    assert!(taken(&found[0]).is_err() && taken(&found[1]).is_ok() && taken(&found[2]).is_err());
}

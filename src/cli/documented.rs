//! Every command that a document shows is one that this program takes: parsed to the end, required and conflicting options
//! included, not run.

use super::{Hgm, manual};
use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches};
use std::path::{Path, PathBuf};

/// The documents: README and its like, and all pages of the site.
fn documents() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found: Vec<PathBuf> = ["README.md", "CONTRIBUTING.md"].map(|name| root.join(name)).into();
    let mut folders = vec![root.join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                found.push(path);
            }
        }
    }
    found
}

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
    let parsed = manual::command(Hgm::command())
        .try_get_matches_from(words)
        .and_then(|mut matches| Hgm::from_arg_matches_mut(&mut matches));
    match parsed {
        Err(error) if !matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => Err(error),
        _ => Ok(()),
    }
}

#[test]
fn every_command_that_a_document_shows_is_taken_as_it_stands() {
    let mut seen = 0;
    for document in documents() {
        for words in commands(&std::fs::read_to_string(&document).unwrap()) {
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
    let hgm = manual::command(Hgm::command());
    for document in documents() {
        let text = std::fs::read_to_string(&document).unwrap();
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

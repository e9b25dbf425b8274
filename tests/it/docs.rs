//! The documents say what is: reference pages as the program writes them, commands that run, paths that exist, notebooks that
//! print what they show. (That every command parses is held by `tests/it/documented.rs`.)

use crate::job::{contents, output, program, sample};
use crate::made::{copy, finished_pair};
use crate::python::python_file;
use std::path::{Path, PathBuf};
use std::process::Command;

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every document with its text, those that the program writes among them.
pub fn documents() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root().join("docs")];
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
    found.extend(["README.md", "CONTRIBUTING.md"].map(|name| root().join(name)));
    found.sort();
    found.into_iter().map(|path| (path.clone(), std::fs::read_to_string(path).unwrap())).collect()
}

/// What stands behind `$ ` in the blocks of commands.
fn commands(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        if let Some(fence) = line.strip_prefix("```") {
            inside = !inside && fence == "console";
        } else if let Some(command) = line.strip_prefix("$ ").filter(|_| inside) {
            all.push(command.to_owned());
        }
    }
    all
}

#[test]
fn the_reference_and_the_descriptor_are_what_the_program_writes() {
    let folder = tempfile::tempdir().unwrap();
    for (form, place) in [("markdown", "docs/reference"), ("boutiques", "packaging")] {
        let out = folder.path().join(form);
        let ended = output(&["man", "--form", form, "-o", out.to_str().unwrap()]);
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let written = contents(&out);
        assert!(!written.is_empty());
        for (name, bytes) in written {
            let committed = std::fs::read(root().join(place).join(&name)).unwrap_or_default();
            assert!(committed == bytes, "{place}/{name} is out of date: `./run reference` writes it anew");
        }
    }
}

/// Commands that cost next to nothing and need no scan.
const CHEAP_ONES: [&str; 7] = ["doctor", "settings", "layout", "schema", "completions", "man", "gp studies"];

fn runs(folder: &Path, command: &str) {
    let line = command.replacen("hgm", &program().display().to_string(), 1);
    let ended = Command::new("sh").args(["-c", &line]).current_dir(folder).env("HOME", folder).output().unwrap();
    assert!(ended.status.success(), "`{command}`: {}", String::from_utf8_lossy(&ended.stderr));
}

#[test]
fn cheap_commands_of_the_documents_run_as_they_stand() {
    let folder = tempfile::tempdir().unwrap();
    let mut ran = 0;
    for (_, text) in documents() {
        let cheap = |command: &String| {
            let words = command.strip_prefix("hgm ").unwrap_or_default();
            CHEAP_ONES.iter().any(|cheap| words.starts_with(cheap)) && !words.contains("case")
        };
        for command in commands(&text).into_iter().filter(cheap) {
            // Where a shell keeps its completions.
            std::fs::create_dir_all(folder.path().join(".local/share/bash-completion/completions")).unwrap();
            runs(folder.path(), &command);
            ran += 1;
        }
    }
    assert!(ran > 10, "{ran} commands");
}

#[test]
fn slow_commands_on_a_finished_case_run_as_the_documents_show_them() {
    let folder = tempfile::tempdir().unwrap();
    copy(&finished_pair(), &folder.path().join("case"));
    let at = |name: &str| folder.path().join(name);
    std::fs::copy(finished_pair().join("settings.toml"), at("settings.toml")).unwrap();
    let points = "# Markups fiducial file version = 4.11\n# CoordinateSystem = RAS\n# columns = \
                  id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n1,20,-10,30,0,0,0,1,1,1,0,one,,\n";
    for name in ["pre.fcsv", "post.fcsv", "targets.fcsv"] {
        std::fs::write(at(name), points).unwrap();
    }
    for scan in ["pre.nii.gz", "post.nii.gz"] {
        std::fs::copy(sample(scan), at(scan)).unwrap();
    }
    let mut ran = 0;
    for (_, text) in documents() {
        let on_case = |command: &String| {
            let words = command.strip_prefix("hgm ").unwrap_or_default();
            let known = ["report case", "settings --used", "why case", "warp case targets", "evaluate case"];
            known.iter().any(|known| words.starts_with(known)) && !words.contains("case-")
        };
        for command in commands(&text).into_iter().filter(on_case) {
            runs(folder.path(), &command);
            ran += 1;
        }
    }
    assert!(ran >= 6, "{ran} commands");
}

#[test]
fn every_path_that_a_document_names_is_there() {
    let mut seen = 0;
    for (document, text) in documents() {
        for span in text.split('`').skip(1).step_by(2) {
            let ours = ["src/", "tests/", "docs/", "pipelines/", "packaging/", "engines/", "examples/", "sample-data/"];
            let placeholder =
                span.contains(['{', '*', ' ']) || ["NAME", "ROOM", "STATE"].iter().any(|w| span.contains(w));
            if ours.iter().any(|folder| span.starts_with(folder)) && !placeholder {
                seen += 1;
                assert!(root().join(span).exists(), "{}: there is no {span}", document.display());
            }
        }
    }
    assert!(seen > 100, "{seen} paths");
}

#[test]
fn other_programs_in_the_documents_are_known_and_are_given_files_that_exist() {
    const PROGRAMS: [&str; 9] =
        ["hgm", "./run", "pip", "snakemake", "docker", "apptainer", "bosh", "python3", "packaging/release.sh"];
    let usage = Command::new("bash").args(["run", "nonsense"]).current_dir(root()).output().unwrap();
    let usage = String::from_utf8_lossy(&usage.stderr).into_owned();
    for (document, text) in documents() {
        for command in commands(&text) {
            let words: Vec<&str> = command.split_whitespace().collect();
            assert!(PROGRAMS.contains(&words[0]), "{}: {command}", document.display());
            for word in &words {
                let ours =
                    ["packaging/", "pipelines/", "tests/", "docs/"].iter().any(|folder| word.starts_with(folder));
                assert!(!ours || root().join(word).exists(), "{}: {command}: no {word}", document.display());
            }
            if words[0] == "./run" {
                assert!(usage.split_whitespace().any(|known| known == words[1]), "{command}: not in {usage}");
            }
        }
    }
}

#[test]
fn slow_the_notebooks_print_what_they_show() {
    let folder = tempfile::tempdir().unwrap();
    let words = [program().display().to_string(), root().join("docs/notebooks").display().to_string()];
    let (code, said, complaint) =
        python_file(folder.path(), "tests/docs/run_notebooks.py", &words.each_ref().map(String::as_str));
    assert_eq!(code, 0, "{said}{complaint}");
    assert!(said.matches("as shown").count() >= 3, "{said}");
}

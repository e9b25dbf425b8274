//! The walls of the house: which room may import which.

use super::circles::code;
use std::collections::BTreeMap;
use std::path::Path;

/// room -> rooms it may import, in the order the data flows.
fn table() -> BTreeMap<&'static str, Vec<&'static str>> {
    let all = [
        "anatomy",
        "geometry",
        "artefact",
        "image",
        "register",
        "segment",
        "resect",
        "mesh",
        "tag",
        "material",
        "overlay",
        "fem",
        "experiment",
        "layout",
        "report",
        "workflow",
        "live",
        "manual",
    ];
    BTreeMap::from([
        ("anatomy", vec![]),
        ("geometry", vec![]),
        ("artefact", vec![]),
        ("image", vec!["geometry", "artefact"]),
        ("register", vec!["geometry", "image"]),
        ("segment", vec!["anatomy", "geometry", "image", "register"]),
        ("resect", vec!["geometry", "image", "register", "segment"]),
        ("mesh", vec!["geometry", "image", "segment", "artefact"]),
        ("tag", vec!["geometry", "image", "segment", "mesh"]),
        ("material", vec!["artefact"]),
        ("overlay", vec!["geometry", "mesh"]),
        ("fem", vec!["geometry", "mesh", "material"]),
        ("experiment", all[..12].to_vec()),
        ("layout", vec!["geometry"]),
        (
            "report",
            vec!["geometry", "artefact", "image", "register", "segment", "mesh", "material", "experiment", "layout"],
        ),
        ("workflow", all[..15].to_vec()),
        ("live", vec!["artefact", "mesh", "material", "fem", "experiment", "workflow"]),
        ("manual", vec!["material", "experiment", "layout", "report", "workflow"]),
        ("cli", all.to_vec()),
    ])
}

fn rust_files(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// The rooms that a file names through `crate::`; code for tests may look anywhere.
fn imported_rooms(text: &str) -> Vec<String> {
    let code = code(text);
    let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut rooms = Vec::new();
    for rest in code.split("crate::").skip(1) {
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut item = String::new();
            for c in group.chars() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => rooms.push(word(std::mem::take(&mut item).trim())),
                    _ => item.push(c),
                }
            }
            rooms.push(word(item.trim()));
        } else {
            rooms.push(word(rest));
        }
    }
    rooms
}

#[test]
fn every_import_is_in_the_table() {
    let table = table();
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut broken = Vec::new();
    for (room, allowed) in &table {
        let mut files = Vec::new();
        rust_files(&src.join(room), &mut files);
        assert!(!files.is_empty(), "room {room} has no file: redraw the table");
        for file in files {
            for import in imported_rooms(&std::fs::read_to_string(&file).unwrap()) {
                if table.contains_key(import.as_str()) && import != *room && !allowed.contains(&import.as_str()) {
                    broken.push(format!("{}: {room} may not import {import}", file.display()));
                }
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// What is more than words, a call and print belongs below: `cli` had grown to 5,000 lines before.
#[test]
fn the_command_line_stays_small() {
    let mut files = Vec::new();
    rust_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/cli"), &mut files);
    let lines: usize = files.iter().map(|file| std::fs::read_to_string(file).unwrap().lines().count()).sum();
    assert!(
        lines <= 2_800,
        "src/cli has {lines} lines, of at most 2,800: hand on what is not words of the command line"
    );
}

#[test]
fn a_forbidden_import_would_be_seen() {
    assert_eq!(
        imported_rooms("use crate::{mesh::TetMesh, fem::{solve, X}};\ncrate::cli::run()"),
        ["mesh", "fem", "cli"]
    );
    assert!(imported_rooms("// crate::cli\nlet x = 1;\n#[cfg(test)]\nmod t { use crate::cli; }").is_empty());
    assert_eq!(imported_rooms("#[cfg(test)]\nmod t { use crate::cli; }\nuse crate::fem::Model;"), ["fem"]);
}

//! `docs/evidence/ROOM.md`: what a room's benchmark measured, at which commit and on what machine. Comments in the source link
//! there instead of repeating figures that the next measurement makes false.

use crate::bar::Bar;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// What git says of the tree that is measured.
fn git(arguments: &[&str]) -> String {
    let ended = Command::new("git").args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    ended.map_or_else(|_| String::new(), |said| String::from_utf8_lossy(&said.stdout).trim().to_owned())
}

/// The commit, and whether files under version control differed from it.
fn commit() -> String {
    match (git(&["rev-parse", "--short=12", "HEAD"]), git(&["status", "--porcelain", "--untracked-files=no"])) {
        (id, _) if id.is_empty() => "a tree without git".to_owned(),
        (id, changes) if changes.is_empty() => format!("commit {id}"),
        (id, _) => format!("commit {id} with changes of its own"),
    }
}

fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name));
    format!("{cores} cores, {}", model.unwrap_or("processor not named"))
}

/// What a page of a benchmark begins with.
const WRITTEN: &str = "Written by `./run bench";

/// The page of a room.
fn page(room: &str, with_data: bool, bars: &[Bar]) -> String {
    let mut text = format!("# Evidence: {room}\n{WRITTEN} {room}` at {}; {}. ", commit(), machine());
    text += if with_data {
        "With the measuring data (`HGM_BENCH_DATA`).\n"
    } else {
        "Without the measuring data (`HGM_BENCH_DATA`): bars that need them are left out.\n"
    };
    text += "Times are of this machine, whatever else it was doing.\n\n| bar | asked | measured | met |\n|---|---|---|---|\n";
    let cell = |words: &str| words.replace('|', "\\|").replace('\n', " ");
    for Bar { name, bar, measured, met } in bars {
        let met = if *met { "yes" } else { "no" };
        writeln!(text, "| {} | {} | {} | {met} |", cell(name), cell(bar), cell(measured)).expect("a string takes text");
    }
    text
}

/// Writes the page of a room, unless there is one that was written by hand.
pub fn write(room: &str, with_data: bool, bars: &[Bar]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/evidence");
    std::fs::create_dir_all(&folder).expect("docs/ can be written");
    let path = folder.join(format!("{room}.md"));
    if std::fs::read_to_string(&path).is_ok_and(|text| !text.contains(WRITTEN)) {
        println!("docs/evidence/{room}.md was written by hand and stays as it is");
        return;
    }
    std::fs::write(path, page(room, with_data, bars)).expect("docs/evidence can be written");
    println!("written to docs/evidence/{room}.md");
}

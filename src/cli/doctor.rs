//! `hgm doctor`: what is installed, what is missing, the command that installs it.

use super::{Failure, Session};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Tell what is installed, what is missing and the command that installs it
///
/// Example: hgm doctor
#[derive(Debug, clap::Args)]
pub struct Args {}

/// One thing hgm can use but does not need.
#[derive(Debug, Serialize)]
struct Finding {
    what: &'static str,
    used_for: &'static str,
    found: bool,
    location: Option<String>,
    install: &'static str,
}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let table = [
        ("hgm-cgal-mesher", "mesh engine `cgal` (without it: `lattice`)", "./run engines"),
        ("gmsh", "mesh engine `gmsh`", "sudo apt-get install gmsh"),
        ("tetgen", "mesh engine `tetgen`", "sudo apt-get install tetgen"),
        ("python3", "renderer, cross-checks and cohorts in pipelines/", "sudo apt-get install python3 python3-venv"),
        ("snakemake", "cohorts", "pip install snakemake snakemake-executor-plugin-slurm"),
        ("chromium", "tests of the page", "sudo apt-get install chromium"),
    ];
    let findings: Vec<Finding> = table
        .into_iter()
        .map(|(what, used_for, install)| {
            let location = program(what).map(|path| path.display().to_string());
            Finding { what, used_for, found: location.is_some(), location, install }
        })
        .collect();
    let mut text = String::from("Needed: nothing beyond this program. Optional:\n");
    for f in &findings {
        let state = f.location.clone().unwrap_or_else(|| format!("missing; install: {}", f.install));
        writeln!(text, "  {:<18} {:<48} {state}", f.what, f.used_for)?;
    }
    session.emit(&findings, &text)
}

/// A program beside this one or on the PATH.
fn program(name: &str) -> Option<PathBuf> {
    let beside = std::env::current_exe().ok().and_then(|exe| exe.parent().map(Path::to_path_buf));
    let on_path = std::env::var_os("PATH").map(|path| std::env::split_paths(&path).collect::<Vec<_>>());
    beside.into_iter().chain(on_path.unwrap_or_default()).map(|folder| folder.join(name)).find(|path| path.is_file())
}

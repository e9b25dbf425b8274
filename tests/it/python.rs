//! Other people's readers: runs a Python script in the environment of `pipelines/requirements-test.txt`.

use std::path::{Path, PathBuf};
use std::process::Command;

/// `HGM_PYTHON`, else `.venv/bin/python` in the project root.
fn interpreter() -> PathBuf {
    std::env::var_os("HGM_PYTHON")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python"), PathBuf::from)
}

/// Runs `script` with `folder` as its working directory and returns what it printed; panics with its error output.
pub fn python(folder: &Path, script: &str) -> String {
    run(folder, &["-c", script])
}

/// Runs Python with these arguments; see [`python`].
pub fn run(folder: &Path, arguments: &[&str]) -> String {
    let interpreter = interpreter();
    let output = Command::new(&interpreter)
        .args(arguments)
        .current_dir(folder)
        .env("PYVISTA_OFF_SCREEN", "true")
        .env("OMP_NUM_THREADS", "1")
        .output()
        .unwrap_or_else(|e| panic!("{}: {e}; `./run test` provides it", interpreter.display()));
    assert!(output.status.success(), "python failed:\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

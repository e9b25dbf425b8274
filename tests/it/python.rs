//! Other people's readers: runs a Python script in the environment of `pipelines/requirements-test.txt`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// `HGM_PYTHON`, else `.venv/bin/python` in the project root.
fn interpreter() -> PathBuf {
    std::env::var_os("HGM_PYTHON")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python"), PathBuf::from)
}

/// Runs `script` with `folder` as its working directory and returns what it printed; panics with its error output.
pub fn python(folder: &Path, script: &str) -> String {
    let output = run(folder, &["-c", script]);
    assert!(output.status.success(), "python failed:\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs a program of `pipelines/` in `folder`: its exit code, what it printed, what it said on standard error.
pub fn pipeline(folder: &Path, program: &str, arguments: &[&str]) -> (i32, String, String) {
    python_file(folder, &format!("pipelines/{program}"), arguments)
}

/// The same for any Python file of the project.
pub fn python_file(folder: &Path, file: &str, arguments: &[&str]) -> (i32, String, String) {
    let program = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let output = run(folder, &[&[program.to_str().unwrap()], arguments].concat());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// A program that is installed beside the interpreter.
pub fn tool_path(program: &str) -> PathBuf {
    interpreter().with_file_name(program)
}

/// Runs such a program and returns what it printed, however it ended.
pub fn tool(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let path = tool_path(program);
    let output = Command::new(&path).args(arguments).current_dir(folder).output();
    let output = output.unwrap_or_else(|e| panic!("{}: {e}; `./run test` provides it", path.display()));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let interpreter = interpreter();
    Command::new(&interpreter)
        .args(arguments)
        .current_dir(folder)
        .env("PYVISTA_OFF_SCREEN", "true")
        .env("OMP_NUM_THREADS", "1")
        .output()
        .unwrap_or_else(|e| panic!("{}: {e}; `./run test` provides it", interpreter.display()))
}

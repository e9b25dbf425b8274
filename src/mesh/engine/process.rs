//! Other people's programs with a time limit and a memory limit.

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use thiserror::Error;

/// What a program may use.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Wall clock in seconds.
    pub time_s: f64,
    /// Address space in megabytes.
    pub memory_mb: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { time_s: 300.0, memory_mb: 6000 }
    }
}

/// Why a program gave no answer.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ProcessError {
    #[error("it cannot be started ({0}); install it, or use the engine `lattice`")]
    Start(std::io::Error),
    #[error(
        "it was stopped after {time_s} s; raise `time_s` in the table [mesh.limits], ask for fewer cells, or use \
         the engine `lattice`"
    )]
    TimedOut { time_s: f64 },
    #[error(
        "it failed ({status}): {last_words}; use the engine `lattice`, or give it more memory (`memory_mb` in the table \
         [mesh.limits])"
    )]
    Failed { status: String, last_words: String },
    #[error("its answer is not a mesh; use the engine `lattice`")]
    Answer,
}

/// Everything a pipe gives; what arrived before a broken pipe is kept, the parser judges it.
fn drain(pipe: Option<impl Read>) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Some(mut pipe) = pipe {
        let _ = pipe.read_to_end(&mut bytes);
    }
    bytes
}

/// Runs `command` under `limits` with `input` on its stdin; returns its stdout.
pub(crate) fn run(command: &Command, input: Vec<u8>, limits: &Limits) -> Result<Vec<u8>, ProcessError> {
    // The settings' check has seen that this is a number of seconds.
    let deadline = Instant::now() + Duration::from_secs_f64(limits.time_s);
    let mut child = capped(command, limits.memory_mb)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(ProcessError::Start)?;
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    // One thread per pipe: none can block another. A program that stops reading has failed and says so by its status.
    let _ = std::thread::spawn(move || stdin.map(|mut pipe| pipe.write_all(&input)));
    let out = std::thread::spawn(move || drain(stdout));
    let err = std::thread::spawn(move || drain(stderr));
    let mut pause = Duration::from_millis(1);
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if Instant::now() < deadline => std::thread::sleep(pause),
            _ => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(ProcessError::TimedOut { time_s: limits.time_s });
            }
        }
        pause = (pause * 2).min(Duration::from_millis(20));
    };
    let (out, err) = (out.join().unwrap_or_default(), err.join().unwrap_or_default());
    if status.success() {
        return Ok(out);
    }
    if err.ends_with(format!("{TIMED_OUT}\n").as_bytes()) {
        return Err(ProcessError::TimedOut { time_s: limits.time_s });
    }
    let said = String::from_utf8_lossy(if err.is_empty() { &out } else { &err }).into_owned();
    let tail: Vec<&str> = said.lines().rev().filter(|l| !l.trim().is_empty()).take(3).collect();
    let last_words = tail.into_iter().rev().collect::<Vec<_>>().join(" | ");
    let last_words = if last_words.is_empty() { "without a word".to_owned() } else { last_words };
    Err(ProcessError::Failed { status: status.to_string(), last_words })
}

/// A script for the shell in a folder of its own, which goes when the script ends; the program is `$0`, and `run` in front of
/// it stops it in time, with its children, which killing the shell would not. A shell that is interrupted itself stops the
/// program and clears the folder, too: a patient's surface lies in it. For that it waits for the program beside it (a signal
/// is not seen while a program runs in front), so the program has no stdin.
pub(crate) fn scratch_command(program: &std::path::Path, script: &str, limits: &Limits) -> Command {
    let mut shell = Command::new("/bin/sh");
    // A little before the shell itself would be killed, so that it can clean up.
    let seconds = 0.95 * limits.time_s;
    shell.arg("-c").arg(format!(
        "p=; d=$(mktemp -d) || exit 1; trap 'rm -rf \"$d\"' EXIT; \
         trap '[ -z \"$p\" ] || {{ kill \"$p\"; wait \"$p\"; }} 2>/dev/null; exit 130' INT TERM HUP; cd \"$d\" || exit 1; \
         run() {{ timeout -k 1 {seconds:.3} \"$@\" & p=$!; wait \"$p\"; s=$?; p=; \
         [ $s = 124 ] && echo '{TIMED_OUT}' >&2; [ $s = 0 ] || exit $s; }}; {script}"
    ));
    shell.arg(program);
    shell
}

/// What a script says when its program was stopped.
const TIMED_OUT: &str = "hgm: stopped in time";

/// The command behind the shell's `ulimit -v`, where there is such a shell: the limit is the kernel's, not a hope.
fn capped(command: &Command, memory_mb: u64) -> Command {
    let mut shell = if cfg!(unix) {
        let mut shell = Command::new("/bin/sh");
        shell.args(["-c", &format!("ulimit -v {} && exec \"$0\" \"$@\"", memory_mb * 1024)]);
        shell.arg(command.get_program());
        shell
    } else {
        Command::new(command.get_program())
    };
    shell.args(command.get_args());
    if let Some(folder) = command.get_current_dir() {
        shell.current_dir(folder);
    }
    shell
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn sh(script: &str) -> Command {
        let mut command = Command::new("/bin/sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn input_reaches_the_program_and_its_answer_comes_back() {
        let input = vec![7u8; 1 << 20];
        assert_eq!(run(&Command::new("cat"), input.clone(), &Limits::default()).unwrap(), input);
    }

    #[test]
    fn a_program_that_hangs_is_stopped() {
        let limits = Limits { time_s: 0.2, ..Limits::default() };
        let started = Instant::now();
        assert!(matches!(run(&sh("exec sleep 30"), Vec::new(), &limits), Err(ProcessError::TimedOut { .. })));
        assert!(started.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_script_stops_its_program_in_time_and_leaves_nothing() {
        let limits = Limits { time_s: 0.3, ..Limits::default() };
        let started = Instant::now();
        let script = scratch_command(std::path::Path::new("/bin/sleep"), "run \"$0\" 30", &limits);
        assert!(matches!(run(&script, Vec::new(), &limits), Err(ProcessError::TimedOut { .. })));
        assert!(started.elapsed() < Duration::from_secs(10));
        let limits = Limits::default();
        let script = scratch_command(std::path::Path::new("/bin/cat"), "cat > a && run \"$0\" a && pwd", &limits);
        let said = String::from_utf8(run(&script, b"here ".to_vec(), &limits).unwrap()).unwrap();
        let folder = said.strip_prefix("here ").unwrap().trim();
        assert!(folder.starts_with('/') && !std::path::Path::new(folder).exists(), "{folder}");
    }

    #[test]
    fn a_script_that_is_interrupted_stops_its_program_and_leaves_nothing() {
        let place = tempfile::tempdir().unwrap();
        // The program writes where it is and which process it is, and then hangs.
        let told = place.path().join("told");
        let program = place.path().join("hangs");
        std::fs::write(
            &program,
            format!("echo $$ > {0}.part; pwd >> {0}.part; mv {0}.part {0}; exec sleep 60", told.display()),
        )
        .unwrap();
        let script = format!("run \"$0\" {}", program.display());
        let mut shell = scratch_command(std::path::Path::new("/bin/sh"), &script, &Limits::default()).spawn().unwrap();
        let until = Instant::now() + Duration::from_secs(20);
        let wait_for = |there: &dyn Fn() -> bool| {
            while !there() && Instant::now() < until {
                std::thread::sleep(Duration::from_millis(10));
            }
            there()
        };
        assert!(wait_for(&|| told.exists()));
        let said = std::fs::read_to_string(&told).unwrap();
        let (pid, folder) = said.trim().split_once('\n').unwrap();
        assert!(std::path::Path::new(folder).exists());
        // Whoever runs the tests may ignore the other signals (`nohup`, `&`), which a shell cannot trap then.
        let kill = |how: &str, pid: &str| sh(&format!("kill {how} {pid} 2>/dev/null")).status().unwrap().success();
        assert!(kill("-TERM", &shell.id().to_string()));
        assert_eq!(shell.wait().unwrap().code(), Some(130));
        assert!(!std::path::Path::new(folder).exists());
        assert!(wait_for(&|| !kill("-0", pid)));
    }

    #[test]
    fn a_program_that_wants_too_much_memory_fails_by_name() {
        let limits = Limits { memory_mb: 50, ..Limits::default() };
        // tail must hold what it may still have to print.
        let error = run(&sh("head -c 200000000 /dev/zero | tail -n 1 >&2"), Vec::new(), &limits).unwrap_err();
        assert!(matches!(&error, ProcessError::Failed { last_words, .. } if last_words.contains("memory")), "{error}");
    }

    #[test]
    fn last_words_and_missing_programs_are_reported() {
        let error = run(&sh("echo first; echo it broke >&2; exit 4"), Vec::new(), &Limits::default()).unwrap_err();
        assert!(error.to_string().contains("it broke"), "{error}");
        assert!(run(&Command::new("/no/such/program"), Vec::new(), &Limits::default()).is_err());
    }
}

//! Bar of a patient's run that is killed: at twenty random moments, and the rerun ends with the bytes of a quiet one.

use crate::bar::{Bar, contents, run_hgm, small_patient};
use hgm::material::random::CounterRng;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const KILLS: u64 = 20;

pub fn bars() -> Vec<Bar> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let [pre, post] = small_patient(folder.path());
    let arguments = |case: &str| ["run", "-q", &pre, &post, "--cells", "8000", "-o", case].map(str::to_owned);

    let begin = Instant::now();
    let quiet = at("quiet");
    assert!(run_hgm(&arguments(&quiet).each_ref().map(String::as_str)).ok, "an undisturbed run");
    let whole_s = begin.elapsed().as_secs_f64();
    let expected = contents(&folder.path().join("quiet"));

    let mut same = 0;
    for kill in 0..KILLS {
        let case = at(&format!("killed-{kill}"));
        let mut child = Command::new(env!("CARGO_BIN_EXE_hgm"))
            .args(arguments(&case))
            .stdout(Stdio::null())
            .spawn()
            .expect("the program is built with the benchmark");
        std::thread::sleep(Duration::from_secs_f64(whole_s * CounterRng::new(kill, 0).between(0, 0.0, 1.0)));
        // SIGKILL: nothing can be tidied up. A run that was faster this time has ended already.
        child.kill().ok();
        child.wait().ok();
        let ended = run_hgm(&arguments(&case).each_ref().map(String::as_str)).ok;
        same += usize::from(ended && contents(std::path::Path::new(&case)) == expected);
        std::fs::remove_dir_all(&case).ok();
    }
    vec![Bar::new(
        "kills at random moments of a run",
        "20 of 20 with the same bytes",
        format!("{same} of {KILLS} ({} files, {whole_s:.1} s undisturbed)", expected.len()),
        same == KILLS as usize,
    )]
}

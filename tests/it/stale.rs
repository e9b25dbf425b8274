//! No stale answer: whatever was done in a folder before, every printed number is that of a fresh folder, or the command
//! refuses.

use crate::job::{CHEAP, output, program, sample};
use crate::sequences::Bench;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn slow_random_commands_in_one_folder_print_the_numbers_of_a_fresh_one_or_refuse() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new(&program(), folder.path());
    let (mut right, mut refused) = (0, 0);
    for seed in 0..2 {
        let tally = bench.sequence(seed, 6);
        assert!(tally.wrong.is_empty(), "{:?}", tally.wrong);
        right += tally.right;
        refused += tally.refused;
    }
    assert!(right >= 3 && right + refused <= 12, "{right} right, {refused} refused");
}

#[test]
fn slow_other_scans_and_a_second_job_are_refused_in_a_folder_that_is_used_and_held() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let [pre, post, case] = [&pre, &post, &case].map(|path| path.to_str().unwrap());
    let prep = |pre: &str, post: &str| {
        [&["prep", "--no-mesh", "-q", pre, post, "-o", case], &CHEAP[..]]
            .concat()
            .iter()
            .map(|w| (*w).to_owned())
            .collect::<Vec<_>>()
    };
    let mut first = Command::new(program()).args(prep(pre, post)).stdout(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    while !std::path::Path::new(case).join(".lock").exists() {
        assert!(begin.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_millis(100));
    let run = |words: &[String]| {
        let result = output(&words.iter().map(String::as_str).collect::<Vec<_>>());
        (result.status.code(), String::from_utf8_lossy(&result.stderr).into_owned())
    };
    let (code, said) = run(&prep(pre, post));
    // Nothing is wrong with what was given: the same command may go on later.
    assert!(code == Some(1) && said.contains(&format!("process {}", first.id())), "{said}");
    // A job that is killed holds nothing.
    first.kill().unwrap();
    first.wait().unwrap();
    assert_eq!(run(&prep(pre, post)).0, Some(0));
    let (code, said) = run(&prep(post, pre));
    assert!(code == Some(3) && said.contains("another pre-operative scan") && said.contains("--force"), "{said}");
}

//! The whole job from the command line: exit codes, messages, resume, the same bytes.

use crate::made::{copy, finished_pair, finished_phantom, prepared_pair};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The optimised program where the test runner names one, else the one built with the tests.
pub fn program() -> PathBuf {
    std::env::var_os("HGM_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_hgm").into()).into()
}

fn hgm() -> Command {
    Command::new(program())
}

/// A file of the tests' own pair, smaller than the bundled one.
pub fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/pair").join(name)
}

pub fn output(arguments: &[&str]) -> Output {
    hgm().args(arguments).output().unwrap()
}

/// Settings that make a case cheap, for tests that are not about accuracy.
pub const CHEAP: [&str; 2] = ["--config", concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/cheap.toml")];

/// Every file below a folder by its relative name.
pub fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn start(case: &Path, threads: &str) -> Child {
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let mut command = hgm();
    command.args(["run", pre.to_str().unwrap(), post.to_str().unwrap(), "-o", case.to_str().unwrap()]);
    command.args(CHEAP).args(["--threads", threads]);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Kills the job as soon as this file is there.
fn kill_when_there(mut job: Child, file: &Path) {
    let begin = Instant::now();
    while !file.exists() {
        assert!(begin.elapsed() < Duration::from_secs(600), "{} never came", file.display());
        assert!(job.try_wait().unwrap().is_none(), "the job ended before {}", file.display());
        std::thread::sleep(Duration::from_millis(20));
    }
    job.kill().unwrap();
    job.wait().unwrap();
}

#[test]
fn slow_a_killed_job_goes_on_and_ends_with_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    // The page is headed by the folder's name.
    let (whole, broken) = (folder.path().join("whole/case"), folder.path().join("broken/case"));
    copy(&finished_pair(), &whole);
    kill_when_there(start(&broken, "1"), &broken.join("anat/pre_space-MNI_T1w.nii.gz"));
    kill_when_there(start(&broken, "1"), &broken.join("sim/sample-02.vtu"));
    let kept = std::fs::metadata(broken.join("mesh/rest.vtu")).unwrap().modified().unwrap();
    assert!(start(&broken, "1").wait().unwrap().success());
    let again = std::fs::metadata(broken.join("mesh/rest.vtu")).unwrap().modified().unwrap();
    assert_eq!(kept, again, "a finished stage is skipped");

    let (whole, broken) = (contents(&whole), contents(&broken));
    assert_eq!(whole.keys().collect::<Vec<_>>(), broken.keys().collect::<Vec<_>>());
    for (name, bytes) in &whole {
        assert!(!name.ends_with(".part"), "{name} was left half-written");
        assert!(*bytes == broken[name], "{name} differs");
    }
    let page = String::from_utf8(whole["report.html"].clone()).unwrap();
    assert!(page.len() < 10_000_000 && page.contains("not a medical device"));
    assert!(!page.contains(folder.path().to_str().unwrap()), "no path in the page");
    asks_why(&folder.path().join("whole/case"));
}

/// Nothing would run again with the same options; a changed setting, file and scan are each named, and what follows too.
fn asks_why(case: &Path) {
    let why = |rest: &[&str]| -> BTreeMap<String, Vec<String>> {
        let ended = output(&[&["why", case.to_str().unwrap(), "--json"], &CHEAP[..], rest].concat());
        let said: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
        let stages = said["stages"].as_array().unwrap().iter().filter(|stage| stage["would_run"] == true);
        let reasons = |stage: &serde_json::Value| {
            stage["reasons"].as_array().unwrap().iter().map(|r| r.as_str().unwrap().to_owned()).collect()
        };
        stages.map(|stage| (stage["stage"].as_str().unwrap().to_owned(), reasons(stage))).collect()
    };
    assert!(why(&[]).is_empty(), "{:?}", why(&[]));
    let finer = why(&["--cells", "4000"]);
    assert_eq!(finer["mesh"], ["setting `mesh.size.cells` changed from 3000 to 4000"]);
    assert!(finer["sim-sample-04"][0].contains("follows mesh") && !finer.contains_key("anat"));
    let turned = why(&["--head", "left"]);
    assert!(turned["sim-sample-04"][0].contains("gravity_m_per_s2") && !turned.contains_key("mesh"), "{turned:?}");
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let scans = |pre: &Path| why(&["--pre", pre.to_str().unwrap(), "--post", post.to_str().unwrap()]);
    assert!(scans(&pre).is_empty());
    assert_eq!(scans(&post)["registration"], ["input `pre` changed"]);
    std::fs::remove_file(case.join("sim/sample-03.vtu")).unwrap();
    assert_eq!(why(&[])["sim-sample-03"], ["output `sim/sample-03.vtu` is missing"]);
    assert_eq!(output(&["why", case.to_str().unwrap(), "meshes"]).status.code(), Some(3));
}

#[test]
fn slow_the_phantom_finds_the_sample_nearest_to_what_went_in() {
    let [_, printed] = finished_phantom();
    let outcome: serde_json::Value = serde_json::from_slice(&std::fs::read(printed).unwrap()).unwrap();
    let samples = outcome["samples"].as_array().unwrap();
    let rmse = |n: usize| samples[n]["rmse_mm"]["all"].as_f64().unwrap();
    let modulus = |n: usize| samples[n]["shear_modulus_pa"]["brain"].as_f64().unwrap();
    let nearest =
        (0..9).min_by(|&a, &b| (modulus(a) / 333.28).ln().abs().total_cmp(&(modulus(b) / 333.28).ln().abs())).unwrap();
    assert_eq!(outcome["best_sample"], samples[nearest]["id"]);
    assert!(rmse(nearest) < rmse(nearest - 1) && rmse(nearest) < rmse(nearest + 1));
    assert!(rmse(9) < 1e-4, "the reference's own modulus leaves {} mm", rmse(9));
}

#[test]
fn slow_shards_in_any_order_give_the_bytes_of_one_run_and_a_gap_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    copy(&finished_phantom()[0], &folder.path().join("phantom"));
    // A phantom is no patient: it has no masks to sweep against.
    assert_eq!(output(&["sweep", &path("phantom")]).status.code(), Some(3));
    for name in ["parts/case", "whole/case"] {
        prepared_pair(&folder.path().join(name));
    }
    assert!(output(&["sweep", &path("whole/case")]).status.success());
    for part in ["3/3", "1/3"] {
        assert!(output(&["sweep", &path("parts/case"), "--shard", part, "--threads", "1"]).status.success());
    }
    let gap = output(&["reduce", &path("parts/case")]);
    assert_eq!(gap.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&gap.stderr).contains("sample-01 is not done"));
    assert!(output(&["sweep", &path("parts/case"), "--shard", "2/3"]).status.success());
    assert!(output(&["reduce", &path("parts/case")]).status.success());
    assert!(contents(&folder.path().join("parts/case")) == contents(&folder.path().join("whole/case")));
    let estimate = output(&["estimate", &path("whole/case"), "--json"]);
    let estimate: serde_json::Value = serde_json::from_slice(&estimate.stdout).unwrap();
    let [low, high] = [0, 1].map(|n| estimate["posterior"]["interval_95"][0][n].as_f64().unwrap());
    assert!(0.0 < low && low < estimate["posterior"]["mode"][0].as_f64().unwrap() && high.is_finite());
}

#[test]
fn slow_the_estimate_finds_both_moduli_of_a_phantom() {
    let folder = tempfile::tempdir().unwrap();
    let phantom = folder.path().join("phantom").to_str().unwrap().to_owned();
    let settings = folder.path().join("settings.toml");
    std::fs::write(&settings, "[phantom]\nsd_levels = [0.0]\n").unwrap();
    let settings = settings.to_str().unwrap();
    let made =
        ["--config", settings, "phantom", "--tissues", "2", "-o", &phantom, "--mesher", "lattice", "--cells", "8000"];
    assert!(output(&made).status.success());
    assert_eq!(output(&["estimate", &phantom, "--tissues", "1"]).status.code(), Some(3));
    let result: serde_json::Value = serde_json::from_slice(&output(&["estimate", &phantom, "--json"]).stdout).unwrap();
    for (n, truth) in [1370.0, 990.0].into_iter().enumerate() {
        let found = result["posterior"]["mode"][n].as_f64().unwrap();
        assert!((found / truth - 1.0).abs() < 1e-3, "{found} for {truth}");
    }
}

#[test]
fn wrong_settings_and_options_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("settings.toml");
    std::fs::write(&config, "[phantom]\nforse = 3\n").unwrap();
    let out = folder.path().join("out");
    let result = output(&["--config", config.to_str().unwrap(), "phantom", "-o", out.to_str().unwrap()]);
    let message = String::from_utf8_lossy(&result.stderr).into_owned();
    assert_eq!(result.status.code(), Some(3), "{message}");
    assert!(message.contains("forse") && message.contains("[phantom]"), "{message}");
    assert_eq!(output(&["phantom", "--tissues", "3"]).status.code(), Some(2));
    assert_eq!(output(&["doctor", "--threads", "0"]).status.code(), Some(3));
}

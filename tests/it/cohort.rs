//! A cohort by one command, by Snakemake on this machine, and by Snakemake on a Slurm cluster of one node: the same files.

use crate::bids::{add_plan, data_set, few_draws};
use crate::cluster::{OneNodeSlurm, printed, snakemake, workflow};
use crate::job::{CHEAP, contents, output, program};
use crate::made::{prepared_pair, prepared_patient};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

/// Every file of the derivatives; the workflow's own marks are none.
fn products(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = contents(out);
    found.retain(|name, _| !name.starts_with(".cohort/"));
    found
}

fn assert_same(expected: &BTreeMap<String, Vec<u8>>, out: &Path) {
    let found = products(out);
    assert_eq!(expected.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>());
    let differ: Vec<&String> = expected.keys().filter(|name| expected[*name] != found[*name]).collect();
    assert!(differ.is_empty(), "{differ:?} differ");
}

#[test]
fn slow_a_cohort_has_the_same_files_by_one_command_by_snakemake_and_on_slurm_with_a_job_killed() {
    let folder = tempfile::tempdir().unwrap();
    let raw = data_set(folder.path());
    // A subject whose second scan is missing holds nobody up.
    std::fs::create_dir_all(raw.join("sub-00/ses-preop/anat")).unwrap();
    let settings = PathBuf::from(CHEAP[1]);
    let outs: [PathBuf; 3] = ["command", "local", "slurm"].map(|name| folder.path().join(name).join("out"));
    let bids = |level: &str| {
        let [config, raw, out] = [&settings, &raw, &outs[0]].map(|path| path.to_str().unwrap());
        output(&["--config", config, "bids", raw, out, level])
    };
    // The first subject goes on from `hgm prep` everywhere, the second comes from nothing where Snakemake starts the steps.
    for out in &outs {
        prepared_pair(&out.join("sub-01/hgm"));
    }
    prepared_patient(&outs[0].join("sub-02/hgm"));
    assert_eq!(bids("participant").status.code(), Some(3));
    assert!(bids("group").status.success());
    let expected = products(&outs[0]);
    assert!(expected.contains_key("group.json") && expected.contains_key("sub-02/hgm/sim/sample-08.vtu"));

    let said = |name: &str| std::fs::read_to_string(folder.path().join(name).join("snakemake.log")).unwrap();
    let start = |profile: &str, out: &Path| -> Child {
        snakemake(&program(), &folder.path().join(profile), profile, &raw, out, &settings)
    };
    assert!(start("local", &outs[1]).wait().unwrap().success(), "{}", said("local"));
    assert_same(&expected, &outs[1]);

    let _slurm = OneNodeSlurm::start(&folder.path().join("cluster"));
    let mut cluster = start("slurm", &outs[2]);
    let begin = Instant::now();
    // Half-way: the scans are registered, the masks are not made.
    while !outs[2].join("sub-02/hgm/.stages/registration.manifest.json").exists() {
        assert!(
            begin.elapsed() < Duration::from_secs(600) && cluster.try_wait().unwrap().is_none(),
            "{}",
            said("slurm")
        );
        std::thread::sleep(Duration::from_millis(50));
    }
    let jobs = printed("squeue", &["-h", "-t", "running", "-o", "%i %k"]);
    let job = jobs.lines().find(|line| line.contains("prep") && line.contains("sub-02"));
    let job = job.unwrap_or_else(|| panic!("no job prepares sub-02: {jobs}")).split(' ').next().unwrap();
    printed("scancel", &[job]);
    assert!(!outs[2].join("sub-02/hgm/.stages/anat.manifest.json").exists(), "it was killed too late to show anything");
    assert!(cluster.wait().unwrap().success(), "{}", said("slurm"));
    assert!(said("slurm").contains("Trying to restart job"), "{}", said("slurm"));
    assert_same(&expected, &outs[2]);
}

#[test]
fn slow_a_workflow_predicts_a_subject_before_its_pair_as_the_commands_do() {
    let folder = tempfile::tempdir().unwrap();
    let raw = data_set(folder.path());
    std::fs::remove_dir_all(raw.join("sub-02")).unwrap();
    add_plan(&raw);
    let settings = few_draws(folder.path());
    let outs: [PathBuf; 2] = ["command", "local"].map(|name| folder.path().join(name).join("out"));
    let bids = |rest: &[&str]| {
        let [config, raw, out] = [&settings, &raw, &outs[0]].map(|path| path.to_str().unwrap());
        let ended = output(&[&["--config", config, "bids", raw, out], rest].concat());
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    };
    bids(&["participant", "--predict"]);
    bids(&["participant"]);
    bids(&["group"]);
    let expected = products(&outs[0]);
    assert!(expected.contains_key("sub-01/hgm-plan/sim/evaluation.json") && expected.contains_key("group.json"));
    let place = folder.path().join("local");
    let mut ended = workflow(&program(), &place, "local", (&raw, &outs[1]), &settings, &["predict=true"]);
    let said = || std::fs::read_to_string(place.join("snakemake.log")).unwrap();
    assert!(ended.wait().unwrap().success(), "{}", said());
    assert_same(&expected, &outs[1]);
}

#[test]
fn slow_a_workflow_of_unusable_settings_begins_nothing_and_one_of_unusable_scans_is_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let (raw, out, place) = (folder.path().join("study"), folder.path().join("out"), folder.path().join("local"));
    for session in ["ses-preop", "ses-postop"] {
        let anat = raw.join("sub-01").join(session).join("anat");
        std::fs::create_dir_all(&anat).unwrap();
        for run in [1, 2] {
            std::fs::write(anat.join(format!("sub-01_{session}_run-{run}_T1w.nii.gz")), "no image").unwrap();
        }
    }
    let ended = |settings: &Path| {
        let more = ["entity=run-2", "shards=1"];
        let mut child = workflow(&program(), &place, "local", (&raw, &out), settings, &more);
        let well = child.wait().unwrap().success();
        (well, std::fs::read_to_string(place.join("snakemake.log")).unwrap())
    };
    let misspelt = folder.path().join("misspelt.toml");
    std::fs::write(&misspelt, "[resection]\ntissue = 1\n").unwrap();
    let (well, said) = ended(&misspelt);
    assert!(!well && said.contains("misspelt.toml") && said.contains("tissue"), "{said}");
    assert!(!out.join(".cohort/sub-01").exists(), "{said}");
    // Both calls come as far as the group, which has nobody.
    for _ in 0..2 {
        let (well, said) = ended(Path::new(CHEAP[1]));
        assert!(!well && said.contains("rule prep:") && said.contains("no subject has been run"), "{said}");
        assert!(out.join("logs/sub-01.json").exists() && !out.join(".cohort/group").exists());
        assert_eq!(std::fs::read_to_string(out.join(".cohort/sub-01/reported")).unwrap().trim(), "3");
    }
}

//! Pairs that no operation can be followed in: the scans' answer in exit code, JSON, outcome, page and picture.

use crate::job::{CHEAP, output, sample};
use crate::made::synthetic_patient;
use hgm::image::Volume;
use hgm::image::nifti::{ReadOptions, decode, encode_f32};
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

/// A head again from another receive coil: another gain, bias and noise, nothing taken out.
fn again(scan: &Path, copy: &Path) {
    let bytes = std::fs::read(scan).unwrap();
    let before = decode(&bytes, "scan.nii.gz", &ReadOptions::default()).unwrap().volume;
    let grid = before.grid;
    let after = Volume::from_fn(grid, |n| {
        let [i, _, k] = grid.voxel(n).map(|v| v as f32);
        let noise = ((n as u32).wrapping_mul(2_654_435_761) >> 16) as f32 / 65_536.0 - 0.5;
        (1.7 * before.data[n] * (1.0 + 0.004 * i - 0.003 * k) + 12.0 * noise).max(0.0)
    });
    std::fs::write(copy, encode_f32(&after)).unwrap();
}

fn answered(pre: &Path, post: &Path, answer: &str, sentence: &str) {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    let [pre, post, out] = [pre, post, &case].map(|path| path.to_str().unwrap());
    let ended = output(&[&["run", "--json", pre, post, "-o", out], &CHEAP[..]].concat());
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(4), "{said}");
    assert!(said.contains("refused.png") && said.contains("--cavity-mask"), "{said}");
    let printed: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(printed["error"]["answer"], answer);
    let text = |name: &str| std::fs::read_to_string(case.join(name)).unwrap();
    let outcome: serde_json::Value = serde_json::from_str(&text("sim/outcome.json")).unwrap();
    assert_eq!((&outcome["answer"], outcome["samples"].as_array().map(Vec::len)), (&answer.into(), Some(0)));
    assert!(text("report.html").contains(sentence), "the page says it");
    assert!(std::fs::read(case.join("refused.png")).unwrap().starts_with(b"\x89PNG"));
    assert!(!case.join("mesh/rest.vtu").exists());
}

#[test]
fn slow_one_head_twice_is_no_operation_and_claims_no_stiffness() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("again.nii.gz");
    let [pre, _] = synthetic_patient();
    again(&pre, &copy);
    answered(&pre, &copy, "no-operation", "No operation is seen");
}

#[test]
fn slow_two_heads_are_not_one_person() {
    let [pre, _] = synthetic_patient();
    answered(&pre, &sample("post.nii.gz"), "not-one-person", "do not show one person");
}

/// A patient of `hgm synth` with these options and settings, and how `hgm prep --no-mesh` of its scans ends; in the folder are
/// `patient` and `case`.
fn prepared(asked: &[&str], settings: &str) -> (TempDir, Output) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (patient, case, config) = (at("patient"), at("case"), at("settings.toml"));
    std::fs::write(&config, settings).unwrap();
    let made = output(&[&["synth", "--config", &config, "-o", &patient], asked].concat());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let ended = output(&["prep", "--no-mesh", &at("patient/pre.nii.gz"), &at("patient/post.nii.gz"), "-o", &case]);
    (folder, ended)
}

/// With this fault of the second scan: exit code, what is said, whether the cavity is kept.
fn prepared_with(fault: &str, lobe: &str, seed: &str) -> (Option<i32>, String, bool) {
    let asked = ["--lobe", lobe, "--seed", seed, "--spacing-mm", "2"];
    let (folder, ended) = prepared(&asked, &format!("[synth.post]\n{fault}\n"));
    let kept = folder.path().join("case/anat/post_space-MNI_label-cavity_mask.nii.gz").exists();
    (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned(), kept)
}

#[test]
fn slow_a_cavity_that_the_second_scan_cuts_is_kept_and_not_believed() {
    let (code, said, kept) = prepared_with("cut_mm = 45.0", "parietal", "13");
    assert!(code == Some(4) && kept, "{code:?} {said}");
    assert!(
        said.contains("the cavity's outside borders on brain that the post-operative scan does not show"),
        "{said}"
    );
}

#[test]
fn slow_one_head_in_two_weightings_is_not_called_two_people() {
    let (code, said, kept) = prepared_with("t2_like = true", "frontal", "14");
    assert!(code == Some(3) && !kept, "{code:?} {said}");
    assert!(said.contains("two weightings") && !said.contains("one person"), "{said}");
}

/// Dice of the cavity that `hgm prep` finds on a patient of `hgm synth` with these options.
fn cavity_found(asked: &[&str], settings: &str) -> f64 {
    let (folder, ended) = prepared(asked, settings);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let mask = |name: &str| {
        let bytes = std::fs::read(folder.path().join(name)).unwrap();
        let read = decode(&bytes, name, &ReadOptions::default()).unwrap().volume;
        read.data.iter().map(|&x| x > 0.5).collect::<Vec<_>>()
    };
    let found = mask("case/anat/post_space-native_label-cavity_mask.nii.gz");
    let truth = mask("patient/truth/cavity_post.nii.gz");
    let count = |m: &[bool]| m.iter().filter(|x| **x).count();
    let shared = found.iter().zip(&truth).filter(|(a, b)| **a && **b).count();
    2.0 * shared as f64 / (count(&found) + count(&truth)) as f64
}

#[test]
fn slow_the_cut_that_disconnects_a_hemisphere_is_the_cavity() {
    let dice = cavity_found(&["--lobe", "hemisphere", "--resection-cc", "38", "--seed", "15"], "");
    // A cut of four voxels that is half a voxel off has a Dice of .87.
    assert!(dice > 0.8, "{dice}");
}

#[test]
fn slow_slices_that_either_scan_lost_are_no_part_of_the_cavity() {
    for scan in ["pre", "post"] {
        let lost = format!("[synth.{scan}]\nmissing_slices = 4\n");
        let dice = cavity_found(&["--lobe", "temporal", "--seed", "12", "--spacing-mm", "2"], &lost);
        assert!(dice > 0.88, "{scan}: {dice}");
    }
}

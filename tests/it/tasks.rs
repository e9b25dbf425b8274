//! Samples of every task of the generative model on patients.

use crate::job::{CHEAP, contents, output, sample};
use crate::made::{finished_pair, prepared_pair};
use hgm::geometry::Pre;
use hgm::image::LabelMap;
use hgm::image::nifti::{ReadOptions, decode_labels, encode_u8};
use hgm::segment::label;
use nalgebra::Point3;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Output;

/// The cheap settings with two levels of every task.
fn two_levels(folder: &Path) -> PathBuf {
    let settings = std::fs::read_to_string(CHEAP[1]).unwrap();
    let file = folder.join("two-levels.toml");
    std::fs::write(&file, settings.replace("[resection]\n", "[resection]\nsd_levels = [-1.0, 1.0]\n")).unwrap();
    file
}

fn hgm(words: &[&str], settings: &Path) -> Output {
    output(&[words, &["--config", settings.to_str().unwrap()]].concat())
}

fn done(words: &[&str], settings: &Path) {
    let ended = hgm(words, settings);
    assert!(ended.status.success(), "{words:?}: {}", String::from_utf8_lossy(&ended.stderr));
}

fn outcome(case: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(case.join("sim/outcome.json")).unwrap()).unwrap()
}

/// How many samples of every task there are.
fn tasks(outcome: &Value) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for sample in outcome["samples"].as_array().unwrap() {
        *counts.entry(sample["task"].as_str().unwrap_or("none").to_owned()).or_default() += 1;
    }
    counts
}

#[test]
fn slow_a_patient_is_swept_over_every_task_in_parts_or_whole_and_over_one_again() {
    let folder = tempfile::tempdir().unwrap();
    let settings = two_levels(folder.path());
    let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name).join("case"));
    for case in [&whole, &parts] {
        prepared_pair(case);
    }
    let [whole_words, parts_words] = [&whole, &parts].map(|case| case.to_str().unwrap());
    let refused = hgm(&["sweep", whole_words, "--every-task", "--tissues", "2"], &settings);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(3) && said.contains("--tissues 1"), "{said}");

    done(&["sweep", "-q", whole_words, "--every-task"], &settings);
    let found = outcome(&whole);
    let counts = tasks(&found);
    assert_eq!((counts.len(), counts.values().all(|n| *n == 2)), (9, true), "{counts:?}");
    let page = std::fs::read_to_string(whole.join("report.html")).unwrap();
    for kind in ["Elastography", "Linear elasticity", "Hyperelastic tests"] {
        assert!(page.contains(kind), "{kind}");
    }
    for part in ["1/2", "2/2"] {
        done(&["sweep", "-q", parts_words, "--every-task", "--shard", part], &settings);
    }
    // What the parts were made with is the case's own by now.
    done(&["reduce", "-q", parts_words], &settings);
    let [one, other] = [&whole, &parts].map(|case| contents(case));
    let differ: Vec<&String> = one.keys().filter(|name| one.get(*name) != other.get(*name)).collect();
    assert!(differ.is_empty() && one.len() == other.len(), "{differ:?} differ");

    // The whole brain's own task is the one that a sweep of one task tries.
    let stiffness = |outcome: &Value, id: &str| {
        let of = |sample: &&Value| sample["id"] == id;
        outcome["samples"].as_array().unwrap().iter().find(of).unwrap()["shear_modulus_pa"]["brain"].as_f64().unwrap()
    };
    done(&["sweep", "-q", whole_words, "--study", "hyperelastic"], &settings);
    let again = outcome(&whole);
    assert_eq!(tasks(&again), BTreeMap::from([("none".to_owned(), 2)]));
    assert_eq!(stiffness(&again, "sample-01"), stiffness(&found, "hyperelastic-healthy-01"));
    assert!(!whole.join("sim/mre-grey-00.vtu").exists(), "samples that are asked for no more are taken away");
}

/// The labels that the program finds in the sample pair, with a tumour in a rim of oedema where white matter was.
fn with_a_tumour() -> LabelMap<Pre> {
    let bytes = std::fs::read(finished_pair().join("anat/pre_space-native_dseg.nii.gz")).unwrap();
    let (labels, _) = decode_labels(&bytes, "dseg.nii.gz", &ReadOptions::default()).unwrap();
    let mut labels: LabelMap<Pre> = labels.relabelled();
    let place = |n: usize| labels.grid.centre(labels.grid.voxel(n)).mm;
    let brain: Vec<usize> = (0..labels.data.len()).filter(|&n| labels.data[n] != label::BACKGROUND).collect();
    let middle = brain.iter().map(|&n| place(n).coords).sum::<nalgebra::Vector3<f64>>() / brain.len() as f64;
    let centre = Point3::from(middle + nalgebra::Vector3::new(25.0, 0.0, 15.0));
    let away: Vec<(usize, f64)> =
        brain.iter().map(|&n| (n, (place(n) - centre).norm())).filter(|a| a.1 < 17.0).collect();
    for (n, mm) in away {
        labels.data[n] = if mm < 11.0 { label::TUMOUR } else { label::OEDEMA };
    }
    labels
}

#[test]
fn slow_a_lesion_has_the_tasks_of_abnormal_tissue() {
    let folder = tempfile::tempdir().unwrap();
    let (settings, case) = (two_levels(folder.path()), folder.path().join("case"));
    let map = folder.path().join("labels.nii.gz");
    std::fs::write(&map, encode_u8(&with_a_tumour())).unwrap();
    let [pre, post] = ["pre.nii.gz", "post.nii.gz"].map(|scan| sample(scan).display().to_string());
    let [case_words, map] = [&case, &map].map(|path| path.to_str().unwrap());
    let words = ["run", "-q", &pre, &post, "-o", case_words, "--dseg", map, "--labels", "hgm", "--every-task"];
    done(&words, &settings);
    let found = outcome(&case);
    let counts = tasks(&found);
    assert_eq!((counts.len(), counts.values().all(|n| *n == 2)), (12, true), "{counts:?}");
    let of = |task: &str| -> Vec<&Value> {
        found["samples"].as_array().unwrap().iter().filter(|s| s["task"] == task).collect()
    };
    for kind in ["mre", "linear", "hyperelastic"] {
        let abnormal = of(&format!("{kind}-abnormal"));
        let moduli =
            |tissue: &str| abnormal.iter().map(|s| s["shear_modulus_pa"][tissue].as_f64().unwrap()).collect::<Vec<_>>();
        assert_eq!(moduli("tumour"), moduli("oedema"), "one tissue");
        assert!(moduli("tumour")[0] < moduli("tumour")[1] && moduli("brain")[0] == moduli("brain")[1]);
        // What is simulated differs, not the numbers alone.
        let moved: Vec<f64> = abnormal.iter().map(|s| s["rmse_mm"]["margin"].as_f64().unwrap()).collect();
        assert!(moved[0] != moved[1], "{kind}: {moved:?}");
    }
    let why = hgm(&["why", case_words, "--every-task", "--json"], &settings);
    let said: Value = serde_json::from_slice(&why.stdout).unwrap();
    let stages = said["stages"].as_array().unwrap_or_else(|| panic!("{said}"));
    let samples: Vec<&Value> = stages.iter().filter(|s| s["stage"].as_str().unwrap().contains("abnormal")).collect();
    assert_eq!(samples.len(), 6);
    assert!(stages.iter().all(|stage| stage["would_run"] == false), "{said:#}");
}

//! `hgm bids`: a data set in, valid derivatives and one table out.

use crate::job::{CHEAP, contents, output, sample};
use crate::made::{finished_pair, prepared_pair, prepared_patient, synthetic_patient};
use crate::python::tool;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A data set of two patients: the sample pair and a synthetic one.
pub fn data_set(folder: &Path) -> PathBuf {
    let raw = folder.join("study");
    for (subject, [pre, post]) in
        [("sub-01", ["pre.nii.gz", "post.nii.gz"].map(sample)), ("sub-02", synthetic_patient())]
    {
        for (session, scan) in [("ses-preop", pre), ("ses-postop", post)] {
            let anat = raw.join(subject).join(session).join("anat");
            std::fs::create_dir_all(&anat).unwrap();
            std::fs::copy(scan, anat.join(format!("{subject}_{session}_T1w.nii.gz"))).unwrap();
        }
    }
    std::fs::write(raw.join("dataset_description.json"), r#"{"Name": "two", "BIDSVersion": "1.10.0"}"#).unwrap();
    raw
}

/// The plan of the first subject in that data set: the tissue that was taken. The second has none.
pub fn add_plan(raw: &Path) {
    let anat = raw.join("derivatives/plans/sub-01/ses-preop/anat");
    std::fs::create_dir_all(&anat).unwrap();
    let plan = anat.join("sub-01_ses-preop_label-resection_mask.nii.gz");
    std::fs::copy(sample("truth/resected_pre.nii.gz"), plan).unwrap();
}

/// The cheap settings with few draws, in a file.
pub fn few_draws(folder: &Path) -> PathBuf {
    let file = folder.join("few.toml");
    std::fs::write(&file, text(Path::new(CHEAP[1])) + "\n[predict]\ndraws = 16\nchecks = 0\n").unwrap();
    file
}

#[test]
fn slow_a_subject_with_a_plan_is_predicted_and_its_pair_takes_that_up_and_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let raw = data_set(folder.path());
    add_plan(&raw);
    let out = raw.join("derivatives/hgm");
    let few = few_draws(folder.path());
    let bids = |rest: &[&str]| {
        output(&[&["bids", raw.to_str().unwrap(), out.to_str().unwrap(), "participant"], rest].concat())
    };
    let planned = bids(&["--predict", "--dry-run", "--json"]);
    let planned: Value = serde_json::from_slice(&planned.stdout).unwrap();
    let [one, other] = [0, 1].map(|n| &planned["subjects"][n]);
    assert!(one["plan"].as_str().unwrap().ends_with("sub-01_ses-preop_label-resection_mask.nii.gz"), "{planned}");
    assert!(one["case"].as_str().unwrap().ends_with("sub-01/hgm-plan") && one["post"].is_null());
    assert!(other["plan"].is_null() && other["message"].as_str().unwrap().contains("--plans"), "{planned}");

    let ended = bids(&["--predict", "--config", few.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(3), "{said}");
    assert!(said.contains("1 of 2 subjects did not end well: sub-02"), "{said}");
    let first = contents(&out);
    let anat = "sub-01/ses-preop/anat/sub-01_ses-preop_";
    for file in [
        "sub-01_plan.html".to_owned(),
        "logs/sub-02_plan.json".to_owned(),
        format!("{anat}from-T1w_to-deformed_desc-predicted_mode-points_xfm.nii.gz"),
        format!("{anat}space-MNI152NLin2009aSym_label-resection_mask.json"),
        "sub-01/hgm-plan/sim/prediction.json".to_owned(),
    ] {
        assert!(first.contains_key(&file), "{file}: {:?}", first.keys());
    }
    let said = tool(folder.path(), "bids-validator-deno", &["--format", "json", out.to_str().unwrap()]);
    let said: Value = serde_json::from_str(&said).unwrap();
    let issues = said["issues"]["issues"].as_array().unwrap();
    let errors: Vec<&Value> = issues.iter().filter(|issue| issue["severity"] == "error").collect();
    assert!(errors.is_empty(), "{errors:#?}");

    let ended = bids(&["-v", "--participant-label", "01", CHEAP[0], CHEAP[1]]);
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.success() && said.contains("are the prediction's"), "{said}");
    let (case, alone) = (contents(&out.join("sub-01/hgm")), contents(&finished_pair()));
    // Pages are headed by the folder's name.
    for (name, bytes) in alone.iter().filter(|(name, _)| *name != "report.html") {
        assert!(case.get(name) == Some(bytes), "{name} differs");
    }
    let held: Value = serde_json::from_str(&text(&out.join("sub-01/hgm-plan/sim/evaluation.json"))).unwrap();
    assert!(held["taken"]["dice"].as_f64().unwrap() > 0.5, "{held}");
    assert!(text(&out.join("sub-01_plan.html")).contains("Predicted against seen"));

    // Other settings: the pair goes without.
    let finer = folder.path().join("finer.toml");
    std::fs::write(&finer, text(Path::new(CHEAP[1])).replace("iterations = 10", "iterations = 11")).unwrap();
    let ended = bids(&["-v", "--participant-label", "01", "--config", finer.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.success() && said.contains("otherwise than this pair would"), "{said}");
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn slow_a_data_set_becomes_valid_derivatives_and_one_table_and_a_subject_without_a_scan_stops_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let raw = data_set(folder.path());
    std::fs::create_dir_all(raw.join("sub-00/ses-preop/anat")).unwrap();
    let out = raw.join("derivatives/hgm");
    let bids = |rest: &[&str]| output(&[&["bids", raw.to_str().unwrap(), out.to_str().unwrap()], rest].concat());

    assert_eq!(bids(&["group"]).status.code(), Some(3), "a group of nobody");
    let planned = bids(&["participant", "--dry-run", "--json"]);
    let planned: Value = serde_json::from_slice(&planned.stdout).unwrap();
    assert!(planned["subjects"][0]["message"].as_str().unwrap().contains("sub-00_ses-preop_T1w.nii.gz"));
    assert!(planned["subjects"][2]["pre"].as_str().unwrap().ends_with("sub-02_ses-preop_T1w.nii.gz"));

    let stopped = bids(&["participant", "--stop-on-first-crash"]);
    assert_eq!(stopped.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&stopped.stderr).contains("2 not begun"));
    // Both go on from `hgm prep`; the cohort's test takes a subject from nothing.
    prepared_pair(&out.join("sub-01/hgm"));
    prepared_patient(&out.join("sub-02/hgm"));
    let run = bids(&[&["participant"], &CHEAP[..]].concat());
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert_eq!(run.status.code(), Some(3), "{said}");
    assert!(said.contains("1 of 3 subjects did not end well: sub-00"), "{said}");
    let first = contents(&out);
    let table = bids(&["group"]);
    assert!(table.status.success(), "{}", String::from_utf8_lossy(&table.stderr));

    // What is there is not computed again, and comes out the same.
    let again = bids(&[&["participant", "--participant-label", "sub-01", "02"], &CHEAP[..]].concat());
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let second = contents(&out);
    assert!(first.iter().all(|(name, bytes)| second.get(name) == Some(bytes)));

    let group: Value = serde_json::from_str(&text(&out.join("group.json"))).unwrap();
    let subjects = group["subjects"].as_array().unwrap();
    assert_eq!((&subjects[0]["participant_id"], &subjects[0]["status"]), (&"sub-00".into(), &"failed".into()));
    let rest = |row: &Value| row["rest_rmse_margin_mm"].as_f64().unwrap();
    let [one, other] = [1, 2].map(|n| rest(&subjects[n]["figures"]));
    assert!((rest(&group["median"]) - f64::midpoint(one, other)).abs() < 1e-9);
    let page = text(&out.join("group.html"));
    assert!(page.contains("href=\"sub-01.html\"") && out.join("sub-01.html").exists());
    assert!(!page.contains("href=\"sub-00.html\"") && page.contains("sub-00: failed"));
    // Nine samples of one tissue, from the published prior: both subjects have the same.
    let medians = group["median_samples"].as_array().unwrap();
    let margins: Vec<f64> = (1..=2).map(|n| subjects[n]["figures"]["rmse_margin_mm"].as_f64().unwrap()).collect();
    let least = medians.iter().filter_map(|s| s["median_rmse_mm"]["margin"].as_f64()).fold(f64::MAX, f64::min);
    assert_eq!((medians.len(), &medians[0]["subjects"]), (9, &2.into()));
    assert!(least >= f64::midpoint(margins[0], margins[1]) - 1e-9, "no sample beats everybody's own best");
    // For the tests of pages in a browser, which come after these.
    if let Some(kept) = std::env::var_os("HGM_KEPT_GROUP_PAGE") {
        std::fs::write(kept, &page).unwrap();
    }

    let sidecar = out.join("sub-02/ses-postop/anat/sub-02_ses-postop_space-MNI152NLin2009aSym_label-cavity_mask.json");
    let sidecar: Value = serde_json::from_str(&text(&sidecar)).unwrap();
    assert_eq!(sidecar["Sources"][1], "bids:raw:sub-02/ses-postop/anat/sub-02_ses-postop_T1w.nii.gz");
    assert!(sidecar["Seed"].is_u64() && sidecar["Settings"]["anat"]["cavity"].is_object());
    for (name, bytes) in &second {
        let here = folder.path().to_str().unwrap().as_bytes();
        assert!(!bytes.windows(here.len()).any(|part| part == here), "{name} names a folder of this machine");
    }

    let said = tool(folder.path(), "bids-validator-deno", &["--format", "json", out.to_str().unwrap()]);
    let said: Value = serde_json::from_str(&said).unwrap();
    let issues = said["issues"]["issues"].as_array().unwrap();
    let errors: Vec<&Value> = issues.iter().filter(|issue| issue["severity"] == "error").collect();
    assert!(errors.is_empty(), "{errors:#?}");
    assert_eq!(said["summary"]["subjects"].as_array().unwrap().len(), 2, "the validator saw both");
    // The validator is awake: a mask without its scan's entities is an error.
    let mask = out.join("sub-01/ses-preop/anat/sub-01_ses-preop_desc-brain_mask.nii.gz");
    std::fs::rename(&mask, mask.with_file_name("brain.nii.gz")).unwrap();
    let said = tool(folder.path(), "bids-validator-deno", &["--format", "json", out.to_str().unwrap()]);
    assert!(said.contains("NOT_INCLUDED"), "{said}");
}

#[test]
fn a_dry_run_refuses_what_a_run_would_and_a_cohort_of_whom_nobody_can_be_done() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::create_dir_all(at("study/sub-01")).unwrap();
    std::fs::create_dir_all(at("other")).unwrap();
    std::fs::write(at("other/dataset_description.json"), r#"{"Name": "o", "DatasetType": "derivative"}"#).unwrap();
    let dry = |out: &str, more: &[&str]| {
        let ended = output(&[&["bids", &at("study"), &at(out), "participant", "--dry-run"], more].concat());
        (ended.status.code(), String::from_utf8_lossy(&[ended.stdout, ended.stderr].concat()).into_owned())
    };
    let (code, said) = dry("out", &[]);
    assert!(code == Some(3) && said.contains("none of 1 subjects can be done"), "{said}");
    let (code, said) = dry("other", &[]);
    assert!(code == Some(3) && said.contains("another program has made"), "{said}");
    let (code, said) = dry("out", &["-w", &at("study")]);
    assert!(code == Some(3) && said.contains("--work-dir"), "{said}");
    assert!(!Path::new(&at("out")).exists());
    for (more, told) in [(&["--entity", "run-2"][..], true), (&["--cells", "5000"], true), (&["--dry-run"], false)] {
        let ended = output(&[&["bids", &at("study"), &at("out"), "group"], more].concat());
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(said.contains("without effect at the group level"), told, "{said}");
    }
}

#[test]
fn a_folder_without_subjects_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().to_str().unwrap();
    let out = folder.path().join("out");
    let refused = output(&["bids", here, out.to_str().unwrap(), "participant"]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("no folder sub-*"));
    assert!(!out.exists());
}

//! Before the operation: one scan and a plan from the command line to fields, targets and a page.

use crate::job::{CHEAP, contents, output, sample};
use crate::made::copy;
use std::path::{Path, PathBuf};
use std::process::Output;

fn planned(case: &Path, more: &[&str]) -> Output {
    let pre = sample("pre.nii.gz");
    output(&[&["predict", pre.to_str().unwrap(), "-o", case.to_str().unwrap()], more, &CHEAP[..]].concat())
}

fn plan() -> PathBuf {
    sample("truth/resected_pre.nii.gz")
}

#[test]
fn what_cannot_be_planned_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let mask = plan().display().to_string();
    let cases: [(&[&str], &[&str]); 6] = [
        (&["--resection-ellipsoid", "1,2,3"], &["1,2,3", "x,y,z,rx,ry,rz", "--resection-ellipsoid"]),
        (&["--resection-ellipsoid", "1,2,3,4,5,0"], &["half axes above 0"]),
        (&["--resection-ellipsoid", "9000,0,0,5,5,5"], &["is empty", "--resection"]),
        (&["--resection", &mask, "--head", "0,0,0"], &["`0,0,0`", "supine, prone", "not all 0"]),
        (&["--resection", &mask, "--head", "left", "--head", "left"], &["`heads`", "none twice"]),
        (&["--resection", &mask, "--drained", "1.5"], &["`drained`", "above 0, at most 1"]),
    ];
    for (n, (more, words)) in cases.into_iter().enumerate() {
        let case = folder.path().join(n.to_string());
        let ended = planned(&case, more);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{more:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)) && said.trim().lines().count() == 1, "{more:?}: {said}");
        assert!(!case.exists(), "{more:?} left something behind");
    }
    let none = planned(&folder.path().join("none"), &[]);
    assert_eq!(none.status.code(), Some(2));
}

#[test]
fn slow_a_plan_becomes_fields_targets_and_a_page_the_same_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    // The page is headed by the folder's name.
    let (case, again) = (folder.path().join("case"), folder.path().join("again").join("case"));
    let targets = folder.path().join("targets.csv");
    std::fs::write(&targets, "x,y,z\n20,-10,30\n-30,0,20\n").unwrap();
    let (mask, targets) = (plan().display().to_string(), targets.display().to_string());
    let asked =
        ["--resection", &mask, "--targets", &targets, "--head", "supine", "--head", "prone", "--draws", "32", "--json"];
    let ended = planned(&case, &[&asked[..], &["--threads", "2"]].concat());
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let found: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    let head = |n: usize| &found["heads"][n];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    assert_eq!(found["heads"].as_array().unwrap().len(), 2);
    // Whoever lies on the back is pulled to the back of the head, on the face to the face.
    assert!(number(&head(0)["down"][1]) < -0.8 && number(&head(1)["down"][1]) > 0.8);
    for n in 0..2 {
        let shares = head(n)["shares"].as_object().unwrap();
        let sum: f64 = shares.values().map(number).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{shares:?}");
        assert!(
            number(&head(n)["largest_mm"]) > 0.0
                && number(&head(n)["reach95_largest_mm"]) > number(&head(n)["largest_mm"])
        );
        let target = &head(n)["targets"][0];
        assert!(number(&target["half_axes_mm"][0]) > 0.0 && (0.0..=1.0).contains(&number(&target["over_threshold"])));
    }
    // The cheap settings hold the brain at its base alone: what is read from the surface is what is solved.
    let check = &found["checks"][0];
    let off = number(&check["difference_rms_mm"]) / number(&check["displacement_rms_mm"]);
    assert!(check["solves"] == 2 && off < 0.05, "{check}");
    let page = std::fs::read_to_string(case.join("report.html")).unwrap();
    for words in
        ["Expected brain shift", "What is assumed", "Research software", "head prone", "not for surgical planning"]
    {
        assert!(page.contains(words), "{words}");
    }
    let files = contents(&case);
    for state in ["predicted", "predicted-prone"] {
        for kind in ["displacement", "sd", "reach50", "reach95", "probability", "mask"] {
            let file = format!("xfm/from-pre_to-deformed_desc-{state}_{kind}.nii.gz");
            assert!(files.contains_key(&file), "{file}");
        }
        assert!(files.contains_key(&format!("sim/{state}.vtu")));
    }

    // The same bytes on one thread, and nothing is made again where nothing has changed.
    copy(&case, &again);
    std::fs::remove_file(again.join(".stages/predict.manifest.json")).unwrap();
    let one = planned(&again, &[&asked[..], &["--threads", "1"]].concat());
    assert!(one.status.success() && one.stdout == ended.stdout);
    let (first, second) = (contents(&case), contents(&again));
    assert_eq!(first.keys().collect::<Vec<_>>(), second.keys().collect::<Vec<_>>());
    for (name, bytes) in &first {
        assert!(*bytes == second[name], "{name} differs");
    }
    refuses_in_the_case(&case, folder.path());
}

/// What only a segmented scan can tell, and what a case of one scan is no case for.
fn refuses_in_the_case(case: &Path, folder: &Path) {
    let kept = contents(case);
    let far = folder.join("far.csv");
    std::fs::write(&far, "x,y,z\n20,-10,30\n500,0,0\n").unwrap();
    let (mask, far) = (plan().display().to_string(), far.display().to_string());
    let cases: [(&[&str], &[&str]); 2] = [
        (&["--resection", &mask, "--targets", &far], &["far.csv", "target 2", "outside the head"]),
        (&["--resection-ellipsoid", "0,0,0,300,300,300"], &["outside the brain"]),
    ];
    for (more, words) in cases {
        let ended = planned(case, more);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{more:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{more:?}: {said}");
    }
    let prediction = "sim/prediction.json";
    assert!(contents(case)[prediction] == kept[prediction], "a refused plan leaves the prediction as it was");
    let estimate = output(&["estimate", case.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&estimate.stderr).into_owned();
    assert!(estimate.status.code() == Some(3) && said.contains("before an operation"), "{said}");
}

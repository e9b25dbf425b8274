//! Settings as a case keeps them: resolved once, and meant by every later command.

use crate::job::{CHEAP, output, sample};
use serde_json::Value;
use std::path::Path;

const SETTINGS: &str = "\
[prior]
study = \"mre\"
";

fn json(arguments: &[&str]) -> Value {
    let result = output(&[arguments, &["--json", "-q"]].concat());
    assert!(matches!(result.status.code(), Some(0 | 4)), "{}", String::from_utf8_lossy(&result.stderr));
    serde_json::from_slice(&result.stdout).unwrap()
}

/// An estimate on a case takes the case's own settings: it equals the estimate of one run with them.
#[test]
fn slow_an_estimate_means_the_settings_its_case_was_made_with() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // The cheap settings are none of the defaults: `[anat.sag]` among them.
    let cheap = std::fs::read_to_string(CHEAP[1]).unwrap();
    std::fs::write(path("s.toml"), format!("{cheap}{SETTINGS}")).unwrap();
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let scans = [pre.to_str().unwrap(), post.to_str().unwrap()];
    let (two, one, config) = (path("two"), path("one"), path("s.toml"));
    let run = |case: &str, more: &[&str]| {
        json(&[&["run", scans[0], scans[1], "-o", case, "--config", &config], more].concat())
    };
    run(&two, &[]);
    let later = json(&["estimate", &two]);
    let at_once = &run(&one, &["--estimate"])["estimate"];
    assert_eq!(later, *at_once);
    let kept: toml::Table = std::fs::read_to_string(Path::new(&two).join("settings.toml")).unwrap().parse().unwrap();
    assert_eq!(kept["anat"]["sag"]["iterations"].as_array().unwrap()[0].as_integer(), Some(20));
    assert_eq!(kept["prior"]["study"].as_str(), Some("mre"));
    assert_eq!(kept["mesh"]["size"]["cells"].as_integer(), Some(3000));
    what_every_stage_warned_of_is_in_the_outcome(Path::new(&one));
    what_would_be_estimated_again_is_told(&one, &config);
}

fn what_every_stage_warned_of_is_in_the_outcome(case: &Path) {
    let read = |file: &str| -> Value { serde_json::from_slice(&std::fs::read(case.join(file)).unwrap()).unwrap() };
    let told = &read("sim/outcome.json")["warnings"];
    let stages = read("provenance.json")["stages"].as_array().unwrap().clone();
    let of_stage = |stage: &Value| read(&format!(".stages/{}.manifest.json", stage["stage"].as_str().unwrap()));
    let warned: Vec<Value> =
        stages.iter().flat_map(|stage| of_stage(stage)["warnings"].as_array().unwrap().clone()).collect();
    assert_eq!(told, &Value::from(warned.clone()));
    assert!(warned.iter().any(|w| w.as_str().unwrap().contains("estimate: ")), "{warned:?}");
}

/// Of a run with the same settings nothing; of a patient who lay another way the estimate, and with it the fields.
fn what_would_be_estimated_again_is_told(case: &str, config: &str) {
    let why = |more: &[&str]| -> Vec<String> {
        let config = if more.contains(&"--config") { &[][..] } else { &["--config", config] };
        let said = json(&[&["why", case, "--estimate"], config, more].concat());
        let stages = said["stages"].as_array().unwrap().iter().filter(|stage| stage["would_run"] == true);
        stages.map(|stage| format!("{}: {}", stage["stage"].as_str().unwrap(), stage["reasons"][0])).collect()
    };
    assert_eq!(why(&[]), [""; 0]);
    let again = why(&["--head", "left"]);
    let named = |n: usize, stage: &str, reason: &str| again[n].starts_with(stage) && again[n].contains(reason);
    assert!(
        again.len() == 2 && named(0, "estimate", "gravity_m_per_s2") && named(1, "fields", "estimate"),
        "{again:?}"
    );
    let fields = format!("{config}.fields.toml");
    let text = std::fs::read_to_string(config).unwrap() + "\n[fields]\nstates = [\"observed\"]\n";
    std::fs::write(&fields, text).unwrap();
    let again = why(&["--config", &fields]);
    assert!(again.len() == 1 && again[0].contains("fields.states"), "{again:?}");
}

#[test]
fn slow_an_estimate_of_another_law_has_that_laws_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let arguments = ["run", pre.to_str().unwrap(), post.to_str().unwrap(), "-o", case.to_str().unwrap()];
    let outcome = json(&[&arguments[..], &CHEAP, &["--estimate", "--law", "ogden"]].concat());
    let names = outcome["estimate"]["posterior"]["names"].as_array().unwrap();
    assert_eq!(names.len(), 2, "{names:?}");
    assert_eq!(names[1], "alpha of brain");
    // So coarsely nothing is seen to move, and no law has led to rest.
    let state = outcome["samples"].as_array().unwrap().last().unwrap();
    assert_eq!((&state["displacement_max_mm"], &state["laws"]), (&0.0.into(), &serde_json::json!({})), "{state}");
}

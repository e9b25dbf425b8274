//! Bars of pairs without an operation and of two people taken for one, and of other tools' label maps, on free scans.

use crate::bar::{Bar, data, run_hgm};
use std::path::Path;

/// Moving, fixed, and the answer that is right: the name in the JSON error.
const PAIRS: [(&str, &str, &str); 11] = [
    ("bias_a", "bias_b", "no-operation"),
    ("twovisits_1", "twovisits_2", "no-operation"),
    ("postures_HFS", "postures_HFP", "no-operation"),
    ("postures_HFS", "postures_HFDL", "no-operation"),
    ("postures_HFS", "postures_HFDR", "no-operation"),
    ("stranger_a", "stranger_b", "not-one-person"),
    ("good_a", "gap", "not-one-person"),
    ("good_b", "gap", "not-one-person"),
    ("twovisits_1", "postures_HFS", "not-one-person"),
    ("stranger_a", "bias_a", "not-one-person"),
    ("gap", "postures_HFP", "not-one-person"),
];

pub fn bars() -> Vec<Bar> {
    let Some(data) = data() else {
        println!("skipped: pairs of free scans (heads/)");
        return Vec::new();
    };
    let heads = data.join("heads");
    let mut bars: Vec<Bar> = PAIRS.iter().map(|pair| answered(pair, &heads)).collect();
    for map in ["labels_freesurfer_aseg.mgz", "labels_synthseg.nii.gz", "labels_gif.nii.gz"] {
        bars.push(meshed(map, &heads));
    }
    bars
}

/// What the program says of a pair.
fn answered(&(pre, post, wanted): &(&str, &str, &str), heads: &Path) -> Bar {
    let folder = tempfile::tempdir().unwrap();
    let scan = |name: &str| heads.join(format!("{name}_t1.nii.gz")).display().to_string();
    let case = folder.path().join("case").display().to_string();
    let run = run_hgm(&["prep", "--no-mesh", "--json", &scan(pre), &scan(post), "-o", &case]);
    let said: serde_json::Value = serde_json::from_str(&run.printed).unwrap_or_default();
    let answer = said["error"]["answer"].as_str().unwrap_or("a cavity, or refused");
    Bar::new(&format!("pairs {pre} / {post}"), wanted, answer.to_owned(), answer == wanted)
}

/// A label map of another tool to a mesh in one command.
fn meshed(map: &str, heads: &Path) -> Bar {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("brain.vtu").display().to_string();
    let run = run_hgm(&["mesh", "--json", &heads.join(map).display().to_string(), "-o", &mesh, "--cells", "30000"]);
    let said = if run.ok { format!("exit 0, {:.0} s", run.wall_s) } else { "refused".to_owned() };
    Bar::new(&format!("label map {map}"), "meshed", said, run.ok)
}

//! Bars of predictions before an operation: the fast way against full solutions, time and memory.

use crate::bar::{Bar, memory, run_hgm, wall};
use std::path::Path;

pub fn bars() -> Vec<Bar> {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case").display().to_string();
    let sample =
        |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/pair").join(name).display().to_string();
    let (pre, plan) = (sample("pre.nii.gz"), sample("truth/resected_pre.nii.gz"));
    let asked = ["predict", &pre, "-o", &case, "--resection", &plan, "--json"];
    let mut bars = Vec::new();

    // 128 draws, one head, from the scan to the page.
    let one = run_hgm(&[&asked[..], &["--cells", "60000", "--checks", "0"]].concat());
    bars.push(wall("predict, scan to page, one head", 60.0, &one));
    let heads = ["--head", "supine", "--head", "prone", "--head", "left", "--head", "sitting"];
    let four = run_hgm(&[&asked[..], &heads, &["--cells", "60000", "--checks", "0"]].concat());
    bars.push(wall("predict, four heads, after the mesh", 60.0, &four));
    bars.push(memory("predict, four heads", 2.0, &four));

    // Every draw of both supports solved whole as well.
    let solved = run_hgm(&[&asked[..], &["--cells", "20000", "--draws", "64", "--checks", "64"]].concat());
    let found: serde_json::Value = serde_json::from_str(&solved.printed).unwrap_or_default();
    for check in found["checks"].as_array().into_iter().flatten() {
        let of = |name: &str| check[name].as_f64().unwrap_or(f64::NAN);
        let supports = check["supports"].as_str().unwrap_or_default();
        let (mean, sd) = (100.0 * of("mean_off_95"), 100.0 * of("sd_off_95"));
        let name = format!("predict, 64 full solves, {supports}");
        let said = format!("mean {mean:.1} %, SD {sd:.1} %");
        bars.push(Bar::new(&name, "mean 3 %, SD 8 % of the spread", said, mean <= 3.0 && sd <= 8.0));
    }
    bars
}

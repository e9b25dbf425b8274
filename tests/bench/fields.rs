//! Bars of displacement fields: the stage on a scan of 1 mm, images and streamlines carried by it, what round trips are off.

use crate::bar::{Bar, data, memory, run_hgm};
use std::path::Path;

/// Points of the streamlines.
const POINTS: usize = 100_000;

pub fn bars() -> Vec<Bar> {
    let Some(data) = data() else {
        println!("skipped: fields of a scan of 1 mm (cases/A_colin_L_mild)");
        return Vec::new();
    };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let scan = |name: &str| data.join("cases/A_colin_L_mild").join(name).display().to_string();
    let (pre, case) = (scan("pre.nii.gz"), at("case"));
    let run = ["run", "-q", &pre, &scan("post.nii.gz"), "-o", &case];
    if !run_hgm(&run).ok {
        return vec![Bar::new("fields: a case", "exit 0", "failed", false)];
    }
    // What the stage alone takes: the job with it, less the same job where everything is there.
    let skipped = run_hgm(&run);
    std::fs::remove_file(folder.path().join("case/.stages/fields.manifest.json")).expect("the stage has been made");
    let made = run_hgm(&run);
    let [wall_s, cpu_s] = [made.wall_s - skipped.wall_s, made.cpu_s - skipped.cpu_s];
    let states = figures(&folder.path().join("case"));
    let mut bars = vec![
        Bar::new(
            "fields: stage on a scan of 1 mm",
            "<= 5 s on 2 cores",
            format!("{wall_s:.1} s wall, {cpu_s:.1} CPU-s, {} states", states.len()),
            made.ok && wall_s <= 5.0,
        ),
        memory("fields: stage on a scan of 1 mm", 1.0, &made),
    ];
    let least = states.iter().map(|(_, jacobian)| *jacobian).fold(f64::INFINITY, f64::min);
    bars.push(Bar::new("fields: smallest Jacobian", "> 0", format!("{least:.3}"), least > 0.0));
    let image = run_hgm(&["warp", &case, &pre, "-o", &at("warped.nii.gz"), "-q"]);
    bars.push(Bar::new(
        "fields: hgm warp of a T1 of 1 mm",
        "<= 3 s on 2 cores",
        format!("{:.1} s wall, {:.1} CPU-s", image.wall_s, image.cpu_s),
        image.ok && image.wall_s <= 3.0,
    ));
    std::fs::write(folder.path().join("lines.tck"), streamlines()).expect("a folder of our own");
    let lines = run_hgm(&["warp", &case, &at("lines.tck"), "-o", &at("warped.tck"), "-q"]);
    bars.push(Bar::new(
        "fields: streamlines of 100,000 points",
        "<= 1 s on 2 cores",
        format!("{:.1} s wall, {:.1} CPU-s", lines.wall_s, lines.cpu_s),
        lines.ok && lines.wall_s <= 1.0,
    ));
    bars
}

/// The states of a case with the smallest determinant of each.
fn figures(case: &Path) -> Vec<(String, f64)> {
    let text = std::fs::read_to_string(case.join("sim/brain_shift.json")).unwrap_or_default();
    let found: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    let states = found["states"].as_array().cloned().unwrap_or_default();
    let of = |state: &serde_json::Value| {
        let name = state["state"].as_str().unwrap_or_default().to_owned();
        (name, state["jacobian_min"].as_f64().unwrap_or(f64::NAN))
    };
    states.iter().map(of).collect()
}

/// Lines of 100 points through the middle of the head, as MRtrix writes them.
fn streamlines() -> Vec<u8> {
    let mut bytes =
        format!("mrtrix tracks\ndatatype: Float32LE\ncount: {}\nfile: . 128\nEND\n", POINTS / 100).into_bytes();
    bytes.resize(128, 0);
    let mut put = |p: [f32; 3]| p.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    for line in 0..POINTS / 100 {
        let turn = line as f32 * 0.61;
        for n in 0..100u8 {
            let along = f32::from(n) * 0.6 - 30.0;
            put([25.0 * turn.cos() + 0.3 * along, along - 15.0, 25.0 * turn.sin() + 15.0]);
        }
        put([f32::NAN; 3]);
    }
    put([f32::INFINITY; 3]);
    bytes
}

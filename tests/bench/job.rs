//! Bars of the whole job, run as a user runs it: the demo, a patient, the phantom.

use crate::bar::{Bar, Finished, data, run_hgm};
use std::collections::BTreeMap;
use std::path::Path;

pub fn bars() -> Vec<Bar> {
    let mut bars = Vec::new();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();

    let one = run_hgm(&["demo", "-q", "-o", &at("one"), "--threads", "1"]);
    let two = run_hgm(&["demo", "-q", "-o", &at("two"), "--threads", "2"]);
    bars.push(wall("job demo", 60.0, &two));
    let report =
        std::fs::metadata(folder.path().join("two/pair/report.html")).map_or(f64::NAN, |m| m.len() as f64 / 1e6);
    bars.push(Bar::new("job demo report", "< 10 MB", format!("{report:.2} MB"), report < 10.0));
    let (a, b) = (contents(&folder.path().join("one")), contents(&folder.path().join("two")));
    let differ: Vec<&String> = a.keys().chain(b.keys()).filter(|name| a.get(*name) != b.get(*name)).collect();
    let said = if differ.is_empty() { format!("{} files equal", a.len()) } else { format!("{differ:?}") };
    bars.push(Bar::new("job demo, 1 and 2 threads", "same bytes", said, differ.is_empty() && one.ok && two.ok));

    let Some(data) = data() else {
        println!("skipped: a patient's run (cases/A_colin_L_mild)");
        return bars;
    };
    let scan = |name: &str| data.join("cases/A_colin_L_mild").join(name).display().to_string();
    let (pre, post) = (scan("pre.nii.gz"), scan("post.nii.gz"));
    let run = run_hgm(&["run", "-q", &pre, &post, "-o", &at("a")]);
    bars.push(wall("job run A", 180.0, &run));
    bars.push(memory("job run A", 3.0, &run));
    println!("{}", run.printed.trim_end());
    let two_tissues = run_hgm(&["run", "-q", &pre, &post, "-o", &at("b"), "--estimate", "--tissues", "2"]);
    bars.push(wall("job run A, two-tissue estimate", 240.0, &two_tissues));
    bars.push(memory("job run A, two-tissue estimate", 3.0, &two_tissues));
    println!("{}", two_tissues.printed.trim_end());
    bars
}

fn wall(name: &str, seconds: f64, run: &Finished) -> Bar {
    Bar::new(
        &format!("{name}, time"),
        &format!("<= {seconds:.0} s on 2 cores, exit 0"),
        format!("{:.1} s wall, {:.1} CPU-s, {}", run.wall_s, run.cpu_s, if run.ok { "exit 0" } else { "failed" }),
        run.ok && run.wall_s <= seconds,
    )
}

fn memory(name: &str, gigabytes: f64, run: &Finished) -> Bar {
    Bar::new(
        &format!("{name}, peak memory"),
        &format!("<= {gigabytes} GB"),
        format!("{:.2} GB", run.peak_gb),
        run.peak_gb <= gigabytes,
    )
}

fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if let (Ok(name), Ok(bytes)) = (path.strip_prefix(folder), std::fs::read(&path)) {
                found.insert(name.display().to_string(), bytes);
            }
        }
    }
    found
}

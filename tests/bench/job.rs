//! Bars of the whole job, run as a user runs it: the demo, a patient, the phantom.

use crate::bar::{Bar, contents, data, memory, run_hgm, wall};

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

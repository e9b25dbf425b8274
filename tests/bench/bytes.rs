//! Bars of sameness: any number of threads, one sweep or four shards, the same bytes of every file.

use crate::bar::{Bar, contents, run_hgm, small_patient};
use std::path::Path;

pub fn bars() -> Vec<Bar> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let [pre, post] = small_patient(folder.path());
    let small = ["-q", "--cells", "8000"];

    let threads = ["1", "2", "8"];
    let ended: Vec<bool> = threads
        .iter()
        .map(|n| {
            let case = at(&format!("threads-{n}"));
            let swept = run_hgm(&[&["run", &pre, &post, "--threads", n, "-o", &case][..], &small[..]].concat());
            swept.ok && run_hgm(&["estimate", &case, "-q", "--tissues", "2", "--threads", n]).ok
        })
        .collect();
    let of_threads: Vec<_> = threads.iter().map(|n| folder.path().join(format!("threads-{n}"))).collect();
    let threads = same("bytes of 1, 2 and 8 threads, sweep and estimate", &of_threads, ended.iter().all(|ok| *ok));

    let step = |command: &str, case: &str, more: &[&str]| run_hgm(&[&[command, case, "-q"], more].concat()).ok;
    let mut ended = true;
    for name in ["whole", "shards"] {
        let prep = ["prep", &pre, &post, "-o", &at(name)].map(str::to_owned);
        ended &= run_hgm(&[&prep.each_ref().map(String::as_str)[..], &small[..]].concat()).ok;
    }
    ended &= step("sweep", &at("whole"), &[]);
    // In any order, each as a machine of its own would.
    for k in ["3/4", "1/4", "4/4", "2/4"] {
        ended &= step("sweep", &at("shards"), &["--shard", k, "--threads", "1"]);
    }
    ended &= step("reduce", &at("shards"), &[]);
    let of_shards = ["whole", "shards"].map(|name| folder.path().join(name));
    vec![threads, same("bytes of one sweep and of 4 shards", &of_shards, ended)]
}

fn same(name: &str, folders: &[impl AsRef<Path>], ended: bool) -> Bar {
    let first = contents(folders[0].as_ref());
    let mut differ = Vec::new();
    for folder in &folders[1..] {
        let other = contents(folder.as_ref());
        let names = first.keys().chain(other.keys());
        differ.extend(names.filter(|name| first.get(*name) != other.get(*name)).cloned());
    }
    let said = if differ.is_empty() { format!("{} files equal", first.len()) } else { format!("{differ:?}") };
    Bar::new(name, "same bytes of every file", said, ended && differ.is_empty())
}

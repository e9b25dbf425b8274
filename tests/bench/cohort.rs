//! Bars of a cohort: eight synthetic subjects by one command, by Snakemake here and on a Slurm cluster of one node (needs
//! root, and the Python environment of `./run setup`).

use crate::bar::{Bar, contents, run_hgm};
use crate::cluster::{OneNodeSlurm, snakemake};
use std::path::Path;

const SUBJECTS: usize = 8;
/// Coarse enough for three rounds of eight on two cores.
const SETTINGS: &str = "[mesh]\nengine = \"lattice\"\nsize = { cells = 15000 }\n";

pub fn bars() -> Vec<Bar> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = |name: &str| at(name).display().to_string();
    std::fs::write(at("settings.toml"), SETTINGS).unwrap();
    for n in 1..=SUBJECTS {
        let patient = text(&format!("patient-{n}"));
        let side = if n % 2 == 0 { "left" } else { "right" };
        run_hgm(&["synth", "-q", "--seed", &n.to_string(), "--side", side, "--spacing-mm", "1.5", "-o", &patient]);
        for (session, scan) in [("preop", "pre"), ("postop", "post")] {
            let anat = at(&format!("study/sub-0{n}/ses-{session}/anat"));
            std::fs::create_dir_all(&anat).unwrap();
            let to = anat.join(format!("sub-0{n}_ses-{session}_T1w.nii.gz"));
            std::fs::copy(Path::new(&patient).join(format!("{scan}.nii.gz")), to).unwrap();
        }
    }

    let mut bars = Vec::new();
    let (study, out, settings) = (text("study"), text("command"), text("settings.toml"));
    let bids = ["bids", "-q", "--config", &settings, &study, &out];
    let (mut cpu_s, mut peak_gb) = (0.0, 0.0f64);
    for n in 1..=SUBJECTS {
        let label = format!("0{n}");
        let run = run_hgm(&[&bids[..], &["participant", "--threads", "1", "--participant-label", &label]].concat());
        println!(
            "sub-{label}: {:.1} CPU-s, {:.1} s wall on one thread, {:.2} GB peak",
            run.cpu_s, run.wall_s, run.peak_gb
        );
        cpu_s += run.cpu_s / SUBJECTS as f64;
        peak_gb = peak_gb.max(run.peak_gb);
    }
    run_hgm(&[&bids[..], &["group"]].concat());
    let expected = contents(&at("command"));
    let disk_mb = expected.values().map(Vec::len).sum::<usize>() as f64 / 1e6 / SUBJECTS as f64;
    let cost = format!("{cpu_s:.1} CPU-s, {peak_gb:.2} GB peak, {disk_mb:.0} MB on disk");
    bars.push(Bar::new("cohort, one subject", "printed", cost, cpu_s > 0.0));

    let slurm = OneNodeSlurm::start(&at("cluster"));
    for profile in ["local", "slurm"] {
        let begin = std::time::Instant::now();
        let out = at(profile).join("out");
        let program = Path::new(env!("CARGO_BIN_EXE_hgm"));
        let ended = snakemake(program, &at(profile), profile, &at("study"), &out, &at("settings.toml")).wait();
        let mut found = contents(&out);
        found.retain(|name, _| !name.starts_with(".cohort/"));
        let differ: Vec<&String> =
            expected.keys().chain(found.keys()).filter(|name| expected.get(*name) != found.get(*name)).collect();
        let same = differ.is_empty() && ended.is_ok_and(|status| status.success());
        let said = if same { format!("{} files equal", found.len()) } else { format!("{differ:?}") };
        let wall_s = begin.elapsed().as_secs_f64();
        bars.push(Bar::new(
            &format!("cohort, eight subjects, {profile}"),
            "the bytes of hgm bids",
            format!("{said}, {wall_s:.0} s"),
            same,
        ));
    }
    drop(slurm);
    bars
}

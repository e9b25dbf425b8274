//! Bars of eight synthetic patients, from their images alone: what was put in must come out.

use crate::bar::{Bar, run_hgm};
use hgm::experiment::outcome::ExperimentOutcome;
use std::path::Path;

/// A patient: seed, side, cc, grey and white modulus (Pa), slices (mm), more options of `hgm synth`.
type Patient = (u32, &'static str, &'static str, [f64; 2], &'static str, &'static [&'static str]);

/// Moduli within the literature's range; thick slices, blood and air as clinical scans have them.
const PATIENTS: [Patient; 8] = [
    (1, "left", "30", [1370.0, 990.0], "1", &[]),
    (2, "right", "32", [900.0, 500.0], "1", &["--air"]),
    (3, "left", "34", [1800.0, 800.0], "1", &["--blood"]),
    (4, "right", "36", [1100.0, 700.0], "3", &[]),
    (5, "left", "38", [750.0, 450.0], "1", &[]),
    (6, "right", "40", [1370.0, 600.0], "1", &["--blood", "--air"]),
    (7, "left", "42", [2000.0, 1100.0], "2", &["--air"]),
    (8, "right", "44", [1000.0, 990.0], "1", &[]),
];

pub fn bars() -> Vec<Bar> {
    let folder = tempfile::tempdir().unwrap();
    println!("patient  grey, white Pa (true)   grey [95 %]            white [95 %]           margin mm      limits");
    let rows: Vec<Row> = PATIENTS.iter().filter_map(|patient| Row::of(patient, folder.path())).collect();
    let count = |met: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| met(row)).count();
    let better = count(&|row| row.margin_mm[1] < row.margin_mm[0]);
    let inside = count(&|row| (0..2).all(|t| (row.interval[t][0]..=row.interval[t][1]).contains(&row.truth[t])));
    let seconds = rows.iter().map(|row| row.cpu_s).sum::<f64>() / rows.len().max(1) as f64;
    println!("{seconds:.0} CPU-s a patient");
    vec![
        Bar::new("patients RMSE at the margin below rest", "8 of 8", format!("{better} of 8"), better == 8),
        Bar::new("patients both moduli in their 95 % intervals", ">= 7 of 8", format!("{inside} of 8"), inside >= 7),
    ]
}

struct Row {
    truth: [f64; 2],
    interval: [[f64; 2]; 2],
    margin_mm: [f64; 2],
    cpu_s: f64,
}

impl Row {
    fn of((seed, side, cc, truth, slice, more): &Patient, folder: &Path) -> Option<Self> {
        let (scans, case) = (folder.join("scans"), folder.join("case"));
        let at = |path: &Path| path.display().to_string();
        let settings = folder.join("settings.toml");
        std::fs::write(&settings, format!("[synth]\ngrey_pa = {:.1}\nwhite_pa = {:.1}\n", truth[0], truth[1])).unwrap();
        let (config, seed_text, scans_text) = (at(&settings), seed.to_string(), at(&scans));
        let mut synth = vec!["synth", "-q", "--force", "--config", &config, "--seed", &seed_text, "-o", &scans_text];
        synth.extend(["--sag", "fem", "--side", side, "--resection-cc", cc, "--slice-mm", slice]);
        synth.extend(*more);
        assert!(run_hgm(&synth).ok, "synthetic patient {seed}");

        // Density and the direction of gravity are known: a modulus is only as good as the load.
        let json = std::fs::read(scans.join("truth/truth.json")).unwrap();
        let patient: serde_json::Value = serde_json::from_slice(&json).unwrap();
        let gravity: [f64; 3] = serde_json::from_value(patient["gravity_pre"].clone()).unwrap();
        let load = format!(
            "[resection]\ntissues = 2\ngravity_frame = \"pre\"\ngravity_m_per_s2 = {:?}\ndensity_kg_per_m3 = {:.1}\n",
            gravity.map(|g| 9.80665 * g),
            patient["settings"]["effective_density_kg_per_m3"].as_f64().unwrap()
        );
        std::fs::write(&settings, load).unwrap();
        let (pre, post) = (at(&scans.join("pre.nii.gz")), at(&scans.join("post.nii.gz")));
        // The patient before must not answer for this one.
        std::fs::remove_dir_all(&case).ok();
        let run = run_hgm(&["run", "-q", "--force", &pre, &post, "--estimate", "--config", &config, "-o", &at(&case)]);
        let outcome = std::fs::read_to_string(case.join("sim/outcome.json")).unwrap_or_default();
        let outcome = ExperimentOutcome::from_json(&outcome, "outcome.json").ok().filter(|_| run.ok);
        let Some(outcome) = outcome else {
            println!("patient {seed}: the run failed");
            return None;
        };
        let estimate = outcome.estimate.as_ref()?;
        let posterior = &estimate.posterior;
        let margin = |rmse: &std::collections::BTreeMap<String, f64>| rmse.get("margin").copied().unwrap_or(f64::NAN);
        let row = Self {
            truth: *truth,
            interval: [posterior.interval_95[0], posterior.interval_95[1]],
            margin_mm: [margin(&outcome.rest_rmse_mm), margin(&outcome.samples.last()?.rmse_mm)],
            cpu_s: run.cpu_s,
        };
        let shown = |t: usize| {
            let [low, high] = row.interval[t];
            format!("{:5.0} [{low:5.0}, {high:5.0}]", posterior.mode[t])
        };
        println!(
            "{seed:>7}  {:>5.0}, {:>5.0}            {}   {}   {:.2} -> {:.2}   {}",
            truth[0],
            truth[1],
            shown(0),
            shown(1),
            row.margin_mm[0],
            row.margin_mm[1],
            estimate.limits.join("; ")
        );
        Some(row)
    }
}

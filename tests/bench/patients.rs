//! Bars of sixteen synthetic patients, from their images alone: what was put in must come out, and whether the skull held the
//! brain must be told. Patients on other heads than the template's need `HGM_BENCH_DATA`; `HGM_BENCH_PATIENTS` names some of them
//! (`7,11-13`), whose figures are printed, with bars for so many.

use crate::bar::{Bar, data, numbers, run_hgm};
use hgm::experiment::outcome::ExperimentOutcome;
use std::path::Path;

struct Patient {
    seed: u64,
    /// A scan of `heads/` in the measuring data; none for the template's.
    head: Option<&'static str>,
    lobe: &'static str,
    side: &'static str,
    resection_cc: f64,
    /// Shear modulus of grey and white matter, Pa.
    truth_pa: [f64; 2],
    supports: &'static str,
    density_kg_per_m3: f64,
}

const fn patient(
    seed: u64,
    head: &'static str,
    place: [&'static str; 2],
    resection_cc: f64,
    truth_pa: [f64; 2],
    supports: &'static str,
    density_kg_per_m3: f64,
) -> Patient {
    let head = if head.is_empty() { None } else { Some(head) };
    let [lobe, side] = place;
    Patient { seed, head, lobe, side, resection_cc, truth_pa, supports, density_kg_per_m3 }
}

/// Tetrahedra of a patient's truth: finer than the mesh of the estimate.
const CELLS: usize = 250_000;

/// Five heads, five places, moduli within the literature's range.
const PATIENTS: [Patient; 16] = [
    patient(1, "", ["temporal", "left"], 30.0, [1370.0, 990.0], "fixed", 300.0),
    patient(2, "good_b", ["frontal", "right"], 25.0, [900.0, 500.0], "sliding", 250.0),
    patient(3, "stranger_a", ["parietal", "left"], 28.0, [1800.0, 800.0], "fixed", 350.0),
    patient(4, "good_a", ["occipital", "right"], 25.0, [1100.0, 700.0], "sliding", 300.0),
    patient(5, "gap", ["temporal", "left"], 38.0, [750.0, 450.0], "fixed", 200.0),
    patient(6, "", ["frontal", "right"], 32.0, [1370.0, 600.0], "sliding", 300.0),
    patient(7, "good_b", ["parietal", "left"], 30.0, [2000.0, 1100.0], "fixed", 400.0),
    patient(8, "stranger_a", ["temporal", "right"], 35.0, [1000.0, 990.0], "sliding", 250.0),
    patient(9, "good_a", ["frontal", "left"], 30.0, [1000.0, 700.0], "sliding", 300.0),
    patient(10, "good_a", ["temporal", "right"], 30.0, [1200.0, 1200.0], "fixed", 300.0),
    patient(11, "gap", ["frontal", "left"], 25.0, [1600.0, 1000.0], "sliding", 350.0),
    patient(12, "stranger_a", ["insular", "right"], 8.0, [900.0, 700.0], "fixed", 300.0),
    patient(13, "", ["occipital", "left"], 20.0, [800.0, 900.0], "sliding", 250.0),
    patient(14, "good_b", ["temporal", "left"], 36.0, [1500.0, 700.0], "sliding", 300.0),
    patient(15, "gap", ["parietal", "right"], 25.0, [1000.0, 500.0], "fixed", 250.0),
    patient(16, "good_a", ["frontal", "right"], 40.0, [600.0, 400.0], "fixed", 200.0),
];

pub fn bars() -> Vec<Bar> {
    let folder = tempfile::tempdir().unwrap();
    let there = |patient: &&Patient| patient.head.is_none() || data().is_some();
    let named = std::env::var("HGM_BENCH_PATIENTS").ok().map(|text| numbers(&text));
    let is_asked = |patient: &&Patient| named.as_ref().is_none_or(|seeds| seeds.contains(&patient.seed));
    let (wanted, left_out): (Vec<&Patient>, Vec<&Patient>) = PATIENTS.iter().filter(is_asked).partition(there);
    if !left_out.is_empty() {
        println!("patients: {} of {} need heads of HGM_BENCH_DATA; skipped", left_out.len(), PATIENTS.len());
    }
    println!(
        "patient  supports  grey, white Pa (true)  found by  grey [95 %]           white [95 %]          explained"
    );
    let rows: Vec<Row> = wanted.iter().filter_map(|patient| Row::of(patient, folder.path())).collect();
    let told = rows.iter().filter(|row| row.told).count();
    let moduli: Vec<(f64, bool)> = rows.iter().flat_map(Row::moduli).collect();
    let inside = moduli.iter().filter(|(_, inside)| *inside).count();
    let mut off: Vec<f64> = moduli.iter().map(|(ratio, _)| 100.0 * (ratio - 1.0).abs()).collect();
    off.sort_by(f64::total_cmp);
    let [median, worst] = [off.get(off.len() / 2), off.last()].map(|x| x.copied().unwrap_or(f64::NAN));
    let wrong = rows.iter().filter(|row| row.identified && row.moduli().any(|(_, inside)| !inside)).count();
    let seconds = rows.iter().map(|row| row.cpu_s).sum::<f64>() / rows.len().max(1) as f64;
    println!("{seconds:.0} CPU-s a patient");
    let (patients, figures) = (wanted.len(), 2 * wanted.len());
    let [least_told, least_inside] = [(14 * patients).div_ceil(16), (30 * figures).div_ceil(32)];
    let of = |count: usize, all: usize| format!("{count} of {all}");
    let least = |count: usize, all: usize| format!(">= {count} of {all}");
    vec![
        Bar::new("patients supports told", &least(least_told, patients), of(told, patients), told >= least_told),
        Bar::new(
            "patients moduli in their 95 % intervals",
            &least(least_inside, figures),
            of(inside, figures),
            inside >= least_inside,
        ),
        Bar::new("patients identified with the truth outside", "0", wrong.to_string(), wrong == 0),
        Bar::new("patients median |bias| of a modulus", "<= 5 %", format!("{median:.1} %"), median <= 5.0),
        Bar::new("patients worst |bias| of a modulus", "<= 12 %", format!("{worst:.1} %"), worst <= 12.0),
    ]
}

struct Row {
    truth_pa: [f64; 2],
    found_pa: [f64; 2],
    interval_pa: [[f64; 2]; 2],
    /// The most probable supports are the true ones.
    told: bool,
    identified: bool,
    cpu_s: f64,
}

impl Row {
    /// Found over true, and whether the truth lies inside, of either tissue.
    fn moduli(&self) -> impl Iterator<Item = (f64, bool)> + '_ {
        (0..2).map(|t| {
            let [low, high] = self.interval_pa[t];
            (self.found_pa[t] / self.truth_pa[t], (low..=high).contains(&self.truth_pa[t]))
        })
    }

    fn of(patient: &Patient, folder: &Path) -> Option<Self> {
        let (scans, case) = (folder.join("scans"), folder.join("case"));
        let at = |path: &Path| path.display().to_string();
        let settings = folder.join("settings.toml");
        let Patient { seed, supports, density_kg_per_m3, resection_cc, truth_pa: [grey_pa, white_pa], .. } = patient;
        let truth = format!(
            "[synth]\nseed = {seed}\nsag = \"fem\"\ncells = {CELLS}\ngrey_pa = {grey_pa:?}\nwhite_pa = {white_pa:?}\nsupports = \"{supports}\"\n\
             effective_density_kg_per_m3 = {density_kg_per_m3:?}\nresection_cc = {resection_cc:?}\nlobe = \"{}\"\nside = \"{}\"\n",
            patient.lobe, patient.side
        );
        std::fs::write(&settings, truth).unwrap();
        let (config, scans_text) = (at(&settings), at(&scans));
        let head = patient.head.map(|name| at(&data().unwrap_or_default().join(format!("heads/{name}_t1.nii.gz"))));
        let mut synth = vec!["synth", "-q", "--force", "--config", &config, "-o", &scans_text];
        synth.extend(head.iter().flat_map(|head| ["--head", head.as_str()]));
        if !run_hgm(&synth).ok {
            println!("patient {seed}: could not be made");
            return None;
        }

        // Density and the direction of gravity are known: a modulus is only as good as the load.
        let json = std::fs::read(scans.join("truth/truth.json")).unwrap();
        let made: serde_json::Value = serde_json::from_slice(&json).unwrap();
        let gravity: [f64; 3] = serde_json::from_value(made["gravity_pre"].clone()).unwrap();
        let load = format!(
            "[resection]\ntissues = 2\ngravity_frame = \"pre\"\ngravity_m_per_s2 = {:?}\ndensity_kg_per_m3 = {density_kg_per_m3:?}\n",
            gravity.map(|g| 9.80665 * g),
        );
        std::fs::write(&settings, load).unwrap();
        let (pre, post) = (at(&scans.join("pre.nii.gz")), at(&scans.join("post.nii.gz")));
        // The patient before must not answer for this one.
        std::fs::remove_dir_all(&case).ok();
        let run = run_hgm(&["run", "-q", "--force", &pre, &post, "--estimate", "--config", &config, "-o", &at(&case)]);
        let outcome = std::fs::read_to_string(case.join("sim/outcome.json")).unwrap_or_default();
        let outcome = ExperimentOutcome::from_json(&outcome, "outcome.json").ok().filter(|_| run.ok);
        let (Some(comparison), Some(estimate)) = outcome.map(|o| (o.comparison, o.estimate)).unwrap_or_default() else {
            println!("patient {seed}: the run failed");
            return None;
        };
        let likeliest = comparison.candidates.first()?;
        let posterior = &estimate.posterior;
        let row = Self {
            truth_pa: [*grey_pa, *white_pa],
            found_pa: [posterior.mode[0], posterior.mode[1]],
            interval_pa: [posterior.interval_95[0], posterior.interval_95[1]],
            told: likeliest.name.contains(&format!("supports {supports}")),
            identified: likeliest.finding == hgm::experiment::verdict::Finding::Identified,
            cpu_s: run.cpu_s,
        };
        let shown = |t: usize| {
            let [low, high] = row.interval_pa[t];
            format!("{:5.0} [{low:5.0}, {high:5.0}]", row.found_pa[t])
        };
        println!(
            "{seed:>7}  {supports:<8}  {grey_pa:>5.0}, {white_pa:>5.0}           {:<8}  {}  {}  {:.0} %  {:?}",
            likeliest.name.replace("supports ", ""),
            shown(0),
            shown(1),
            100.0 * likeliest.explained_share,
            likeliest.finding
        );
        Some(row)
    }
}

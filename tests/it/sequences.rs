//! Random commands in one folder, each compared with a fresh folder; also for the benches.

use hgm::material::random::CounterRng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// What is common to all settings: images looked at coarsely, closest points instead of a registration of the estimate.
const CHEAP: &str = "\
[register]
samples = 4000
levels_mm = [8.0, 4.0]
[anat.deformable]
iterations = [10, 5, 0]
[anat.sag]
iterations = [10, 5, 0]
[estimate]
two_meshes = false
observed = \"surfaces\"
[estimate.descent]
iterations = 2
";

/// Settings that are changed under way. Both name the same keys: what a file leaves out is the case's own, by design.
const SETTINGS: [&str; 2] = [
    "[resection]\nsd_levels = [0.0]\nsupports = \"fixed\"\ndensity_kg_per_m3 = 100.0\n[prior]\nstudy = \"hyperelastic\"\n",
    "[resection]\nsd_levels = [-1.0, 1.0]\nsupports = \"fixed\"\ndensity_kg_per_m3 = 60.0\n[prior]\nstudy = \"linear\"\n",
];

/// What a case is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct State {
    /// Which patient's scans.
    scans: usize,
    /// Whether a cavity mask is given.
    mask: bool,
    /// Which settings.
    settings: usize,
    /// Which engine's mesh.
    engine: usize,
}

const ENGINES: [[&str; 4]; 2] =
    [["--mesher", "lattice", "--cells", "3000"], ["--mesher", "lattice", "--edge-mm", "14.0"]];

/// Commands of a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Step {
    Prep,
    Run,
    Sweep,
    Estimate,
    Report,
    Killed,
}

/// A place for sequences: patients, masks, settings files and what fresh folders have answered.
pub struct Bench {
    program: PathBuf,
    folder: PathBuf,
    fresh: BTreeMap<(State, Step), Value>,
}

/// How a sequence ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Commands that printed the numbers of a fresh folder.
    pub right: usize,
    /// Commands that refused.
    pub refused: usize,
    /// Commands that printed other numbers, told with what came before.
    pub wrong: Vec<String>,
}

impl Bench {
    /// Makes two patients and a mask for each.
    pub fn new(program: &Path, folder: &Path) -> Self {
        let bench = Self { program: program.to_path_buf(), folder: folder.to_path_buf(), fresh: BTreeMap::new() };
        for (n, own) in SETTINGS.iter().enumerate() {
            std::fs::write(bench.at(&format!("settings-{n}.toml")), format!("{CHEAP}{own}")).unwrap();
        }
        for (n, seed) in ["3", "8"].into_iter().enumerate() {
            let patient = bench.at(&format!("patient-{n}"));
            let made = bench.hgm(&["synth", "--spacing-mm", "4", "--seed", seed, "-o", &patient]);
            assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        }
        bench
    }

    fn at(&self, name: &str) -> String {
        self.folder.join(name).display().to_string()
    }

    fn hgm(&self, arguments: &[&str]) -> Output {
        Command::new(&self.program).args(arguments).arg("-q").output().unwrap()
    }

    fn arguments(&self, step: Step, state: State, case: &str) -> Vec<String> {
        let file = |name: &str| self.at(&format!("patient-{}/{name}", state.scans));
        let config = ["--config".to_owned(), self.at(&format!("settings-{}.toml", state.settings))];
        let mut words: Vec<String> = match step {
            Step::Prep | Step::Run | Step::Killed => {
                let command = if step == Step::Prep { "prep" } else { "run" };
                let mut words = vec![command.to_owned(), file("pre.nii.gz"), file("post.nii.gz")];
                words.extend(["-o".to_owned(), case.to_owned()]);
                words.extend(ENGINES[state.engine].map(str::to_owned));
                if state.mask {
                    words.extend(["--cavity-mask".to_owned(), file("truth/cavity_post.nii.gz")]);
                }
                words.extend(config);
                words
            }
            Step::Sweep => [vec!["sweep".to_owned(), case.to_owned()], config.to_vec()].concat(),
            Step::Estimate => [vec!["estimate".to_owned(), case.to_owned()], config.to_vec()].concat(),
            Step::Report => vec!["report".to_owned(), case.to_owned()],
        };
        words.push("--json".to_owned());
        words
    }

    /// The numbers of a command that ended well; `None` where it refused.
    fn numbers(&self, step: Step, state: State, case: &str) -> Option<Value> {
        let words = self.arguments(step, state, case);
        let result = self.hgm(&words.iter().map(String::as_str).collect::<Vec<_>>());
        if !matches!(result.status.code(), Some(0 | 4)) {
            let said = String::from_utf8_lossy(&result.stderr).into_owned();
            assert_eq!(result.status.code(), Some(3), "{words:?}: {said}");
            return None;
        }
        if step == Step::Report {
            let text = std::fs::read_to_string(Path::new(case).join("sim/outcome.json")).unwrap();
            return Some(serde_json::from_str(&text).unwrap());
        }
        Some(serde_json::from_slice(&result.stdout).unwrap())
    }

    /// The same in a fresh folder: prepared, then this command alone.
    fn fresh(&mut self, step: Step, state: State) -> Value {
        if let Some(known) = self.fresh.get(&(state, step)) {
            return known.clone();
        }
        let prepared = self.at(&format!("fresh-{}-{}-{}", state.scans, state.mask, state.engine));
        if !Path::new(&prepared).exists() {
            self.numbers(Step::Prep, State { settings: 0, ..state }, &prepared).unwrap();
        }
        let case = self.at("fresh-now");
        copy(Path::new(&prepared), Path::new(&case));
        let numbers = self.numbers(step, state, &case).unwrap();
        std::fs::remove_dir_all(&case).unwrap();
        self.fresh.insert((state, step), numbers.clone());
        numbers
    }

    /// Whether the numbers printed are those of a fresh folder of this state.
    fn agrees(&mut self, step: Step, state: State, printed: &Value) -> bool {
        match step {
            Step::Estimate => *printed == self.fresh(step, state),
            // An outcome may also hold what was done in this folder with these settings: the samples, the estimate.
            Step::Prep => outline(printed) == outline(&self.fresh(step, state)) && parts_agree(self, state, printed),
            Step::Run | Step::Sweep | Step::Killed | Step::Report => {
                let wanted = self.fresh(Step::Prep, state);
                let mesh_and_masks = ["mesh", "volumes", "sets", "registrations"];
                mesh_and_masks.iter().all(|name| printed[name] == wanted[name]) && parts_agree(self, state, printed)
            }
        }
    }

    /// One sequence of random commands in one folder.
    pub fn sequence(&mut self, seed: u64, steps: u64) -> Tally {
        let pick = |n: u64, most: usize| (CounterRng::new(seed, 1).between(n, 0.0, most as f64) as usize).min(most - 1);
        let case = self.at(&format!("case-{seed}"));
        let mut tally = Tally::default();
        let mut told: Vec<String> = Vec::new();
        // The states that the folder may be in: more than one after a kill.
        let mut states: Vec<State> = Vec::new();
        for n in 0..steps {
            let draw = |k: u64, most: usize| pick(100 * n + k, most);
            let asked = State {
                scans: usize::from(draw(0, 6) == 0),
                mask: draw(1, 2) == 0,
                settings: draw(2, 2),
                engine: draw(3, 2),
            };
            let all = [
                Step::Prep,
                Step::Run,
                Step::Sweep,
                Step::Sweep,
                Step::Estimate,
                Step::Estimate,
                Step::Report,
                Step::Killed,
            ];
            let step = if n == 0 { Step::Prep } else { all[draw(4, all.len())] };
            told.push(format!("{step:?} {asked:?}"));
            if step == Step::Killed {
                self.kill(asked, &case, draw(5, 4000) as u64);
                states.push(asked);
                states.extend(states.clone().iter().map(|state| State { settings: asked.settings, ..*state }));
                continue;
            }
            let Some(printed) = self.numbers(step, asked, &case) else {
                tally.refused += 1;
                continue;
            };
            let makes = matches!(step, Step::Prep | Step::Run);
            let may_be: Vec<State> = match step {
                _ if makes => vec![asked],
                Step::Report => states.clone(),
                _ => states.iter().map(|state| State { settings: asked.settings, ..*state }).collect(),
            };
            let agreeing: Vec<State> = may_be.into_iter().filter(|state| self.agrees(step, *state, &printed)).collect();
            if agreeing.is_empty() {
                tally.wrong.push(format!("seed {seed}: {}", told.join(", ")));
            } else {
                tally.right += 1;
            }
            if makes {
                states = vec![asked];
            } else if !agreeing.is_empty() {
                states = agreeing;
            }
        }
        std::fs::remove_dir_all(&case).ok();
        tally
    }

    /// Begins a run and kills it.
    fn kill(&self, state: State, case: &str, after_ms: u64) {
        let words = self.arguments(Step::Killed, state, case);
        let mut child = Command::new(&self.program)
            .args(words)
            .arg("-q")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(after_ms));
        child.kill().ok();
        child.wait().unwrap();
    }
}

/// What a preparation alone says.
fn outline(outcome: &Value) -> Value {
    let mut outline = outcome.clone();
    for name in
        ["samples", "estimate", "best_sample", "tissues", "rest_rmse_mm", "rest_surface_distance_mm", "warnings"]
    {
        outline[name] = Value::Null;
    }
    for name in ["reference", "noise_floor", "loads"] {
        outline[name] = Value::Null;
    }
    outline
}

/// Samples and estimate of an outcome, each as in a fresh folder; what is not there agrees.
fn parts_agree(bench: &mut Bench, state: State, outcome: &Value) -> bool {
    let all = outcome["samples"].as_array().cloned().unwrap_or_default();
    let samples: Vec<&Value> = all.iter().filter(|sample| sample["id"] != "estimate").collect();
    let swept = samples.is_empty() || {
        let fresh = bench.fresh(Step::Sweep, state);
        samples == fresh["samples"].as_array().unwrap().iter().collect::<Vec<_>>()
            && outcome["rest_rmse_mm"] == fresh["rest_rmse_mm"]
    };
    let estimate = &outcome["estimate"];
    swept && (estimate.is_null() || *estimate == bench.fresh(Step::Estimate, state))
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &target);
        } else {
            std::fs::copy(&path, &target).unwrap();
        }
    }
}

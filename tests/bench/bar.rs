//! One bar of an issue: what was asked, what was measured.

use std::collections::BTreeMap;
use std::path::Path;

/// A named bar with its measured figure.
#[allow(clippy::struct_field_names, reason = "the word of the issues")]
pub struct Bar {
    /// Short name, starting with the room.
    pub name: String,
    /// What was asked, in words.
    pub bar: String,
    /// What was measured, in words, with units.
    pub measured: String,
    /// Whether the measurement meets the bar.
    pub met: bool,
}

impl Bar {
    /// A bar with its measurement.
    pub fn new(name: &str, bar: &str, measured: impl Into<String>, met: bool) -> Self {
        Self { name: name.to_owned(), bar: bar.to_owned(), measured: measured.into(), met }
    }
}

/// The folder with measuring data (`HGM_BENCH_DATA`), or `None`, in which case the caller says what it skips.
pub fn data() -> Option<std::path::PathBuf> {
    std::env::var_os("HGM_BENCH_DATA").map(Into::into)
}

/// The numbers of a list such as `3,7` or `20-39,41`.
pub fn numbers(list: &str) -> Vec<u64> {
    let number = |text: &str| text.parse::<u64>().unwrap_or_else(|_| panic!("`{text}` of `{list}` is no number"));
    let range = |text: &str| {
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        number(first)..=number(last)
    };
    list.split(',').flat_map(range).collect()
}

/// Processor seconds of this process so far (user and system).
pub fn cpu_seconds() -> f64 {
    ticks("/proc/self/stat").unwrap_or(f64::NAN)
}

/// Kernel ticks are 1/100 s on every Linux that distributions ship.
fn ticks(path: &str) -> Option<f64> {
    let text = std::fs::read_to_string(path).ok()?;
    let fields: Vec<&str> = text.rsplit(')').next()?.split_whitespace().collect();
    Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
}

/// A finished run of the program.
pub struct Finished {
    /// Exit code 0.
    pub ok: bool,
    /// Wall time, s.
    pub wall_s: f64,
    /// Processor time, s.
    pub cpu_s: f64,
    /// Largest resident memory, GB.
    pub peak_gb: f64,
    /// Standard output.
    pub printed: String,
}

/// Runs the release program and watches its time and memory.
pub fn run_hgm(arguments: &[&str]) -> Finished {
    let begin = std::time::Instant::now();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_hgm"))
        .args(arguments)
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("the program is built with the benchmark");
    // Read while it runs: a pipe that is full would stop it.
    let stdout = child.stdout.take();
    let reader = std::thread::spawn(move || {
        let mut printed = String::new();
        if let Some(mut stdout) = stdout {
            std::io::Read::read_to_string(&mut stdout, &mut printed).ok();
        }
        printed
    });
    let folder = format!("/proc/{}", child.id());
    let (mut cpu_s, mut peak_gb) = (0.0, 0.0);
    let status = loop {
        if let Some(seconds) = ticks(&format!("{folder}/stat")) {
            cpu_s = seconds;
        }
        let status = std::fs::read_to_string(format!("{folder}/status")).unwrap_or_default();
        let peak =
            status.lines().find_map(|l| l.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok());
        peak_gb = peak.map_or(peak_gb, |kb: f64| kb / 1e6);
        match child.try_wait().expect("the program can be waited for") {
            Some(status) => break status,
            None => std::thread::sleep(std::time::Duration::from_millis(50)),
        }
    };
    let printed = reader.join().unwrap_or_default();
    Finished { ok: status.success(), wall_s: begin.elapsed().as_secs_f64(), cpu_s, peak_gb, printed }
}

/// Wall time of a run that must succeed.
pub fn wall(name: &str, seconds: f64, run: &Finished) -> Bar {
    Bar::new(
        &format!("{name}, time"),
        &format!("<= {seconds:.0} s on 2 cores, exit 0"),
        format!("{:.1} s wall, {:.1} CPU-s, {}", run.wall_s, run.cpu_s, if run.ok { "exit 0" } else { "failed" }),
        run.ok && run.wall_s <= seconds,
    )
}

/// Peak memory of a run.
pub fn memory(name: &str, gigabytes: f64, run: &Finished) -> Bar {
    Bar::new(
        &format!("{name}, peak memory"),
        &format!("<= {gigabytes} GB"),
        format!("{:.2} GB", run.peak_gb),
        run.peak_gb <= gigabytes,
    )
}

/// A small synthetic patient below a folder: its scans before and after.
pub fn small_patient(folder: &Path) -> [String; 2] {
    let scans = folder.join("scans").display().to_string();
    assert!(run_hgm(&["synth", "-q", "--spacing-mm", "2", "--seed", "5", "-o", &scans]).ok, "a patient to run");
    ["pre", "post"].map(|scan| format!("{scans}/{scan}.nii.gz"))
}

/// Every file below a folder, by its path there.
pub fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
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

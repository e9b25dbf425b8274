//! The command line as scripts and hands use it: `--json`, interruption, colours.

use crate::job::{CHEAP, contents, output, program, sample};
use crate::made::{copy, finished_phantom, prepared_pair};
use crate::population::of_brains;
use crate::python::python_file;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Every command and subcommand, from the man pages' names.
fn every_command(folder: &Path) -> BTreeSet<String> {
    let pages = folder.join("man");
    assert!(output(&["man", "-o", pages.to_str().unwrap()]).status.success());
    let name =
        |file: &String| file.strip_prefix("hgm-").and_then(|f| f.strip_suffix(".1")).map(|f| f.replace('-', " "));
    let mut names: BTreeSet<String> = contents(&pages).keys().filter_map(name).collect();
    // A level of BIDS is an argument, but it prints a document of its own; `gp` and `law` only hold others.
    names.extend(["bids participant", "bids group"].map(str::to_owned));
    for holder in ["bids", "gp", "law", "population"] {
        assert!(names.remove(holder));
    }
    // The bundled demo is run and checked by `./run test` itself.
    assert!(names.remove("demo"));
    names
}

const SCENARIO: &str = r#"
fixed = ["base"]
[materials.grey_matter]
law = "neo-hookean"
shear_modulus_pa = 1370.0
poisson_ratio = 0.45
[materials.white_matter]
law = "neo-hookean"
shear_modulus_pa = 990.0
poisson_ratio = 0.45
[loads]
gravity_m_per_s2 = [0.0, 0.0, -9.81]
density_kg_per_m3 = 30.0
"#;

#[test]
fn slow_what_every_command_prints_with_json_is_one_document_that_the_schema_describes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let mut checks: Vec<String> = Vec::new();
    let mut prints = |command: &str, arguments: &[&str]| {
        let result = output(&[arguments, &["--json"]].concat());
        let said = String::from_utf8_lossy(&result.stderr).into_owned();
        assert_eq!(result.status.success(), command != "error", "{command}: {said}");
        assert!(!result.stdout.contains(&0x1b) && !said.contains(['\x1b', '\r']), "{command}: colours in a pipe");
        let file = at(&format!("{}-{}.json", checks.len(), command.replace(' ', "-")));
        std::fs::write(&file, result.stdout).unwrap();
        checks.push(format!("{command}={file}"));
    };
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let (pre, post) = (pre.to_str().unwrap(), post.to_str().unwrap());
    for session in ["preop", "postop"] {
        let anat = folder.path().join(format!("study/sub-01/ses-{session}/anat"));
        std::fs::create_dir_all(&anat).unwrap();
        let scan = if session == "preop" { pre } else { post };
        std::fs::copy(scan, anat.join(format!("sub-01_ses-{session}_T1w.nii.gz"))).unwrap();
    }
    let (study, out, case) = (at("study"), at("out"), at("out/sub-01/hgm"));
    let bids = ["bids", &study, &out, "participant"];
    std::fs::write(at("scenario.toml"), SCENARIO).unwrap();

    prints("error", &["report", &at("nowhere")]);
    prints("doctor", &["doctor"]);
    prints("schema", &["schema"]);
    prints("settings", &["settings"]);
    prints("layout", &["layout"]);
    prints("completions", &["completions", "fish"]);
    prints("man", &["man", "-o", &at("pages")]);
    prints("synth", &["synth", "--spacing-mm", "4", "-o", &at("synth")]);
    prints("gp studies", &["gp", "studies"]);
    prints("gp sample", &["gp", "sample", "--task", "hyperelastic-white", "-o", &at("gp")]);
    prints("gp sample", &["gp", "sample", "--task", "hyperelastic-grey", "--draws", "3", "-o", &at("gp")]);
    prints("gp show", &["gp", "show", "--published", "-o", &at("gp")]);
    prints("gp paper", &["gp", "paper", "--cells", "3000", "-o", &at("paper")]);
    prints("gp fit", &["gp", "fit", "--starts", "1", "-o", &at("gp")]);
    let study_level = ["--model", "study-level", "-o", &at("gp")];
    prints("gp fit", &[&["gp", "fit"], &study_level[..]].concat());
    let fitted = at("gp/study-level.toml");
    prints("gp sample", &[&["gp", "sample", "--draws", "3", "--hyperparameters", &fitted], &study_level[..]].concat());
    prints("gp show", &[&["gp", "show", "--hyperparameters", &fitted], &study_level[..]].concat());
    prints("law fit", &["law", "fit", "--literature", "3"]);
    prints("register", &["register", post, pre, "-o", &at("x.txt")]);
    prints("segment", &[&["segment", pre, "-o", &at("dseg.nii.gz")], &CHEAP[..]].concat());
    prints("bids participant", &[&bids[..], &["--dry-run"]].concat());
    prepared_pair(Path::new(&case));
    copy(&finished_phantom()[0], &folder.path().join("phantom"));
    prints("prep", &[&["prep", pre, post, "-o", &case], &CHEAP[..]].concat());
    prints("sweep", &["sweep", &case, "--shard", "1/2"]);
    prints("sweep", &["sweep", &case]);
    prints("reduce", &["reduce", &case]);
    prints("run", &[&["run", pre, post, "-o", &case], &CHEAP[..]].concat());
    prints("why", &[&["why", &case], &CHEAP[..]].concat());
    prints("bids participant", &[&bids, &CHEAP[..]].concat());
    prints("bids group", &["bids", &study, &out, "group"]);
    prints("estimate", &["estimate", &case]);
    for (name, mean) in [("a.toml", 6.4), ("b.toml", 6.6)] {
        std::fs::write(at(name), of_brains(&[mean])).unwrap();
    }
    prints("population merge", &["population", "merge", &at("a.toml"), &at("b.toml"), "-o", &at("both.toml")]);
    prints("population show", &["population", "show", &at("both.toml")]);
    prints("compare", &["compare", &case]);
    prints("report", &["report", &case]);
    let plan = sample("truth/resected_pre.nii.gz").display().to_string();
    let planned = ["predict", pre, "-o", &at("planned"), "--resection", &plan, "--draws", "16", "--checks", "0"];
    prints("predict", &[&planned[..], &CHEAP[..]].concat());
    for (name, points) in [("pre.csv", "x,y,z\n20,-10,30\n-20,-10,30\n"), ("post.csv", "x,y,z\n15,-5,31\n-23,-8,25\n")]
    {
        std::fs::write(at(name), points).unwrap();
    }
    prints("warp", &["warp", &case, &at("pre.csv"), "-o", &at("warped.csv")]);
    prints("evaluate", &["evaluate", &case, "--landmarks", &at("pre.csv"), "--landmarks-post", &at("post.csv")]);
    prints("evaluate", &["evaluate", &at("planned"), "--against", &case]);
    prints(
        "mesh",
        &[&["mesh", &format!("{case}/anat/pre_space-MNI_dseg.nii.gz"), "-o", &at("m.vtu")], &CHEAP[..]].concat(),
    );
    let phantom = ["phantom", "--include-reference", "--mesher", "lattice", "--cells", "8000", "-o"];
    prints("phantom", &[&phantom[..], &[&at("phantom")]].concat());
    let posed = [&at("phantom/mesh/rest.vtu")[..], &at("scenario.toml")];
    std::fs::write(at("session.jsonl"), recording(posed.map(Path::new))).unwrap();
    prints("live", &["live", posed[0], posed[1], "--replay", &at("session.jsonl"), "-o", &at("live.vtu")]);
    prints("simulate", &["simulate", &at("phantom/mesh/rest.vtu"), &at("scenario.toml"), "-o", &at("s.vtu")]);
    let leaning = "[[contact]]\nset = 'superior'\nwall = { shape = 'own-surface' }\n\
                   [[tethers]]\nset = 'superior'\nstiffness_pa_per_mm = 5.0\n";
    std::fs::write(at("leaning.toml"), format!("{SCENARIO}{leaning}")).unwrap();
    prints("simulate", &["simulate", &at("phantom/mesh/rest.vtu"), &at("leaning.toml"), "-o", &at("leaning.vtu")]);

    let printed = checks.iter().filter_map(|check| check.split_once('=')).map(|(command, _)| command.to_owned());
    let printed: BTreeSet<String> = printed.filter(|command| command != "error").collect();
    assert_eq!(printed, every_command(folder.path()));
    let schema = folder.path().join("schema.json");
    std::fs::write(&schema, output(&["schema"]).stdout).unwrap();
    let check = |checks: &[String]| {
        let words: Vec<&str> =
            [schema.to_str().unwrap()].into_iter().chain(checks.iter().map(String::as_str)).collect();
        python_file(folder.path(), "tests/json/check.py", &words)
    };
    let (code, wrong, complaint) = check(&checks);
    assert_eq!(code, 0, "{wrong}{complaint}");
    // The check is awake: one command's document is not another's.
    let swapped = checks[1].replace("doctor=", "report=");
    assert_eq!(check(&[swapped]).0, 1);

    let words = ["simulate", &at("phantom/mesh/rest.vtu"), &at("scenario.toml"), "-o", &at("t.vtu")];
    let shown = on_terminal(&words);
    assert!(shown.contains("(left "), "a terminal sees the time left: {shown}");
}

/// A recorded session of three steps.
fn recording([mesh, scenario]: [&Path; 2]) -> String {
    let settings = hgm::workflow::Settings::default();
    let posed = hgm::workflow::posed_mesh(mesh, Some(scenario), &settings).unwrap();
    let body = hgm::live::LiveBody::of(posed, &settings.prior);
    hgm::live::Recording { steps: 3, ..hgm::live::Recording::new(&body) }.to_text()
}

/// What a command shows where it has a terminal: util-linux's `script` gives it one.
fn on_terminal(words: &[&str]) -> String {
    let command = format!("{} {}", program().display(), words.join(" "));
    let shown = Command::new("script").args(["-qec", &command, "/dev/null"]).env("TERM", "xterm").output().unwrap();
    String::from_utf8_lossy(&shown.stdout).into_owned()
}

#[test]
fn slow_an_interrupted_job_leaves_only_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let (fresh, masked) = (folder.path().join("fresh"), folder.path().join("masked"));
    prepared_pair(&masked);
    std::fs::remove_dir_all(masked.join("mesh")).unwrap();
    // Right after a stage, and among the files of one.
    let cases = [("-INT", 130, &fresh, ".stages/registration.manifest.json"), ("-TERM", 143, &masked, "mesh/rest.vtu")];
    for (signal, code, case, file) in cases {
        let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
        let mut command = Command::new(program());
        command.args(["run".as_ref(), pre.as_os_str(), post.as_os_str(), "-o".as_ref(), case.as_os_str()]);
        let mut job = command.args(CHEAP).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let begin = Instant::now();
        while !case.join(file).exists() {
            assert!(
                begin.elapsed() < Duration::from_secs(600) && job.try_wait().unwrap().is_none(),
                "{file} never came"
            );
            std::thread::sleep(Duration::from_millis(2));
        }
        assert!(Command::new("kill").args([signal, &job.id().to_string()]).status().unwrap().success());
        assert_eq!(job.wait().unwrap().code(), Some(code));
        let left = contents(case);
        assert!(left.contains_key(file));
        assert!(left.keys().all(|name| !name.ends_with(".part")), "{:?}", left.keys());
        for (name, bytes) in left.iter().filter(|(name, _)| name.ends_with(".json")) {
            assert!(serde_json::from_slice::<serde_json::Value>(bytes).is_ok(), "{name} is cut");
        }
    }
}

#[test]
fn a_reader_who_goes_away_is_no_fault() {
    let script = format!("{} schema | head -c 10; echo \"${{PIPESTATUS[0]}}\"", program().display());
    let ended = Command::new("bash").args(["-c", &script]).output().unwrap();
    assert!(String::from_utf8_lossy(&ended.stdout).ends_with("0\n"), "{ended:?}");
    assert!(ended.stderr.is_empty(), "{}", String::from_utf8_lossy(&ended.stderr));
}

#[test]
fn a_mistyped_command_is_told_what_may_be_meant() {
    for (word, meant) in [("estimat", "'estimate'"), ("fit", "`hgm gp fit` and `hgm law fit`")] {
        let said = output(&[word]);
        assert_eq!(said.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&said.stderr).contains(meant), "{said:?}");
    }
}

#[test]
fn an_option_of_the_mesh_is_refused_where_no_mesh_is_made() {
    for option in
        ["--cells=3000", "--edge-mm=3", "--mesher=lattice", "--edge-in=white_matter=1.5", "--edge-near=ventricle=0.5@8"]
    {
        let said = output(&["prep", "pre.nii.gz", "post.nii.gz", "--no-mesh", option]);
        assert_eq!(said.status.code(), Some(2), "{said:?}");
        let told = String::from_utf8_lossy(&said.stderr).into_owned();
        assert!(told.contains("--no-mesh") && told.contains(option.split('=').next().unwrap()), "{told}");
    }
}

#[test]
fn a_place_that_takes_no_file_is_told_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let (pre, post) = (sample("pre.nii.gz"), sample("post.nii.gz"));
    let (pre, post) = (pre.to_str().unwrap(), post.to_str().unwrap());
    let below = |name: &str| file.join(name).to_str().unwrap().to_owned();
    let begin = Instant::now();
    for words in [
        &["run", pre, post, "-o", &below("case")][..],
        &["register", pre, post, "-o", &below("x.txt")],
        &["segment", pre, "-o", &below("dseg.nii.gz")],
        &["phantom", "-o", &below("phantom")],
    ] {
        let said = output(words);
        assert_eq!(said.status.code(), Some(1), "{said:?}");
        assert!(String::from_utf8_lossy(&said.stderr).contains("cannot be written"), "{said:?}");
    }
    // A registration alone takes longer.
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
}

#[test]
fn a_terminal_has_colours_and_a_pipe_has_none() {
    let mistaken = output(&["fit", "--colour"]);
    assert_eq!(mistaken.status.code(), Some(2));
    assert!(!mistaken.stderr.contains(&0x1b));
    assert!(on_terminal(&["fit", "--colour"]).contains('\x1b'));
}

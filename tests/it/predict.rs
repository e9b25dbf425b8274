//! Before the operation: one scan and a plan from the command line to fields, targets and a page.

use crate::job::{CHEAP, contents, output, sample};
use crate::made::{copy, finished_pair};
use hgm::workflow::{Case, Place, Resection, Settings, Silent, posed_case};
use std::path::{Path, PathBuf};
use std::process::Output;

fn planned(case: &Path, more: &[&str]) -> Output {
    let pre = sample("pre.nii.gz");
    output(&[&["predict", pre.to_str().unwrap(), "-o", case.to_str().unwrap()], more, &CHEAP[..]].concat())
}

fn plan() -> PathBuf {
    sample("truth/resected_pre.nii.gz")
}

#[test]
fn what_cannot_be_planned_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let mask = plan().display().to_string();
    let at = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        folder.path().join(name).display().to_string()
    };
    let (open, far) = (at("open.stl", &triangles(3, 0.0)), at("far.stl", &triangles(4, 4000.0)));
    let other = at("shape.vtp", b"<VTKFile/>");
    let points = at("points.csv", b"x,y,z\n1,2,3\n");
    let brains =
        at("brains.toml", crate::population::of_brains(&[6.1, 6.3, 6.6, 6.4, 6.2, 6.5, 6.35, 6.45]).as_bytes());
    let one_tissue = ["--resection", &mask, "--population", &brains, "--tissues", "1", "--drained", "0.3"];
    let cases: [(&[&str], &[&str]); 23] = [
        (
            &["--resection", &mask, "--population", &brains, "--tissues", "2"],
            &["teaches `brain`", "`grey_matter` and `white_matter`", "`tissues = 1`", "--tissues"],
        ),
        (&one_tissue, &["100 kg/m3", "1040 kg/m3", "`drained`", "--population"]),
        (&["--resection", &open], &["open.stl", "the surface is open", "Close Holes", "--resection"]),
        (&["--resection", &far], &["far.stl", "is empty", "RAS+"]),
        (&["--resection", &other], &["shape.vtp", ".stl, .ply or .surf.gii", "--resection"]),
        (&["--resection", &points], &["points.csv", "without triangles", ".stl"]),
        (
            &["--resection-label", "7", "--dseg", &mask],
            &["resected_pre.nii.gz", "label 7", "it holds 1", "--resection-label"],
        ),
        (&["--resection-ellipsoid", "0,0,0,300,300,300"], &["outside the scan"]),
        (&["--resection", &mask, "--resection", &mask], &["given twice"]),
        (&["--resection", &mask, "--resection-ellipsoid", "9000,0,0,5,5,5"], &["is empty"]),
        (&["--resection", &mask, "--resection", &open], &["open.stl", "the surface is open"]),
        (&["--resection-ellipsoid", "1,2,3"], &["1,2,3", "x,y,z,rx,ry,rz", "--resection-ellipsoid"]),
        (&["--resection-ellipsoid", "1,2,3,4,5,0"], &["half axes above 0"]),
        (&["--resection-ellipsoid", "9000,0,0,5,5,5"], &["is empty", "--resection"]),
        (&["--resection", &mask, "--head", "0,0,0"], &["`0,0,0`", "supine, prone", "not all 0"]),
        (&["--resection", &mask, "--head", "left", "--head", "left"], &["`heads` is [left, left]", "none twice"]),
        (&["--resection", &mask, "--head", "0,-1,0", "--head", "0,-2,0"], &["`heads`", "none twice"]),
        (&["--resection", &mask, "--drained", "0"], &["`drained` is 0.0:", "above 0, at most 1"]),
        (&["--resection", &mask, "--drained", "1.5"], &["`drained`", "above 0, at most 1"]),
        (
            &["--resection", &mask, "--drained", "0.3", "--fluid-below", "20"],
            &["`fluid_level.below_top_mm` is 20.0", "`drained`", "give one of the two"],
        ),
        (&["--resection", &mask, "--fluid-below", "-5"], &["`fluid_level.below_top_mm` is -5.0", "just covered"]),
        (&["--resection", &mask, "--fluid-below", "400"], &["`fluid_level.below_top_mm`", "300 mm"]),
        (&["--resection", &mask, "--poisson-log-sd", "0"], &["`poisson_log_sd` is 0.0", "above 0, at most 2"]),
    ];
    for (n, (more, words)) in cases.into_iter().enumerate() {
        let case = folder.path().join(n.to_string());
        let ended = planned(&case, more);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{more:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)) && said.trim().lines().count() == 1, "{more:?}: {said}");
        assert!(!case.exists(), "{more:?} left something behind");
    }
    // A folder of several plans is no case of one.
    let plans = folder.path().join("plans");
    std::fs::create_dir_all(plans.join("plan-1")).unwrap();
    let ended = planned(&plans, &["--resection", &mask]);
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.code() == Some(3) && said.contains("several plans") && said.contains("-o"), "{said}");
    assert_eq!(contents(&plans).len(), 0);
    let none = planned(&folder.path().join("none"), &[]);
    assert_eq!(none.status.code(), Some(2));
    let unmapped = planned(&folder.path().join("none"), &["--resection-label", "7"]);
    assert_eq!(unmapped.status.code(), Some(2));
}

/// The first faces of a tetrahedron as a binary STL, moved along x (mm): four close it.
fn triangles(faces: usize, by: f32) -> Vec<u8> {
    let corners = [[0.0f32, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 20.0]];
    let mut bytes = vec![b' '; 80];
    bytes.extend((faces as u32).to_le_bytes());
    for face in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].into_iter().take(faces) {
        bytes.extend([0u8; 12]);
        for [x, y, z] in face.map(|n: usize| corners[n]) {
            bytes.extend([x + by, y, z].iter().flat_map(|v| v.to_le_bytes()));
        }
        bytes.extend([0u8; 2]);
    }
    bytes
}

#[test]
fn slow_a_known_level_and_poissons_ratio_are_drawn_and_told_and_a_seed_gives_other_draws() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    let mask = plan().display().to_string();
    let asked = ["--resection", &mask, "--draws", "16", "--head", "supine", "--head", "sitting", "--json"];
    let told = |more: &[&str]| -> serde_json::Value {
        let ended = planned(&case, &[&asked[..], more].concat());
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        serde_json::from_slice(&ended.stdout).unwrap()
    };
    // Deeper than this brain, which only its labels tell: what was there before stays.
    let plain = told(&[]);
    let before = contents(&case);
    let ended = planned(&case, &[&asked[..], &["--fluid-below", "280"]].concat());
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.code() == Some(3) && said.contains("mm deep") && said.contains("--fluid-below"), "{said}");
    assert!(contents(&case) == before);
    assert!(plain["heads"][0]["shares"].get("poisson").is_none() && plain["heads"][0].get("fluid").is_none());

    let found = told(&["--fluid-below", "30", "--poisson-log-sd", "0.7"]);
    for head in found["heads"].as_array().unwrap() {
        let shares = head["shares"].as_object().unwrap();
        assert!(
            (shares.values().map(|s| s.as_f64().unwrap()).sum::<f64>() - 1.0).abs() < 1e-6
                && shares.contains_key("poisson")
        );
        assert_eq!(head["fluid"]["below_top_mm"], 30.0);
        assert!((0.01..0.6).contains(&head["fluid"]["drained"].as_f64().unwrap()), "{}", head["fluid"]);
    }
    let names: Vec<&str> = found["unknowns"].as_array().unwrap().iter().map(|u| u["name"].as_str().unwrap()).collect();
    assert!(
        names.contains(&"Poisson's ratio") && names.contains(&"fluid below the brain's highest point, mm"),
        "{names:?}"
    );
    let page = std::fs::read_to_string(case.join("report.html")).unwrap();
    for words in ["Where the fluid stands", "Poisson's ratio", "30 mm below the brain's highest point"] {
        assert!(page.contains(words), "{words}");
    }

    for head in found["heads"].as_array().unwrap() {
        // Each draw in a fluid is solved; one that is too heavy and soft for an equilibrium is read from the surface.
        let [solved, of] = ["solved", "of"].map(|which| head["draws_solved"][which].as_u64().unwrap());
        assert!(2 * solved > of && of >= 16, "{}", head["draws_solved"]);
    }
    // A body that is stepped by hand lies in the same fluid.
    let own = Case::open(&case).unwrap();
    let settings = Settings::resolve([&own.settings().unwrap()]).unwrap();
    let posed = posed_case(&Place::from(case.as_path()), &settings, Resection::Done, &mut Silent).unwrap();
    assert!(posed.scenario.loads.csf.is_some() && posed.scenario.loads.density_kg_per_m3 > 1000.0);

    assert_eq!(told(&["--seed", "0"]), plain, "seed 0 has the points that no seed has");
    let (one, other) = (told(&["--seed", "5"]), told(&["--seed", "6"]));
    assert!(one["heads"] != plain["heads"] && one["heads"] != other["heads"]);
}

#[test]
fn slow_a_plan_becomes_fields_targets_and_a_page_the_same_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    // The page is headed by the folder's name.
    let (case, again) = (folder.path().join("case"), folder.path().join("again").join("case"));
    let targets = folder.path().join("targets.csv");
    std::fs::write(&targets, "x,y,z\n20,-10,30\n-30,0,20\n").unwrap();
    let (mask, targets) = (plan().display().to_string(), targets.display().to_string());
    let asked =
        ["--resection", &mask, "--targets", &targets, "--head", "supine", "--head", "prone", "--draws", "32", "--json"];
    let ended = planned(&case, &[&asked[..], &["--threads", "2"]].concat());
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let found: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    let head = |n: usize| &found["heads"][n];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    assert_eq!(found["heads"].as_array().unwrap().len(), 2);
    // Whoever lies on the back is pulled to the back of the head, on the face to the face.
    assert!(number(&head(0)["down"][1]) < -0.8 && number(&head(1)["down"][1]) > 0.8);
    for n in 0..2 {
        let shares = head(n)["shares"].as_object().unwrap();
        let sum: f64 = shares.values().map(number).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{shares:?}");
        assert!(
            number(&head(n)["largest_mm"]) > 0.0
                && number(&head(n)["reach95_largest_mm"]) > number(&head(n)["largest_mm"])
        );
        let target = &head(n)["targets"][0];
        assert!(number(&target["half_axes_mm"][0]) > 0.0 && (0.0..=1.0).contains(&number(&target["over_threshold"])));
    }
    // The cheap settings hold the brain at its base alone: what is read from the surface is what is solved.
    let check = &found["checks"][0];
    let off = number(&check["difference_rms_mm"]) / number(&check["displacement_rms_mm"]);
    assert!(check["solves"] == 2 && off < 0.05, "{check}");
    let page = std::fs::read_to_string(case.join("report.html")).unwrap();
    for words in
        ["Expected brain shift", "What is assumed", "Research software", "head prone", "not for surgical planning"]
    {
        assert!(page.contains(words), "{words}");
    }
    let files = contents(&case);
    for state in ["predicted", "predicted-prone"] {
        for kind in ["displacement", "sd", "reach50", "reach95", "probability", "mask"] {
            let file = format!("xfm/from-pre_to-deformed_desc-{state}_{kind}.nii.gz");
            assert!(files.contains_key(&file), "{file}");
        }
        assert!(files.contains_key(&format!("sim/{state}.vtu")));
    }

    // The same bytes on one thread, and nothing is made again where nothing has changed.
    copy(&case, &again);
    std::fs::remove_file(again.join(".stages/predict.manifest.json")).unwrap();
    let one = planned(&again, &[&asked[..], &["--threads", "1"]].concat());
    assert!(one.status.success() && one.stdout == ended.stdout);
    let (first, second) = (contents(&case), contents(&again));
    assert_eq!(first.keys().collect::<Vec<_>>(), second.keys().collect::<Vec<_>>());
    for (name, bytes) in &first {
        assert!(*bytes == second[name], "{name} differs");
    }
    refuses_in_the_case(&case, folder.path());
}

/// What only a segmented scan can tell, and what a case of one scan is no case for.
fn refuses_in_the_case(case: &Path, folder: &Path) {
    let kept = contents(case);
    let far = folder.join("far.csv");
    std::fs::write(&far, "x,y,z\n20,-10,30\n500,0,0\n").unwrap();
    let (mask, far) = (plan().display().to_string(), far.display().to_string());
    let cases: [(&[&str], &[&str]); 4] = [
        (&["--resection", &mask, "--targets", &far], &["far.csv", "target 2", "outside the head"]),
        (&["--resection-ellipsoid", "60,51,39,9,9,9"], &["outside the brain"]),
        (&["--resection-ellipsoid", "-2,-23,0,60,75,60"], &["more than half of the brain"]),
        (&["--resection-ellipsoid", "-2,-20,30,78,100,9"], &["would cut loose"]),
    ];
    for (more, words) in cases {
        let ended = planned(case, more);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{more:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{more:?}: {said}");
    }
    assert!(contents(case) == kept, "a refused plan leaves the case as it was, its settings too");
    let fresh = folder.join("fresh");
    let ended = planned(&fresh, &["--resection", &mask, "--targets", &far, "--head", "left"]);
    assert!(ended.status.code() == Some(3) && !fresh.exists(), "a refused plan leaves no folder");
    let estimate = output(&["estimate", case.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&estimate.stderr).into_owned();
    assert!(estimate.status.code() == Some(3) && said.contains("before an operation"), "{said}");
}

#[test]
fn slow_a_prediction_is_held_against_what_was_seen_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let (case, pair) = (folder.path().join("plan"), finished_pair());
    let mask = plan().display().to_string();
    let ended = planned(&case, &["--resection", &mask, "--draws", "32", "--checks", "0", "-q"]);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let words = |path: &Path| path.to_str().unwrap().to_owned();
    let (case_word, pair_word) = (words(&case), words(&pair));
    let found = evaluated(&[&case_word, "--against", &pair_word]);
    let field = &found["heads"][0]["field"];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    assert!(number(&field["places"]) > 100.0 && number(&field["seen_sd_median_mm"]) > 0.0, "{found}");
    let cover = &field["coverage_with_error"];
    for [less, more] in [["reach50", "reach95"], ["ellipsoid50", "ellipsoid95"]] {
        let shares = [less, more].map(|name| number(&cover[name]));
        assert!(shares[0] <= shares[1] && (0.0..=1.0).contains(&shares[1]), "{cover}");
    }
    // The pair was operated on with this mask.
    assert!(number(&found["taken"]["dice"]) > 0.5, "{found}");
    let page = std::fs::read_to_string(case.join("report.html")).unwrap();
    assert!(page.contains("Predicted against seen") && page.contains("Many patients do"));

    // Landmarks that stay where they are: the forecast is off by all that it foretold.
    let points = folder.path().join("points.csv");
    std::fs::write(&points, "name,x,y,z\nanna,20,-10,30\nberta,-30,0,20\n").unwrap();
    let points_word = words(&points);
    let pose = folder.path().join("same.txt");
    std::fs::write(&pose, "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").unwrap();
    let still = [&case_word, "--landmarks", &points_word, "--landmarks-post", &points_word, "--post-to-pre"];
    let still = evaluated(&[&still[..], &[&words(&pose)]].concat());
    for landmark in still["heads"][0]["landmark"].as_array().unwrap() {
        assert_eq!(
            (&landmark["seen_mm"], &landmark["error_mm"]),
            (&0.0.into(), &landmark["expected_mm"]),
            "{landmark}"
        );
    }
    assert!(still["heads"][0]["landmark"][0]["name"] == "anna");
    let kept = std::fs::read_to_string(case.join("sim/evaluation.json")).unwrap();
    assert!(!kept.contains("anna") && !kept.contains("points.csv"), "no name of the user's in the case");

    // What cannot be compared is refused, and the evaluation stays.
    let other = folder.path().join("other");
    let patient = crate::made::synthetic_patient()[0].display().to_string();
    let away = ["--resection-ellipsoid", "20,0,40,9,9,9", "--draws", "16", "--checks", "0", "-q"];
    let ended = output(&[&["predict", &patient, "-o", &words(&other)], &away[..], &CHEAP[..]].concat());
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let cases: [(Vec<&str>, &[&str]); 6] = [
        (vec![&case_word], &["nothing says what was seen", "--against"]),
        (vec![&pair_word], &["case of two scans", "--landmarks"]),
        (vec![&pair_word, "--against", &case_word], &["no prediction"]),
        (vec![&case_word, "--against", &case_word], &["no case of two scans"]),
        (vec![other.to_str().unwrap(), "--against", &pair_word], &["another pre-operative scan"]),
        (
            vec![&case_word, "--landmarks", &points_word, "--landmarks-post", &points_word],
            &["points.csv", "--post-to-pre", "--against"],
        ),
    ];
    for (arguments, words) in cases {
        let ended = output(&[&["evaluate"], &arguments[..]].concat());
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{arguments:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{arguments:?}: {said}");
    }
    assert_eq!(std::fs::read_to_string(case.join("sim/evaluation.json")).unwrap(), kept);

    // Nor is a file of the case that was changed since, whatever would be made of it.
    let draws = case.join("sim/predicted_draws.csv");
    let written = std::fs::read_to_string(&draws).unwrap();
    let last = written.trim_end().rfind(',').unwrap();
    std::fs::write(&draws, format!("{},9.5\n", &written[..last])).unwrap();
    for command in ["evaluate", "report"] {
        let against: &[&str] = if command == "evaluate" { &["--against", &pair_word] } else { &[] };
        let ended = output(&[&[command, &case_word], against].concat());
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{command}: {said}");
        assert!(said.contains("sim/predicted_draws.csv") && said.contains("was changed"), "{command}: {said}");
    }
    std::fs::write(&draws, written).unwrap();
    assert_eq!(evaluated(&[&case_word, "--against", &pair_word])["against"], found["against"]);
}

#[test]
fn slow_a_pair_takes_up_its_prediction_to_the_same_bytes_and_holds_it_against_what_was_seen() {
    let folder = tempfile::tempdir().unwrap();
    let words = |path: &Path| path.to_str().unwrap().to_owned();
    let (plan_folder, mask) = (folder.path().join("plan"), plan().display().to_string());
    let ended = planned(&plan_folder, &["--resection", &mask, "--draws", "16", "--checks", "0", "-q"]);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let [pre, post] = ["pre.nii.gz", "post.nii.gz"].map(|scan| words(&sample(scan)));
    let taken_up = words(&plan_folder);
    let run = |name: &str, more: &[&str]| {
        let case = folder.path().join(name).join("case");
        let place = words(&case);
        (output(&[&["run", &pre, &post, "-o", &place, "-v", "--threads", "1"], more, &CHEAP[..]].concat()), case)
    };
    let same = |first: &Path, second: &Path| {
        let (first, second) = (contents(first), contents(second));
        assert_eq!(first.keys().collect::<Vec<_>>(), second.keys().collect::<Vec<_>>());
        for (name, bytes) in &first {
            assert!(*bytes == second[name], "{name} differs");
        }
    };
    let mesh_is_theirs =
        |ended: &Output| String::from_utf8_lossy(&ended.stderr).contains("the mesh is the prediction's");

    // Another tissue was taken than was planned: everything before the operation is taken up, and a mesh made of its own.
    let (ended, case) = run("taken", &["--prediction", &taken_up]);
    let said = String::from_utf8_lossy(&ended.stdout).into_owned();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(said.contains("planned") && said.contains("plan/report.html"), "{said}");
    assert!(!mesh_is_theirs(&ended) && plan_folder.join("sim/evaluation.json").exists());
    same(&finished_pair(), &case);

    // The planned tissue was taken.
    let as_planned = ["--resected-mask", mask.as_str()];
    let (ended, without) = run("alone", &as_planned);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    // A mask of what was taken says what is gone at rest: where the cavity's walls are now is what the second scan shows, as ever.
    const CAVITY: &str = "anat/post_space-MNI_label-cavity_mask.nii.gz";
    assert_eq!(contents(&without)[CAVITY], contents(&finished_pair())[CAVITY]);
    let (ended, case) = run("planned", &[&as_planned[..], &["--prediction", &taken_up]].concat());
    assert!(ended.status.success() && mesh_is_theirs(&ended), "{}", String::from_utf8_lossy(&ended.stderr));
    same(&without, &case);
    let found: serde_json::Value = serde_json::from_slice(&contents(&plan_folder)["sim/evaluation.json"]).unwrap();
    assert_eq!(found["taken"]["dice"], 1.0, "{found}");

    // What it was not made for is refused before anything is written.
    let other = folder.path().join("other");
    let patient = crate::made::synthetic_patient()[0].display().to_string();
    let away = ["--resection-ellipsoid", "20,0,40,9,9,9", "--draws", "16", "--checks", "0", "-q"];
    let ended = output(&[&["predict", &patient, "-o", &words(&other)], &away[..], &CHEAP[..]].concat());
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let finer = folder.path().join("finer.toml");
    let cheap = std::fs::read_to_string(CHEAP[1]).unwrap();
    std::fs::write(&finer, cheap.replace("iterations = 10", "iterations = 11")).unwrap();
    let brain = words(&plan_folder.join("anat/pre_space-native_desc-brain_mask.nii.gz"));
    let cases: [(&Path, &[&str], &[&str]); 5] = [
        (&other, &CHEAP, &["another pre-operative scan", "leave --prediction out"]),
        (&case, &CHEAP, &["no prediction", "hgm predict"]),
        (folder.path(), &CHEAP, &["not a case folder"]),
        (
            &plan_folder,
            &["--config", finer.to_str().unwrap()],
            &["segment.iterations", "11", "--config", "settings.toml"],
        ),
        (&plan_folder, &["--brain-mask", &brain, CHEAP[0], CHEAP[1]], &["brain mask", "leave --prediction out"]),
    ];
    for (prediction, more, found) in cases {
        let case = folder.path().join("none");
        let asked = ["run", &pre, &post, "-o", &words(&case), "--prediction", &words(prediction)];
        let ended = output(&[&asked[..], more].concat());
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{more:?}: {said}");
        assert!(found.iter().all(|w| said.contains(w)) && said.trim().lines().count() == 1, "{more:?}: {said}");
        assert!(!case.exists(), "{more:?} left something behind");
    }
}

fn evaluated(arguments: &[&str]) -> serde_json::Value {
    let ended = output(&[&["evaluate", "--json"], arguments].concat());
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    serde_json::from_slice(&ended.stdout).unwrap()
}

#[test]
fn slow_of_several_plans_each_is_a_case_and_the_one_that_moves_least_is_named_only_where_it_can_be_told() {
    let folder = tempfile::tempdir().unwrap();
    let all = folder.path().join("plans");
    let mask = plan().display().to_string();
    // The same piece, and a speck: what is taken decides.
    let small = "-39,10,-38,6,6,6";
    let ended = planned(
        &all,
        &["--resection", &mask, "--resection-ellipsoid", small, "--draws", "32", "--checks", "0", "--json", "-q"],
    );
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let found: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(found["plans"][0]["given"], "mask");
    assert_eq!(found["plans"][1]["given"], "ellipsoid");
    let head = &found["heads"][0];
    let least = head["least"].as_str().unwrap();
    let row = head["plans"].as_array().unwrap().iter().find(|row| row["plan"] != least).unwrap();
    let told = row["more_interval_95_cc"][0].as_f64().unwrap() > 0.0;
    assert_eq!(head["not_told_from"].as_array().unwrap().is_empty(), told, "{head}");
    assert_eq!(head["sentence"].as_str().unwrap().contains("cannot be told"), !told, "{head}");
    let text = std::fs::read_to_string(all.join("plans.json")).unwrap();
    assert!(!text.contains("resected_pre"), "no name of the user's in what is kept");
    // What all leave is a part of what each leaves, counted at voxels instead of in tetrahedra.
    assert!(found["left_by_all_cc"].as_f64().unwrap() > 100.0, "{found}");
    for row in head["plans"].as_array().unwrap() {
        let [all, own] = ["left_by_all_over_cc", "over_threshold_cc"].map(|name| row[name].as_f64().unwrap());
        assert!(all <= 1.02 * own + 0.1, "{row}");
    }
    assert_eq!(found["plans"][0]["prediction_sha256"].as_str().unwrap().len(), 64);
    let page = std::fs::read_to_string(all.join("plans.html")).unwrap();
    assert!(page.contains(head["sentence"].as_str().unwrap()));
    for plan in ["plan-1", "plan-2"] {
        assert!(all.join(plan).join("report.html").exists() && page.contains(plan), "{plan}");
    }
    // A plan of several is the same bytes as alone.
    let alone = folder.path().join("alone");
    let ended = planned(&alone, &["--resection-ellipsoid", small, "--draws", "32", "--checks", "0", "-q"]);
    assert!(ended.status.success());
    for file in ["sim/prediction.json", "sim/predicted_draws.csv", "anat/pre_space-native_dseg.nii.gz"] {
        let read = |case: &Path| std::fs::read(case.join(file)).unwrap();
        assert!(read(&alone) == read(&all.join("plan-2")), "{file}");
    }
    let again = planned(&alone, &["--resection", &mask, "--resection-ellipsoid", small]);
    let said = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.code() == Some(3) && said.contains("the case of one plan"), "{said}");
}

//! The generative model and the fits of laws from the command line.

use std::path::Path;
use std::process::{Command, Output};

fn hgm(arguments: &[&str]) -> Output {
    let program = std::env::var_os("HGM_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_hgm").into());
    Command::new(program).args(arguments).output().unwrap()
}

fn json(arguments: &[&str]) -> serde_json::Value {
    let output = hgm(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Exit code and message of a command that must not succeed.
fn refusal(arguments: &[&str]) -> (Option<i32>, String) {
    let output = hgm(arguments);
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn fitted_hyperparameters_are_read_back_by_sampling_and_resume() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("gp");
    let out = out.to_str().unwrap();
    let fit = ["gp", "fit", "--published", "-o", out, "--threads"];
    let first = json(&[&fit[..], &["2"]].concat());
    assert!(first["fit"]["negative_log_likelihood"].as_f64().unwrap() <= 7083.70);
    let file = first["hyperparameters"].as_str().unwrap();
    let before = text(Path::new(file));
    // On one thread, from the start again: the same bytes.
    let again = json(&[&fit[..], &["1", "--force"]].concat());
    assert_eq!((again["fit"].clone(), text(Path::new(file))), (first["fit"].clone(), before));

    let sample = ["gp", "sample", "--task", "hyperelastic-white", "-o", out];
    let published = json(&sample);
    let own = json(&[&sample[..], &["--hyperparameters", file]].concat());
    let middle = |v: &serde_json::Value| v["result"]["shear_modulus_pa"]["median"].as_f64().unwrap();
    assert_ne!(middle(&published), middle(&own));
    assert!((middle(&own) / middle(&published) - 1.0).abs() < 0.1, "both learnt from the same studies");
}

#[test]
fn draws_are_the_same_on_any_number_of_threads_and_each_gets_a_row() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        let arguments = ["gp", "sample", "--draws", "50", "--curves", "--spread", "study", "--stretches", "51"];
        json(&[&arguments[..], &["--seed", "4", "--threads", threads, "-o", out.to_str().unwrap()]].concat());
        (text(&out.join("draws-hyperelastic-healthy.csv")), text(&out.join("curves-hyperelastic-healthy.csv")))
    };
    let (materials, curves) = drawn("one", "1");
    assert_eq!(drawn("three", "3"), (materials.clone(), curves.clone()));
    assert_eq!((materials.lines().count(), curves.lines().count()), (51, 52));
    assert!(materials.lines().skip(1).all(|line| line.ends_with(",true")));
}

#[test]
fn show_writes_both_figures_the_table_and_the_papers_tests() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("paper");
    let shown = json(&["gp", "show", "--published", "-o", out.to_str().unwrap()]);
    let tests = shown["result"]["tests"].as_array().unwrap();
    let h: Vec<String> =
        tests.iter().map(|t| format!("{:.2}", t[1]["kruskal_wallis"]["h"].as_f64().unwrap())).collect();
    assert_eq!(h, ["14.59", "20.98", "15.17"]);
    assert!(tests.iter().all(|t| t[1]["friedman"]["p"].as_f64().unwrap() < 0.01));
    for figure in ["fig-2-posterior.svg", "fig-3-meta-models.svg"] {
        assert!(text(&out.join(figure)).starts_with("<svg xmlns="), "{figure}");
    }
    let table = text(&out.join("shear-moduli.csv"));
    assert_eq!(table.lines().count(), 13);
    let grey = table.lines().find(|line| line.starts_with("hyperelastic-grey,")).unwrap();
    // Granados et al., IJCARS 2021, Table 1: 525 Pa at -2 SD.
    assert!((grey.split(',').nth(1).unwrap().parse::<f64>().unwrap() - 525.0).abs() < 1.0);
    assert_eq!(refusal(&["gp", "show", "--models", "44,99", "-o", out.to_str().unwrap()]).0, Some(3));
}

#[test]
fn slow_every_figure_and_table_of_the_paper_is_made_in_one_command() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("paper");
    let made = json(&["gp", "paper", "--cells", "3000", "-o", out.to_str().unwrap()]);
    // Every printed modulus within a pascal, every printed statistic to its last digit.
    let moduli = made["result"]["moduli"].as_array().unwrap();
    let number = |row: &serde_json::Value, key: &str| row[key].as_f64().unwrap();
    assert_eq!(moduli.len(), 15);
    assert!(moduli.iter().all(|row| (number(row, "printed_pa") - number(row, "as_published_pa")).abs() < 0.7));
    let tests = made["result"]["tests"].as_array().unwrap();
    assert!(tests.iter().all(|t| (number(t, "printed_h") - number(&t["as_published"], "h")).abs() < 0.005));
    // Fig. 4: nine tasks of nine samples, and the nearest to the truth (333.28 Pa) is the best.
    let tasks = made["result"]["phantom"].as_array().unwrap();
    assert_eq!(tasks.len(), 9);
    assert_eq!(made["result"]["best_sample"], "hyperelastic-healthy-03");
    let figures = ["fig-2-posterior.svg", "fig-3-meta-models.svg", "fig-4-phantom.svg"];
    assert!(figures.iter().all(|figure| text(&out.join(figure)).starts_with("<svg xmlns=")));
    let page = text(&out.join("paper.md"));
    assert!(figures.iter().all(|figure| page.contains(figure)) && page.contains("hyperelastic-healthy-03"));
    assert_eq!(text(&out.join("table-1.csv")).lines().count(), 16);
    // Cells of 3,000 may leave out a sample without an equilibrium, never a whole task.
    let samples = tasks.iter().map(|task| task["samples"].as_array().unwrap().len()).sum::<usize>();
    assert_eq!(text(&out.join("fig-4-phantom.csv")).lines().count(), samples + 1);
}

#[test]
fn a_study_of_ones_own_moves_the_posterior_and_a_bad_row_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("mine.csv");
    let header = "id,region,kind,form,parameters,stretch_min,stretch_max\n";
    let out = folder.path().join("gp");
    let sample = ["gp", "sample", "--levels", "0", "-o", out.to_str().unwrap()];
    let with = [&sample[..], &["--studies", table.to_str().unwrap()]].concat();
    let modulus = |v: &serde_json::Value| v["result"]["shear_modulus_pa"]["median"].as_f64().unwrap();
    std::fs::write(&table, format!("{header}100,healthy,hyperelastic,neo-hookean,mu_pa=5000,0.6,1.4\n")).unwrap();
    assert!(modulus(&json(&with)) > 1.05 * modulus(&json(&sample)));

    std::fs::write(&table, format!("{header}100,healthy,hyperelastic,gent,mu_pa=500; jm=0.1,0.6,1.4\n")).unwrap();
    let (code, message) = refusal(&with);
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains("mine.csv: line 2: ") && message.contains("leaves the form's domain"), "{message}");
}

#[test]
fn the_printed_literature_table_is_a_table_of_studies() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("all.csv");
    std::fs::write(&table, hgm(&["gp", "studies"]).stdout).unwrap();
    let out = folder.path().join("gp");
    let sample = ["gp", "sample", "--levels", "-1,1", "-o", out.to_str().unwrap()];
    let same = json(&[&sample[..], &["--studies", table.to_str().unwrap()]].concat());
    assert_eq!(same["result"], json(&sample)["result"], "each row replaced by itself");
    let studies = json(&["gp", "studies"]);
    assert_eq!(studies.as_array().unwrap().len(), 73);
    assert!(studies[40]["citation"].as_str().unwrap().contains("Mihai"));
}

#[test]
fn a_test_in_kilopascals_and_in_pascals_gives_the_same_law() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, unit: &str, factor: f64| {
        let path = folder.path().join(name);
        let row = |l: f64| format!("{l},{}\n", 300.0 * (l - 1.0 / (l * l)) * factor);
        let rows: String = (0..9).map(|i| row(0.9 + 0.025 * f64::from(i))).collect();
        std::fs::write(&path, format!("stretch,nominal stress ({unit})\n{rows}")).unwrap();
        path.to_str().unwrap().to_owned()
    };
    for (name, unit, factor) in [("a.csv", "Pa", 1.0), ("b.csv", "kPa", 1e-3)] {
        let fits = json(&["law", "fit", &file(name, unit, factor), "--law", "neo-hookean,ogden"]);
        for fit in fits["fits"].as_array().unwrap() {
            assert!((fit["fit"]["shear_modulus_pa"].as_f64().unwrap() - 300.0).abs() < 1e-3, "{unit}: {fit}");
            assert_eq!(fit["stable_everywhere"], true);
        }
    }
    let (code, message) = refusal(&["law", "fit", &file("c.csv", "psi", 1.0)]);
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains("c.csv: line 1: ") && message.contains("(kPa)"), "{message}");
    let literature = json(&["law", "fit", "--literature", "40", "--law", "neo-hookean"]);
    assert!((literature["fits"][0]["fit"]["shear_modulus_pa"].as_f64().unwrap() - 333.28).abs() < 1e-3);
    assert_eq!(refusal(&["law", "fit"]).0, Some(2));
    assert_eq!(refusal(&["law", "fit", "--literature", "40", "--law", "rubber"]).0, Some(2));
}

#[test]
fn slow_the_study_level_model_is_fitted_sampled_and_shown_with_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let study_level = ["--model", "study-level", "--threads"];
    let run = |name: &str, threads: &str| {
        let place = [threads, "-o", &at(name)];
        let fitted = json(&[&["gp", "fit"], &study_level[..], &place].concat());
        let file = fitted["study_level"].as_str().unwrap().to_owned();
        let own = ["--hyperparameters", &file];
        json(&[&["gp", "sample", "--draws", "50", "--curves"], &study_level[..], &place, &own].concat());
        json(&[&["gp", "show"], &study_level[..], &place, &own].concat());
        let names = ["study-level.toml", "study-level-draws-person-hyperelastic-healthy.csv", "study-level-bands.svg"];
        names.map(|name| text(&Path::new(&file).with_file_name(name)))
    };
    let files = run("one", "1");
    assert_eq!(run("two", "2"), files);
    let materials = &files[1];
    assert_eq!(materials.lines().count(), 51);
    assert!(materials.lines().skip(1).all(|line| line.ends_with(",true")), "every law is stable");
}

#[test]
fn what_is_of_draws_is_refused_where_nothing_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("gp");
    for of_draws in [&["--spread", "study"][..], &["--curves"]] {
        for (levels, named) in [(&[][..], "--draws"), (&["--levels", "-1,0,1"], "--levels")] {
            let (code, said) = refusal(&[&["gp", "sample", "-o", out.to_str().unwrap()], of_draws, levels].concat());
            assert!(code != Some(0) && said.contains(named), "{said}");
        }
    }
    assert!(!out.exists(), "nothing half-written");
}

#[test]
fn options_of_the_other_generative_model_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("gp");
    let out = out.to_str().unwrap();
    for (arguments, named) in [
        (&["gp", "sample", "--of", "person"][..], "--of belongs to --model study-level"),
        (&["gp", "sample", "--model", "study-level", "--draws", "2", "--spread", "study"], "--spread belongs to"),
        (&["gp", "fit", "--model", "study-level", "--rank", "2"], "--rank belongs to --model published"),
        (&["gp", "show", "--model", "study-level", "--models", "44"], "--models belongs to --model published"),
    ] {
        let (code, said) = refusal(&[arguments, &["-o", out]].concat());
        assert_eq!(code, Some(3), "{said}");
        assert!(said.contains(named), "{said}");
    }
    assert!(!Path::new(out).exists(), "nothing half-written");
}

#[test]
fn values_out_of_range_are_refused_with_the_option_that_takes_them() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("gp");
    let out = out.to_str().unwrap();
    let study_level = ["--model", "study-level"];
    for (arguments, words) in [
        (&["gp", "sample", "-o", out, "--levels", "0,7"][..], ["7", "-6 to 6", "--levels"]),
        (&["gp", "sample", "-o", out, "--draws", "0"], ["0", "1 to 1000000", "--draws"]),
        (&[&["gp", "sample", "-o", out, "--levels=-9"], &study_level[..]].concat(), ["-9", "-6 to 6", "--levels"]),
        (&[&["gp", "sample", "-o", out, "--draws", "0"], &study_level[..]].concat(), ["0", "1 to 1000000", "--draws"]),
        (&["law", "fit", "--literature", "40", "--poisson-ratio", "0.5"], ["0.5", "below 0.5", "--poisson-ratio"]),
    ] {
        let (code, said) = refusal(arguments);
        assert_eq!(code, Some(3), "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
    assert!(!Path::new(out).exists(), "nothing half-written");
}

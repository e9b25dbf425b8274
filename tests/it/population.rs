//! What cohorts say of people, from file to file, and as the prior of the next estimate.

use crate::job::{contents, output, sample};
use crate::made::prepared_pair;
use hgm::experiment::population::{Kind, Moments, PopulationFile};
use hgm::material::meta_model::MetaModel;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Output;

/// What the literature's prior of a whole brain was when these files were made does not matter: they agree.
const LITERATURE: (f64, f64) = (6.2, 0.9);

/// The file of patients whose ln(shear modulus) of the whole brain is known to a tenth.
pub fn of_brains(log_moduli: &[f64]) -> String {
    let one = |mean: &f64| Moments { information: vec![100.0 * mean], precision: vec![vec![100.0]] };
    let brain = [("shear_modulus_pa of brain".to_owned(), LITERATURE)];
    let moments = log_moduli.iter().map(one).collect();
    let kind = Kind { law: MetaModel::NEO_HOOKEAN, density_kg_per_m3: 100.0, poisson_ratio: Some(0.45), drained: None };
    PopulationFile::new(kind, &brain, moments, BTreeMap::new()).unwrap().to_toml()
}

fn said(result: &Output) -> String {
    String::from_utf8_lossy(&result.stderr).into_owned()
}

#[test]
fn two_sites_merge_and_what_cannot_be_merged_is_refused_with_nothing_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let [north, south] = [[6.1, 6.3, 6.6, 6.4], [6.2, 6.5, 6.35, 6.45]];
    for (name, text) in [
        ("north.toml", of_brains(&north)),
        ("south.toml", of_brains(&south)),
        ("broken.toml", of_brains(&south).replace("format = 1", "format = 1\nname = \"x\"")),
        ("denser.toml", of_brains(&[6.0]).replace("density_kg_per_m3 = 100.0", "density_kg_per_m3 = 50.0")),
    ] {
        std::fs::write(at(name), text).unwrap();
    }
    let merge = |files: &[&str]| {
        let files: Vec<String> = files.iter().map(|name| at(name)).collect();
        let words: Vec<&str> = ["population", "merge"].into_iter().chain(files.iter().map(String::as_str)).collect();
        output(&[&words[..], &["-o", &at("both.toml")]].concat())
    };
    for (files, words) in [
        (["north.toml", "north.toml"], "merge each cohort once"),
        (["north.toml", "broken.toml"], "broken.toml: line"),
        (["north.toml", "denser.toml"], "under 50 kg/m3"),
        (["north.toml", "absent.toml"], "absent.toml"),
    ] {
        let result = merge(&files);
        assert_eq!(result.status.code(), Some(3), "{files:?}: {}", said(&result));
        assert!(said(&result).contains(words), "{}", said(&result));
        assert!(!contents(folder.path()).contains_key("both.toml"));
    }
    let words = ["population", "merge", &at("north.toml"), &at("south.toml"), "-o", &at("./north.toml")];
    let over = output(&words);
    assert!(
        over.status.code() == Some(3) && said(&over).contains("north.toml") && said(&over).contains("another name")
    );
    let result = merge(&["north.toml", "south.toml"]);
    assert!(result.status.success(), "{}", said(&result));
    let all: Vec<f64> = north.into_iter().chain(south).collect();
    assert_eq!(std::fs::read_to_string(at("both.toml")).unwrap(), of_brains(&all));
    // One site alone is one study's worth, both together are not.
    let shown = |name: &str| String::from_utf8(output(&["population", "show", &at(name)]).stdout).unwrap();
    assert!(shown("north.toml").contains("one study's worth") && !shown("both.toml").contains("one study's worth"));
}

#[test]
fn a_population_for_a_sweep_is_refused() {
    let result = output(&["run", "pre.nii.gz", "post.nii.gz", "--population", "p.toml"]);
    assert_eq!(result.status.code(), Some(3));
    assert!(said(&result).contains("add --estimate"), "{}", said(&result));
}

#[test]
fn a_population_of_other_tissues_is_no_prior_of_an_estimate() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(at("p.toml"), of_brains(&[6.1, 6.3, 6.6, 6.4, 6.2, 6.5, 6.35, 6.45])).unwrap();
    std::fs::write(at("s.toml"), "[resection]\ntissues = 2\n").unwrap();
    let [pre, post] = ["pre.nii.gz", "post.nii.gz"].map(|name| sample(name).to_str().unwrap().to_owned());
    let (settings, population, case) = (at("s.toml"), at("p.toml"), at("case"));
    let asked = ["--config", &settings, "run", &pre, &post, "--estimate", "--population", &population, "-o", &case];
    let result = output(&asked);
    assert_eq!(result.status.code(), Some(3), "{}", said(&result));
    for words in ["teaches brain", "grey_matter and white_matter", "--tissues"] {
        assert!(said(&result).contains(words), "{words}: {}", said(&result));
    }
}

fn estimated(case: &Path, more: &[&str]) -> serde_json::Value {
    let result = output(&[&["estimate", case.to_str().unwrap(), "--json"], more].concat());
    assert!(result.status.success(), "{}", said(&result));
    serde_json::from_slice(&result.stdout).unwrap()
}

#[test]
fn slow_a_cohort_is_the_prior_of_the_next_estimate_and_nothing_stale_is_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    prepared_pair(&case);
    let file = folder.path().join("population.toml");
    let text = of_brains(&[6.1, 6.3, 6.6, 6.4, 6.2, 6.5, 6.35, 6.45]);
    std::fs::write(&file, &text).unwrap();
    let file = file.to_str().unwrap();
    let taught = &PopulationFile::from_toml(&text, "p.toml").unwrap().parameters[0];
    let literature = estimated(&case, &[]);
    assert!(literature.get("taught_by").is_none());
    let learnt = estimated(&case, &["--population", file]);
    assert_eq!(learnt["taught_by"], 8);
    assert_eq!(learnt["prior"][0]["mean"].as_f64(), Some(taught.next_log_mean));
    assert_eq!(learnt["prior"][0]["sd"].as_f64(), Some(taught.next_log_sd));
    assert_ne!(learnt["posterior"]["mode"], literature["posterior"]["mode"]);
    let page = std::fs::read_to_string(case.join("report.html")).unwrap();
    assert!(page.contains("a cohort of 8 patients"));
    // The case keeps it, until it is told otherwise.
    assert_eq!(estimated(&case, &[]), learnt);
    assert_eq!(estimated(&case, &["--population", "none"]), literature);
    // A population of another law is no prior of this one.
    let other = output(&["estimate", case.to_str().unwrap(), "--population", file, "--config", &ogden(folder.path())]);
    assert_eq!(other.status.code(), Some(3));
    assert!(said(&other).contains("`law = \"neo-hookean\"` in the table [prior]"), "{}", said(&other));
}

fn ogden(folder: &Path) -> String {
    let file = folder.join("ogden.toml");
    std::fs::write(&file, "[prior]\nlaw = \"ogden\"\n").unwrap();
    file.to_str().unwrap().to_owned()
}

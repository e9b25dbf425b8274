//! Synthetic patients by the command line: what else is the matter, and what is wrong with their scans.

use crate::job::{contents, output};
use hgm::image::nifti::{ReadOptions, decode_mask};

#[test]
fn a_fault_out_of_range_ends_with_3_says_where_it_stands_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (text, field) in [
        ("[synth.pre]\nghost_fraction = 0.9\n", "pre.ghost_fraction"),
        ("[synth.post]\ncoil_gain = 0.5\n", "post.coil_gain"),
        ("[synth.post]\nmissing_slices = 500\n", "post.missing_slices"),
        ("[synth.pathology]\nventricle_factor = 9.0\n", "pathology.ventricle_factor"),
        ("[synth.pathology]\noedemas = \"pre\"\n", "oedemas"),
        // A word that is none of a list is told by its line, as in every table.
        ("[synth.pre]\ncut_side = \"inner\"\n", "line 2: table [synth]: unknown value `inner`"),
    ] {
        std::fs::write(path("faults.toml"), text).unwrap();
        let ended = output(&["synth", "--config", &path("faults.toml"), "-o", &path("patient")]);
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(3), "{text}: {said}");
        assert!(said.contains(field) && !folder.path().join("patient").exists(), "{text}: {said}");
    }
}

#[test]
fn slow_what_was_asked_for_stands_in_the_truth_and_the_old_lesion_in_the_grid_of_both_scans() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("faults.toml"), "[synth.post]\nghost_fraction = 0.05\ncut_mm = 20.0\n").unwrap();
    let coarse = ["synth", "-q", "--config", &path("faults.toml"), "--spacing-mm", "4", "--seed", "4"];
    let more = ["--deface", "pre", "--oedema", "both", "--old-lesion-cc", "15", "--ventricles", "1.5"];
    let made = output(&[&coarse[..], &more[..], &["-o", &path("patient")]].concat());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let files = contents(&folder.path().join("patient"));
    let truth: serde_json::Value = serde_json::from_slice(&files["truth/truth.json"]).unwrap();
    let asked = &truth["settings"];
    assert_eq!((&asked["pre"]["defaced"], &asked["post"]["defaced"]), (&true.into(), &false.into()));
    assert_eq!(asked["post"]["ghost_fraction"], 0.05);
    assert_eq!((&asked["pathology"]["oedema"], &asked["pathology"]["ventricle_factor"]), (&"both".into(), &1.5.into()));
    let mask = |name: &str| decode_mask(&files[name], name, &ReadOptions::default()).unwrap().0;
    for (lesion, brain) in [("old_lesion_pre", "brain_pre"), ("old_lesion_post", "brain_post")] {
        let (lesion, brain) = (mask(&format!("truth/{lesion}.nii.gz")), mask(&format!("truth/{brain}.nii.gz")));
        assert!(lesion.grid.coincides(&brain.grid, 1e-6) && (lesion.volume_cc() - 15.0).abs() < 4.0);
        assert!(lesion.data.iter().zip(&brain.data).all(|(&lesion, &brain)| !lesion || brain));
    }
    // Without it, made again in the same folder, its masks are gone.
    let made = output(&[&coarse[..], &["--force", "-o", &path("patient")]].concat());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let files = contents(&folder.path().join("patient"));
    assert!(!files.keys().any(|name| name.contains("old_lesion")), "{:?}", files.keys());
}

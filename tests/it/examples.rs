//! The examples, as they stand, do what they say.

#[path = "../../examples/add_a_law.rs"]
mod add_a_law;
#[path = "../../examples/pair_to_report.rs"]
mod pair_to_report;
#[path = "../../examples/sample_prior.rs"]
mod sample_prior;
#[path = "../../examples/simulate_mesh.rs"]
mod simulate_mesh;

use crate::job::sample;

#[test]
fn slow_a_pair_becomes_a_case_whose_numbers_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let case = pair_to_report::run(&sample("pre.nii.gz"), &sample("post.nii.gz"), folder.path()).unwrap();
    assert_eq!(case.outcome().unwrap().samples.len(), 3);
    assert!(case.page().is_file());
}

#[test]
fn a_mesh_sinks_under_its_weight() {
    let largest_mm = simulate_mesh::run().unwrap();
    assert!((0.1..20.0).contains(&largest_mm), "{largest_mm}");
}

#[test]
fn a_law_of_ones_own_is_simulated_like_the_houses() {
    let [neo_hookean, the_same, stiffening] = add_a_law::run().unwrap();
    assert!((the_same / neo_hookean - 1.0).abs() < 1e-6, "{the_same} {neo_hookean}");
    assert!(stiffening < 0.99 * neo_hookean, "{stiffening} {neo_hookean}");
}

#[test]
fn the_prior_grows_stiffer_with_its_level() {
    let moduli = sample_prior::run().unwrap();
    assert!(moduli.len() == 9 && moduli.is_sorted());
    // Granados et al. 2021, Table 1: white matter at the mean has 610 Pa.
    assert!((moduli[4] / 610.0 - 1.0).abs() < 0.05, "{moduli:?}");
}

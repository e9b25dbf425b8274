//! The midline shift of a synthetic patient, from its two scans alone.

use crate::job::output;
use hgm::geometry::{Mni, Position, Pre, RigidTransform};
use hgm::image::Volume;
use hgm::image::nifti::decode_displacement;
use hgm::register::deformable::DisplacementField;
use hgm::register::transform_text::rigid_from_text;
use hgm::resect::midline_shift_mm;
use nalgebra::Vector3;

#[test]
fn slow_the_midline_shift_that_is_seen_is_the_one_that_went_in() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    // Soft tissue, so that it shifts by more than half a millimetre.
    let soft = "[synth]\ngrey_pa = 900.0\nwhite_pa = 500.0\n";
    std::fs::write(path("soft.toml"), soft).unwrap();
    let patient = ["--seed", "2", "--side", "right", "--resection-cc", "32", "--spacing-mm", "2", "--sag", "fem"];
    let made = output(&[&["synth", "-q", "--config", &path("soft.toml"), "-o", &path("scans")], &patient[..]].concat());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let (pre, post) = (path("scans/pre.nii.gz"), path("scans/post.nii.gz"));
    let ended = output(&["prep", "-q", "--no-mesh", "--json", &pre, &post, "-o", &path("case")]);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let outcome: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    let seen = outcome["volumes"]["midline_shift_mm"].as_f64().unwrap();

    let field = |name: &str| {
        let displacement = decode_displacement(&read(&format!("case/anat/{name}.nii.gz")), "field.nii.gz").unwrap();
        DisplacementField::<Mni>::from_displacement(&displacement.relabelled())
    };
    let template_from_patient = field("pre_space-MNI_desc-template_displacement");
    let grid = *field("pre_space-MNI_desc-sag_displacement").grid();
    let text = String::from_utf8(read("case/xfm/from-pre_to-MNI.txt")).unwrap();
    let mni_from_pre: RigidTransform<Pre, Mni> = rigid_from_text(&text, "from-pre_to-MNI.txt").unwrap();
    let truth = decode_displacement(&read("scans/truth/displacement_pre.nii.gz"), "displacement_pre.nii.gz").unwrap();
    let truth: Volume<[f32; 3], Pre> = truth.relabelled();
    let went_in = (0..grid.len()).map(|n| {
        let at = grid.centre(grid.voxel(n));
        let before = mni_from_pre.inverse().apply(at);
        let moved = truth.nearest(before).unwrap_or([0.0; 3]).map(f64::from);
        let after = mni_from_pre.apply(Position::from_point(before.mm + Vector3::from(moved)));
        let shift = after.mm - at.mm;
        [shift.x as f32, shift.y as f32, shift.z as f32]
    });
    let went_in = DisplacementField::from_displacement(&Volume::from_data(grid, went_in.collect()));
    let true_shift = midline_shift_mm(&went_in, &template_from_patient).unwrap();
    assert!(true_shift.abs() > 0.4, "nothing to see: {true_shift} mm");
    assert!((seen - true_shift).abs() < 0.25, "seen {seen} mm, went in {true_shift} mm");
}

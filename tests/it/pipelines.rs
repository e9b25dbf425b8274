//! The independent readers of `pipelines/`: what they say of files whose truth is known.

use crate::mesh_files::box_mesh;
use crate::python::{pipeline, python};
use hgm::mesh::format::{Field, vtu};
use serde_json::Value;
use std::path::Path;

fn number(report: &Value, key: &str) -> f64 {
    report[key].as_f64().unwrap_or_else(|| panic!("{key} is missing in {report}"))
}

/// Colours that differ in a picture, counted coarsely: a blank picture has one.
fn colours(folder: &Path, picture: &str) -> usize {
    let count = python(
        folder,
        &format!(
            "import cv2, numpy as np\nprint(len(np.unique(cv2.imread('{picture}').reshape(-1, 3) // 16, axis=0)))"
        ),
    );
    count.trim().parse().unwrap()
}

#[test]
fn render_qa_recomputes_the_error_from_the_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = box_mesh(8, 120.0);
    let reference: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|p| [0.0, 0.0, -0.02 * (p[2] + 60.0)]).collect();
    let u: Vec<[f64; 3]> = reference.iter().map(|u| [0.3, 0.4, u[2]]).collect();
    let write = |file: &str, u: &[[f64; 3]], error_mm: f64| {
        let fields = [Field::vector("displacement", u), Field::scalar("rmse_mm", vec![error_mm; u.len()])];
        std::fs::write(folder.path().join(file), vtu::encode(&mesh, &fields, &[]).unwrap()).unwrap();
    };
    write("deformed.vtu", &u, 0.5);
    write("reference.vtu", &reference, 0.0);
    write("wrong.vtu", &u, 0.6);
    let render = |file: &str| {
        let arguments = [file, "--reference", "reference.vtu", "-o", "view.png", "--size", "300"];
        pipeline(folder.path(), "render_qa.py", &arguments)
    };
    let (code, said, complaint) = render("deformed.vtu");
    assert_eq!(code, 0, "{complaint}");
    let report: Value = serde_json::from_str(&said).unwrap();
    assert!((number(&report, "rmse_mm") - 0.5).abs() < 1e-12);
    assert!((number(&report, "displacement_max_mm") - (0.25 + 2.4f64.powi(2)).sqrt()).abs() < 1e-9);
    assert!((number(&report, "volume_change_percent") + 2.0).abs() < 1e-9);
    assert_eq!(report["node_sets"]["base"], 81);
    assert!(colours(folder.path(), "view.png") > 50);

    let (code, said, _) = render("wrong.vtu");
    let report: Value = serde_json::from_str(&said).unwrap();
    assert_eq!((code, &report["checks"]["rmse_agrees"]), (4, &Value::Bool(false)));
    let cut = std::fs::read(folder.path().join("deformed.vtu")).unwrap();
    std::fs::write(folder.path().join("cut.vtu"), &cut[..cut.len() / 2]).unwrap();
    let (code, _, complaint) = render("cut.vtu");
    assert!(code == 3 && complaint.contains("cut.vtu"), "{code}: {complaint}");
}

/// The template moved by a rigid motion of known size, as `post_N.nii.gz`, and one on another grid.
const MOVED_TEMPLATES: &str = r#"
import nibabel as nib, numpy as np, sys
from scipy import ndimage
image = nib.load(atlas)
pre, affine = np.asarray(image.dataobj, np.float32)[4:-4, 4:-4], image.affine.copy()
affine[:3, 3] += affine[:3, :3] @ (4, 4, 0)
nib.save(nib.Nifti1Image(pre, affine), "pre.nii.gz")
middle = np.array([0, -16, 10.])
for n, (t, degrees) in enumerate([((0.25, -0.1, 0.1), 0), ((1.5, 0.5, -1), 1.5)]):
    w = np.radians(degrees)
    turn = np.array([[1, 0, 0], [0, np.cos(w), -np.sin(w)], [0, np.sin(w), np.cos(w)]])
    move = np.eye(4); move[:3, :3] = turn; move[:3, 3] = t + middle - turn @ middle
    back = np.linalg.inv(affine) @ np.linalg.inv(move) @ affine
    post = ndimage.affine_transform(pre, back[:3, :3], back[:3, 3], order=1)
    # A cavity and another gain: what operated brains differ in.
    x = np.indices(pre.shape).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
    post[(np.linalg.norm(x - (-45, 5, -25), axis=1) < 22).reshape(pre.shape)] = 5
    nib.save(nib.Nifti1Image(post * 1.4, affine), f"post_{n}.nii.gz")
affine[0, 3] += 1
nib.save(nib.Nifti1Image(pre, affine), "elsewhere.nii.gz")
"#;

#[test]
fn slow_check_registration_measures_a_known_motion() {
    let folder = tempfile::tempdir().unwrap();
    let atlas = concat!(env!("CARGO_MANIFEST_DIR"), "/atlases/mni152/mni_icbm152_t1_tal_nlin_sym_09a_converted.nii.gz");
    python(folder.path(), &format!("atlas = {atlas:?}\n{MOVED_TEMPLATES}"));
    let check =
        |post: &str| pipeline(folder.path(), "check_registration.py", &["pre.nii.gz", post, "-o", "contours.png"]);

    let (code, said, complaint) = check("post_0.nii.gz");
    assert_eq!(code, 0, "{complaint}{said}");
    let close: Value = serde_json::from_str(&said).unwrap();
    assert!((number(&close, "mean_error_mm") - 0.287).abs() < 0.15, "{close}");
    assert!(close["slices"]["axial"].as_array().unwrap().len() > 15);
    assert!(colours(folder.path(), "contours.png") > 10);

    let (code, said, _) = check("post_1.nii.gz");
    let far: Value = serde_json::from_str(&said).unwrap();
    assert_eq!((code, far["verdict"].as_str()), (4, Some("fail")));
    let expected = [1.5, 0.5, -1.0].into_iter().zip(far["translation_mm"].as_array().unwrap());
    for (truth, measured) in expected {
        // The brain's centre is not quite the point the truth turns about: 10 mm away it moves .26 mm.
        assert!((measured.as_f64().unwrap() - truth).abs() < 0.5, "{far}");
    }
    assert!((far["rotation_deg"][0].as_f64().unwrap() - 1.5).abs() < 0.15, "{far}");

    let (code, _, complaint) = check("elsewhere.nii.gz");
    assert!(code == 3 && complaint.contains("elsewhere.nii.gz: affine"), "{complaint}");
}

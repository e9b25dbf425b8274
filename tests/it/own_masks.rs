//! `hgm prep --no-mesh` and a user's own masks: what stands in the case folder.

use crate::job::{CHEAP, contents, output, sample};
use hgm::geometry::{Frame, Position, Post, Pre, RigidTransform};
use hgm::image::nifti::{ReadOptions, decode, decode_labels, decode_mask, encode_mask};
use hgm::image::{Grid, Mask};
use hgm::register::transform_text::rigid_from_text;
use hgm::segment::label;
use nalgebra::Point3;
use std::path::Path;

fn grid<F: Frame>(name: &str) -> Grid<F> {
    let bytes = std::fs::read(sample(name)).unwrap();
    decode(&bytes, name, &ReadOptions::default()).unwrap().volume.grid.relabelled()
}

/// A ball where no ventricle is by chance: what the program would find by itself looks otherwise.
fn ball<F: Frame>(grid: Grid<F>, centre: Position<F>) -> Mask<F> {
    const RADIUS_MM: f64 = 11.0;
    Mask::from_fn(grid, |n| grid.centre(grid.voxel(n)).distance_mm(&centre) < RADIUS_MM)
}

/// A point in the white matter of the right hemisphere, which was not operated on.
fn in_white_matter() -> Position<Pre> {
    let bytes = std::fs::read(sample("truth/brain_pre.nii.gz")).unwrap();
    let (brain, _) = decode_mask(&bytes, "brain_pre.nii.gz", &ReadOptions::default()).unwrap();
    let inside = (0..brain.data.len()).filter(|&n| brain.data[n]);
    let sum: nalgebra::Vector3<f64> = inside.map(|n| brain.grid.centre(brain.grid.voxel(n)).mm.coords).sum();
    let middle = Point3::from(sum / brain.count() as f64);
    Position::from_point(middle + nalgebra::Vector3::new(25.0, 0.0, 15.0))
}

fn prep(case: &Path, ventricles: &Path) {
    let [pre, post] = ["pre.nii.gz", "post.nii.gz"].map(|name| sample(name).to_str().unwrap().to_owned());
    let [case, mask] = [case, ventricles].map(|path| path.to_str().unwrap());
    let words = ["prep", "-q", "--no-mesh", &pre, &post, "--ventricle-mask", mask, "-o", case];
    let made = output(&[&words[..], &CHEAP[..]].concat());
    // It lies in white matter: used, since it wins, and told.
    let said = String::from_utf8_lossy(&made.stderr);
    assert!(made.status.code() == Some(4) && said.contains("of the ventricle mask"), "{said}");
}

fn ventricles(case: &Path) -> Mask<Pre> {
    let bytes = std::fs::read(case.join("anat/pre_space-native_dseg.nii.gz")).unwrap();
    let (labels, _) = decode_labels(&bytes, "dseg.nii.gz", &ReadOptions::default()).unwrap();
    labels.relabelled().map(|l| l == label::VENTRICLE)
}

#[test]
fn slow_prep_without_mesh_leaves_images_and_masks_with_the_ventricles_given_in_either_grid() {
    let folder = tempfile::tempdir().unwrap();
    let (case, mask) = (folder.path().join("case"), folder.path().join("mine.nii.gz"));
    let centre = in_white_matter();
    let mine = ball(grid::<Pre>("pre.nii.gz"), centre);
    std::fs::write(&mask, encode_mask(&mine)).unwrap();
    prep(&case, &mask);
    assert!(ventricles(&case) == mine, "voxel by voxel on the grid they were drawn on");

    let files = contents(&case);
    let wanted = [
        "xfm/from-pre_to-MNI.txt",
        "xfm/from-pre_to-MNI.tfm",
        "xfm/from-post_to-pre.txt",
        "xfm/from-post_to-pre.tfm",
        "anat/pre_space-MNI_T1w.nii.gz",
        "anat/post_space-MNI_T1w.nii.gz",
        "anat/pre_space-MNI_dseg.nii.gz",
        "anat/pre_space-MNI_desc-brain_mask.nii.gz",
        "anat/post_space-MNI_desc-brain_mask.nii.gz",
        "anat/post_space-MNI_label-cavity_mask.nii.gz",
        "anat/post_space-MNI_label-ventricle_mask.nii.gz",
        "anat/pre_space-MNI_label-resected_mask.nii.gz",
        "anat/pre_space-native_dseg.nii.gz",
        "anat/pre_space-native_desc-brain_mask.nii.gz",
        "anat/post_space-native_desc-brain_mask.nii.gz",
        "anat/post_space-native_label-cavity_mask.nii.gz",
        "anat/pre_space-native_label-resected_mask.nii.gz",
        "report.html",
        "settings.toml",
        "provenance.json",
    ];
    for name in wanted {
        assert!(files.contains_key(name), "{name} is missing");
    }
    for name in files.keys() {
        let meshes = [".vtu", ".pvd", ".msh", ".gii", ".part"].iter().any(|end| name.ends_with(end));
        assert!(!meshes && !name.starts_with("mesh/"), "{name} is there");
    }

    // The same ball drawn on the other scan replaces it; the registration stays.
    let post_from_pre: RigidTransform<Pre, Post> =
        rigid_from_text(&std::fs::read_to_string(sample("truth/T_pre2post.txt")).unwrap(), "T_pre2post.txt").unwrap();
    let drawn_on_post = ball(grid::<Post>("post.nii.gz"), post_from_pre.apply(centre));
    std::fs::write(&mask, encode_mask(&drawn_on_post)).unwrap();
    prep(&case, &mask);
    let dice = ventricles(&case).dice(&mine);
    assert!(dice > 0.9 && ventricles(&case) != mine, "{dice}");
    let fit = "xfm/from-post_to-pre.txt";
    assert!(std::fs::read(case.join(fit)).unwrap() == files[fit]);
}

#[test]
fn slow_a_mask_of_what_was_taken_where_nothing_is_gone_is_told_and_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let (case, mask) = (folder.path().join("case"), folder.path().join("mine.nii.gz"));
    std::fs::write(&mask, encode_mask(&ball(grid::<Pre>("pre.nii.gz"), in_white_matter()))).unwrap();
    let [pre, post] = ["pre.nii.gz", "post.nii.gz"].map(|name| sample(name).to_str().unwrap().to_owned());
    let [folder, mask] = [&case, &mask].map(|path| path.to_str().unwrap());
    let words = ["prep", "-q", "--no-mesh", &pre, &post, "--resected-mask", mask, "-o", folder];
    let made = output(&[&words[..], &CHEAP[..]].concat());
    let said = String::from_utf8_lossy(&made.stderr);
    assert!(made.status.code() == Some(4) && said.contains("looks as it did before the operation"), "{said}");
    let outcome = String::from_utf8_lossy(&contents(&case)["sim/outcome.json"]).into_owned();
    assert!(outcome.contains("no cavity is seen where the mask"), "{outcome}");
}

//! Pairs that can be used and should be looked at: `hgm register` says so, and keeps or gates its result.

use crate::job::{output, sample};
use hgm::image::Volume;
use hgm::image::nifti::{ReadOptions, decode, encode_f32, encode_i16};
use hgm::material::random::CounterRng;
use std::io::Read;
use std::path::Path;

/// Exit code and warnings of `hgm register MOVING pre`.
fn warnings(moving: &Path) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let transform = folder.path().join("t.txt");
    let [moving, fixed] = [moving, &sample("pre.nii.gz")].map(|path| path.to_str().unwrap().to_owned());
    let result = output(&["register", "-q", "--json", &moving, &fixed, "-o", transform.to_str().unwrap()]);
    assert!(transform.exists(), "{}", String::from_utf8_lossy(&result.stderr));
    let said: serde_json::Value = serde_json::from_slice(&result.stdout).unwrap();
    (result.status.code(), said["warnings"].to_string())
}

#[test]
fn the_same_file_twice_a_mirrored_header_doubtful_forms_and_a_stranger_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    assert_eq!(warnings(&sample("post.nii.gz")), (Some(0), "[]".to_owned()));

    let (code, said) = warnings(&sample("pre.nii.gz"));
    assert!(code == Some(0) && said.contains("was one image given twice?"), "{said}");

    let mut plain = Vec::new();
    flate2::read::GzDecoder::new(&std::fs::read(sample("post.nii.gz")).unwrap()[..]).read_to_end(&mut plain).unwrap();
    let shifted = |copy: &mut Vec<u8>, at: usize, mm: f32| {
        let x = f32::from_le_bytes(copy[at..at + 4].try_into().unwrap()) + mm;
        copy[at..at + 4].copy_from_slice(&x.to_le_bytes());
    };
    let mut forms = plain.clone();
    // Offsets of NIfTI-1: qform_code 252, qoffset_x 268, the rows of the sform from 280.
    shifted(&mut forms, 268, 0.3);
    std::fs::write(at("forms.nii"), &forms).unwrap();
    let (code, said) = warnings(&at("forms.nii"));
    assert!(code == Some(0) && said.contains("sform and qform") && said.contains("0.300 mm"), "{said}");

    let mut mirrored = plain.clone();
    mirrored[252..254].copy_from_slice(&[0, 0]);
    for n in 0..4 {
        mirrored[280 + 4 * n + 3] ^= 0x80;
    }
    std::fs::write(at("mirrored.nii"), &mirrored).unwrap();
    let (code, said) = warnings(&at("mirrored.nii"));
    assert!(code == Some(4) && said.contains("left and right may be exchanged"), "{said}");

    let post = decode(&plain, "post.nii", &ReadOptions::default()).unwrap().volume;
    let rng = CounterRng::new(1, 1);
    let noise = Volume::from_fn(post.grid, |n| (400.0 * rng.uniform(n as u64)) as i16);
    std::fs::write(at("noise.nii.gz"), encode_i16(&noise)).unwrap();
    let (code, said) = warnings(&at("noise.nii.gz"));
    assert!(code == Some(4) && said.contains("hardly resemble each other"), "{said}");
}

#[test]
fn a_scan_in_another_unit_is_registered_as_it_would_be_in_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let post = decode(&std::fs::read(sample("post.nii.gz")).unwrap(), "post.nii.gz", &ReadOptions::default()).unwrap();
    let registered = |unit: f32| {
        std::fs::write(at("post.nii.gz"), encode_f32(&post.volume.map(|x| unit * x))).unwrap();
        let fixed = sample("pre.nii.gz");
        let words = ["register", "-q", "--json", &at("post.nii.gz"), fixed.to_str().unwrap(), "-o", &at("t.txt")];
        let result = output(&words);
        assert!(result.status.success(), "{}", String::from_utf8_lossy(&result.stderr));
        (std::fs::read(at("t.txt")).unwrap(), String::from_utf8_lossy(&result.stdout).into_owned())
    };
    let (own, said) = registered(1.0);
    assert!(!said.contains("scanner's"), "{said}");
    for power in [-40.0, 30.0] {
        let (other, said) = registered(f32::exp2(power));
        assert!(other == own && said.contains("than a scanner's"), "{said}");
    }
}

//! What is refused, by file, field and remedy.

use super::{File, NAME, gzip};
use hgm::image::nifti::{ReadOptions, decode};

/// The message of a refusal, which must name the file.
fn message(bytes: &[u8]) -> String {
    let text = decode(bytes, NAME, &ReadOptions::default()).unwrap_err().to_string();
    assert!(text.starts_with("scan.nii.gz: "), "{text}");
    text
}

#[test]
fn each_malformed_file_is_refused_by_file_field_and_remedy() {
    let sound = File::sound().bytes();
    let packed = gzip(&sound);
    let mut flipped = packed.clone();
    let crc = packed.len() - 8;
    flipped[crc] ^= 1;
    let mut dicom = vec![0u8; 400];
    dicom[128..132].copy_from_slice(b"DICM");
    let cases: Vec<(&str, Vec<u8>, &[&str])> = vec![
        ("empty", vec![], &["sizeof_hdr", "0 bytes", "again"]),
        ("header cut", sound[..200].to_vec(), &["sizeof_hdr", "200 bytes", "again"]),
        ("voxels cut", sound[..sound.len() - 1].to_vec(), &["dim", "400", "399", "truncated", "again"]),
        ("gzip cut", packed[..packed.len() - 9].to_vec(), &["gzip", "truncated", "again"]),
        ("gzip CRC", flipped, &["gzip", "again"]),
        ("voxels cut, packed", gzip(&sound[..390]), &["dim", "400", "390", "truncated"]),
        ("text", b"not an image, only words that go on and on".repeat(10), &["sizeof_hdr", "dcm2niix"]),
        ("dicom", dicom, &["sizeof_hdr", "DICOM", "dcm2niix"]),
        (
            "lfs pointer",
            [b"version https://git-lfs.github.com/spec/v1\n".to_vec(), vec![b' '; 400]].concat(),
            &["sizeof_hdr", "git lfs pull"],
        ),
        ("wrong magic", File::with(|f| f.magic = b"n+9\0".to_vec()), &["magic", "n+9.", "again"]),
        ("header half", File::with(|f| f.magic = b"ni1\0".to_vec()), &["magic", ".hdr", "join"]),
        ("analyze", File::with(|f| f.magic = vec![0; 4]), &["magic", "Analyze", "dcm2niix"]),
        (
            "text-mode transfer",
            {
                let mut file = File::sound().version_2();
                file.magic = b"n+2\0\n\n\x1a\n".to_vec();
                file.bytes()
            },
            &["magic", "copy it again"],
        ),
        ("rgb", File::with(|f| (f.datatype, f.bitpix) = (128, 24)), &["datatype", "RGB24", "grey-scale"]),
        ("rgba", File::with(|f| (f.datatype, f.bitpix) = (2304, 32)), &["datatype", "RGBA32", "grey-scale"]),
        ("complex", File::with(|f| (f.datatype, f.bitpix) = (32, 64)), &["datatype", "complex64", "magnitude"]),
        ("float128", File::with(|f| (f.datatype, f.bitpix) = (1536, 128)), &["datatype", "float128", "float32"]),
        ("no datatype", File::with(|f| f.datatype = 0), &["datatype", "export"]),
        ("odd datatype", File::with(|f| f.datatype = 7), &["datatype", "7", "export"]),
        ("NaN slope", File::with(|f| f.slope = f64::NAN), &["scl_slope", "NaN", "set scl_slope to 1"]),
        ("infinite intercept", File::with(|f| f.inter = f64::INFINITY), &["scl_inter", "inf", "set"]),
        (
            "no orientation",
            File::with(|f| (f.qform_code, f.sform_code) = (0, 0)),
            &["qform_code and sform_code", "left", "dcm2niix"],
        ),
        ("forms disagree", File::with(|f| f.srow[0][3] = 14.0), &["sform and qform", "4.000", "the one you trust"]),
        (
            "mirrored sform",
            File::with(|f| f.srow[0] = [-1.0, 0.0, 0.0, 13.0]),
            &["sform and qform", "the one you trust"],
        ),
        ("singular sform", File::with(|f| f.srow[2] = [1.0, 0.0, 1e-9, 0.0]), &["srow", "correct the header"]),
        (
            "flat sform",
            File::with(|f| {
                f.qform_code = 0;
                f.srow = [[1.0, 0.0, 2.0, 0.0], [0.0, 2.0, 2.0, 0.0], [0.0, 0.0, 1e-4, 0.0]];
            }),
            &["srow", "singular", "DICOM again"],
        ),
        ("NaN sform", File::with(|f| f.srow[1][3] = f64::NAN), &["srow", "not a finite", "correct the header"]),
        (
            "quaternion too long",
            File::with(|f| (f.sform_code, f.quatern) = (0, [0.9, 0.9, 0.0])),
            &["quatern", "longer than 1", "correct the header"],
        ),
        ("zero spacing", File::with(|f| f.pixdim[2] = 0.0), &["pixdim", "along j", "0 mm", "correct the header"]),
        (
            "metres",
            File::with(|f| {
                f.pixdim = [1.0, 0.001, 0.002, 0.003, 0.0, 0.0, 0.0, 0.0];
            }),
            &["pixdim", "0.001", "10 mm"],
        ),
        (
            "thick slices",
            File::with(|f| {
                f.pixdim[3] = 12.0;
                f.srow[2][2] = 12.0;
            }),
            &["pixdim", "along k", "12 mm"],
        ),
        ("no dimensions", File::with(|f| f.dim[0] = 0), &["dim", "dim[0]", "1 to 7"]),
        ("flat", File::with(|f| f.dim[0] = 2), &["dim", "dim[3] is 1", "export"]),
        ("negative dimension", File::with(|f| f.dim[2] = -3), &["dim", "dim[2] is -3", "export"]),
        ("two volumes", File::with(|f| f.dim = [4, 2, 3, 2, 2, 1, 1, 1]), &["dim", "2 volumes", "choose one (0 to 1)"]),
        ("vectors", File::with(|f| f.dim = [5, 2, 2, 2, 1, 3, 1, 1]), &["dim", "3 volumes", "choose one (0 to 2)"]),
        ("empty time", File::with(|f| f.dim = [4, 4, 3, 2, 0, 1, 1, 1]), &["dim", "dim[4] is 0", "at least 1"]),
        ("huge", File::with(|f| f.dim = [3, 30000, 30000, 30000, 1, 1, 1, 1]), &["dim", "voxels are more", "export"]),
        (
            "large lie",
            File::with(|f| f.dim = [3, 600, 600, 600, 1, 1, 1, 1]),
            &["dim", "432000352", "400", "truncated"],
        ),
        ("offset in header", File::with(|f| f.vox_offset = 100.0), &["vox_offset", "100", "348", "again"]),
        ("offset NaN", File::with(|f| f.vox_offset = f64::NAN), &["vox_offset", "NaN", "again"]),
        ("offset far", File::with(|f| f.vox_offset = 5000.0), &["dim", "5048", "truncated"]),
        ("constant", File::with(|f| f.voxels = vec![7.0; 24]), &["voxels", "every voxel is 7", "export"]),
        (
            "all NaN",
            File::with(|f| {
                (f.datatype, f.bitpix) = (16, 32);
                f.voxels = vec![f64::NAN; 24];
            }),
            &["voxels", "every voxel is 0"],
        ),
    ];
    assert!(cases.len() >= 40);
    for (what, bytes, words) in &cases {
        for packed in [false, true] {
            // What is packed already cannot be packed once more and stay the same case.
            if packed && bytes.starts_with(&[0x1f, 0x8b]) {
                continue;
            }
            let text = message(&if packed { gzip(bytes) } else { bytes.clone() });
            for word in *words {
                // How much of a packed file that lies is there is told after unpacking: the same numbers.
                assert!(text.contains(word), "{what} (packed: {packed}): {text:?} lacks {word:?}");
            }
        }
    }
}

#[test]
fn only_nifti_names_are_read_and_the_hint_fits_the_name() {
    for (name, hint) in [("a.dcm", "dcm2niix"), ("a.img", "join"), ("a.nrrd", "3D Slicer"), ("a.gz", "dcm2niix")] {
        let text = decode(&File::sound().bytes(), name, &ReadOptions::default()).unwrap_err().to_string();
        assert!(text.starts_with(&format!("{name}: file name")) && text.contains(hint), "{text}");
    }
    assert!(decode(&File::sound().bytes(), "A.NII.GZ", &ReadOptions::default()).is_ok());
}

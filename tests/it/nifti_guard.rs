//! The guard of the NIfTI reader: what is refused and with which words, what is read all the same, and that nothing
//! anyone feeds it makes it panic.

use hgm::geometry::{Mni, Native, Position, Pre};
use hgm::image::nifti::{
    NiftiImage, NiftiProblem, Orientation, ReadOptions, decode, decode_labels, decode_mask, encode_f32, encode_i16,
    encode_mask, encode_u8, encode_vectors,
};
use hgm::image::{Grid, Mask, Volume};
use nalgebra::{Matrix4, Point3, Rotation3, Vector3};

const NAME: &str = "scan.nii.gz";

/// A header and voxels to spoil, written in version 1 or 2 and either byte order.
#[derive(Clone)]
struct File {
    version: u8,
    big: bool,
    magic: Vec<u8>,
    dim: [i64; 8],
    datatype: i16,
    bitpix: i16,
    pixdim: [f64; 8],
    vox_offset: f64,
    slope: f64,
    inter: f64,
    qform_code: i16,
    sform_code: i16,
    quatern: [f64; 3],
    qoffset: [f64; 3],
    srow: [[f64; 4]; 3],
    /// Voxels as numbers, stored by `datatype`.
    voxels: Vec<f64>,
    text: bool,
}

impl File {
    /// 4 x 3 x 2 voxels of 1 x 2 x 3 mm, int16, values 0..24, sform and qform agreeing.
    fn sound() -> Self {
        Self {
            version: 1,
            big: false,
            magic: b"n+1\0".to_vec(),
            dim: [3, 4, 3, 2, 1, 1, 1, 1],
            datatype: 4,
            bitpix: 16,
            pixdim: [1.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0],
            vox_offset: 352.0,
            slope: 1.0,
            inter: 0.0,
            qform_code: 1,
            sform_code: 1,
            quatern: [0.0; 3],
            qoffset: [10.0, -20.0, 30.0],
            srow: [[1.0, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, -20.0], [0.0, 0.0, 3.0, 30.0]],
            voxels: (0..24).map(f64::from).collect(),
            text: false,
        }
    }

    fn with(change: impl FnOnce(&mut Self)) -> Vec<u8> {
        let mut file = Self::sound();
        change(&mut file);
        file.bytes()
    }

    fn version_2(mut self) -> Self {
        self.version = 2;
        self.magic = b"n+2\0\r\n\x1a\n".to_vec();
        self.vox_offset = 544.0;
        self
    }

    fn bytes(&self) -> Vec<u8> {
        let mut out = vec![0u8; if self.version == 1 { 352 } else { 544 }];
        let put = |out: &mut Vec<u8>, at: usize, little: &[u8]| {
            let mut raw = little.to_vec();
            if self.big {
                raw.reverse();
            }
            out[at..at + raw.len()].copy_from_slice(&raw);
        };
        if self.version == 1 {
            put(&mut out, 0, &348i32.to_le_bytes());
            for n in 0..8 {
                put(&mut out, 40 + 2 * n, &(self.dim[n] as i16).to_le_bytes());
                put(&mut out, 76 + 4 * n, &(self.pixdim[n] as f32).to_le_bytes());
            }
            put(&mut out, 70, &self.datatype.to_le_bytes());
            put(&mut out, 72, &self.bitpix.to_le_bytes());
            for (n, x) in [self.vox_offset, self.slope, self.inter].into_iter().enumerate() {
                put(&mut out, 108 + 4 * n, &(x as f32).to_le_bytes());
            }
            put(&mut out, 252, &self.qform_code.to_le_bytes());
            put(&mut out, 254, &self.sform_code.to_le_bytes());
            for (n, x) in self.quatern.iter().chain(&self.qoffset).chain(self.srow.iter().flatten()).enumerate() {
                put(&mut out, 256 + 4 * n, &(*x as f32).to_le_bytes());
            }
            out[344..348].copy_from_slice(&self.magic[..4]);
            if self.text {
                out[148..158].copy_from_slice(b"JANE ROE 1");
            }
        } else {
            put(&mut out, 0, &540i32.to_le_bytes());
            out[4..12].copy_from_slice(&self.magic);
            put(&mut out, 12, &self.datatype.to_le_bytes());
            put(&mut out, 14, &self.bitpix.to_le_bytes());
            for n in 0..8 {
                put(&mut out, 16 + 8 * n, &self.dim[n].to_le_bytes());
                put(&mut out, 104 + 8 * n, &self.pixdim[n].to_le_bytes());
            }
            put(&mut out, 168, &(self.vox_offset as i64).to_le_bytes());
            put(&mut out, 176, &self.slope.to_le_bytes());
            put(&mut out, 184, &self.inter.to_le_bytes());
            put(&mut out, 344, &i32::from(self.qform_code).to_le_bytes());
            put(&mut out, 348, &i32::from(self.sform_code).to_le_bytes());
            for (n, x) in self.quatern.iter().chain(&self.qoffset).chain(self.srow.iter().flatten()).enumerate() {
                put(&mut out, 352 + 8 * n, &x.to_le_bytes());
            }
        }
        for &x in &self.voxels {
            let mut raw = match self.datatype {
                2 => vec![x as u8],
                256 => vec![x as i8 as u8],
                4 => (x as i16).to_le_bytes().to_vec(),
                512 => (x as u16).to_le_bytes().to_vec(),
                8 => (x as i32).to_le_bytes().to_vec(),
                768 => (x as u32).to_le_bytes().to_vec(),
                1024 => (x as i64).to_le_bytes().to_vec(),
                1280 => (x as u64).to_le_bytes().to_vec(),
                16 => (x as f32).to_le_bytes().to_vec(),
                64 => x.to_le_bytes().to_vec(),
                128 => vec![x as u8; 3],
                2304 => vec![x as u8; 4],
                _ => vec![0; 16],
            };
            if self.big {
                raw.reverse();
            }
            out.extend(raw);
        }
        out
    }
}

fn read(bytes: &[u8]) -> NiftiImage {
    decode(bytes, NAME, &ReadOptions::default()).unwrap()
}

/// The message of a refusal, which must name the file.
fn message(bytes: &[u8]) -> String {
    let text = decode(bytes, NAME, &ReadOptions::default()).unwrap_err().to_string();
    assert!(text.starts_with("scan.nii.gz: "), "{text}");
    text
}

/// Gzip as any other program writes it.
fn gzip(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
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
        ("forms disagree", File::with(|f| f.srow[0][3] = 14.0), &["sform and qform", "4.000", "--prefer"]),
        ("mirrored sform", File::with(|f| f.srow[0] = [-1.0, 0.0, 0.0, 13.0]), &["sform and qform", "--prefer"]),
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
        ("two volumes", File::with(|f| f.dim = [4, 2, 3, 2, 2, 1, 1, 1]), &["dim", "2 volumes", "--volume N"]),
        ("vectors", File::with(|f| f.dim = [5, 2, 2, 2, 1, 3, 1, 1]), &["dim", "3 volumes", "--volume N"]),
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
    for (name, hint) in [
        ("a.dcm", "dcm2niix"),
        ("a.img", "join"),
        ("a.mgz", "mri_convert"),
        ("a.nrrd", "3D Slicer"),
        ("a.gz", "dcm2niix"),
    ] {
        let text = decode(&File::sound().bytes(), name, &ReadOptions::default()).unwrap_err().to_string();
        assert!(text.starts_with(&format!("{name}: file name")) && text.contains(hint), "{text}");
    }
    assert!(decode(&File::sound().bytes(), "A.NII.GZ", &ReadOptions::default()).is_ok());
}

#[test]
fn every_version_byte_order_and_packing_reads_the_same() {
    let base = read(&File::sound().bytes());
    assert!(base.warnings.is_empty(), "{:?}", base.warnings);
    assert_eq!(base.volume.grid.dims, [4, 3, 2]);
    let expected: Vec<f32> = (0..24u8).map(f32::from).collect();
    assert_eq!(base.volume.data, expected);
    let last = base.volume.grid.position(Point3::new(3.0, 2.0, 1.0));
    assert!(last.distance_mm(&Position::new(13.0, -16.0, 33.0)) < 1e-9);
    for version in [1, 2] {
        for big in [false, true] {
            let mut file = File::sound();
            if version == 2 {
                file = file.version_2();
            }
            file.big = big;
            for bytes in [file.bytes(), gzip(&file.bytes())] {
                let image = read(&bytes);
                assert_eq!((&image.volume, &image.warnings), (&base.volume, &base.warnings), "{version} {big}");
            }
        }
    }
}

#[test]
fn every_real_data_type_is_read_with_its_scaling() {
    for (datatype, bitpix, signed) in [
        (2, 8, false),
        (256, 8, true),
        (4, 16, true),
        (512, 16, false),
        (8, 32, true),
        (768, 32, false),
        (1024, 64, true),
        (1280, 64, false),
        (16, 32, true),
        (64, 64, true),
    ] {
        for big in [false, true] {
            let bytes = File::with(|f| {
                (f.datatype, f.bitpix, f.big) = (datatype, bitpix, big);
                (f.slope, f.inter) = (0.5, -3.0);
                f.voxels = (0..24).map(|n| f64::from(n - if signed { 12 } else { 0 })).collect();
            });
            let image = read(&bytes);
            for (n, &x) in image.volume.data.iter().enumerate() {
                let stored = n as f32 - if signed { 12.0 } else { 0.0 };
                assert_eq!(x, 0.5 * stored - 3.0, "datatype {datatype}");
            }
        }
    }
    // Slope 0 means: not scaled, whatever the intercept.
    let plain = read(&File::with(|f| (f.slope, f.inter) = (0.0, 55.0)));
    assert_eq!(plain.volume.data[5], 5.0);
}

#[test]
fn nan_voxels_become_zero_and_are_counted() {
    let image = read(&File::with(|f| {
        (f.datatype, f.bitpix) = (16, 32);
        f.voxels[3] = f64::NAN;
        f.voxels[4] = f64::INFINITY;
    }));
    assert_eq!((image.nonfinite_voxels, image.volume.data[3], image.volume.data[4]), (2, 0.0, 0.0));
    assert!(image.warnings[0].contains("2 voxels"), "{:?}", image.warnings);
}

#[test]
fn singleton_dimensions_are_dropped_and_a_volume_can_be_chosen() {
    for dim in [[4, 4, 3, 2, 1, 1, 1, 1], [5, 4, 3, 2, 1, 1, 1, 1], [3, 4, 3, 2, 9, 9, 9, 9]] {
        assert_eq!(read(&File::with(|f| f.dim = dim)).volume.grid.dims, [4, 3, 2]);
    }
    let bytes = File::with(|f| f.dim = [4, 2, 3, 2, 2, 1, 1, 1]);
    for bytes in [bytes.clone(), gzip(&bytes)] {
        for volume in 0..2 {
            let options = ReadOptions { volume: Some(volume), ..ReadOptions::default() };
            let image = decode(&bytes, NAME, &options).unwrap();
            assert_eq!(image.volume.data[0], 12.0 * volume as f32);
        }
        let options = ReadOptions { volume: Some(2), ..ReadOptions::default() };
        assert_eq!(
            decode(&bytes, NAME, &options).unwrap_err().problem,
            NiftiProblem::NoSuchVolume { chosen: 2, volumes: 2 }
        );
    }
}

#[test]
fn the_preferred_form_wins_and_a_small_difference_is_told() {
    let bytes = File::with(|f| f.srow[0][3] = 14.0);
    for (orientation, x) in [(Orientation::Sform, 14.0), (Orientation::Qform, 10.0)] {
        let options = ReadOptions { prefer: Some(orientation), ..ReadOptions::default() };
        let image = decode(&bytes, NAME, &options).unwrap();
        assert_eq!((image.volume.grid.mm_from_voxel[(0, 3)], image.orientation), (x, orientation));
        assert!(image.warnings[0].contains("4.000 mm"), "{:?}", image.warnings);
    }
    let near = read(&File::with(|f| f.srow[0][3] = 10.3));
    assert_eq!(near.orientation, Orientation::Sform);
    assert!(near.warnings[0].contains("0.300 mm"), "{:?}", near.warnings);
    let missing = ReadOptions { prefer: Some(Orientation::Qform), ..ReadOptions::default() };
    let text = decode(&File::with(|f| f.qform_code = 0), NAME, &missing).unwrap_err().to_string();
    assert!(text.contains("qform_code is 0"), "{text}");
}

#[test]
fn a_qform_with_mirrored_axis_and_any_rotation_equals_its_sform() {
    for (n, turn) in [[0.1, 0.2, 0.3], [2.0, -1.0, 0.5], [0.0, 0.0, 3.1], [-2.5, 1.5, 0.7]].into_iter().enumerate() {
        for qfac in [1.0, -1.0] {
            let rotation = Rotation3::new(Vector3::from(turn));
            let q = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
            let q = if q.w < 0.0 { -q } else { q };
            let linear = rotation.matrix() * nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0 * qfac));
            let make = |both: bool| {
                File::with(|f| {
                    f.sform_code = i16::from(both);
                    f.pixdim[0] = qfac;
                    f.quatern = [q.i, q.j, q.k];
                    for r in 0..3 {
                        f.srow[r] = [linear[(r, 0)], linear[(r, 1)], linear[(r, 2)], f.qoffset[r]];
                    }
                })
            };
            let (both, qform) = (read(&make(true)), read(&make(false)));
            assert!(both.warnings.is_empty() && qform.warnings.is_empty(), "{n} {:?}", both.warnings);
            assert_eq!(qform.orientation, Orientation::Qform);
            assert!(both.volume.grid.coincides(&qform.volume.grid, 1e-5));
        }
    }
}

#[test]
fn all_48_orientation_codes_put_every_voxel_where_it_is_by_either_form() {
    let base = read(&File::sound().bytes()).volume;
    let (sizes, spacing) = ([4usize, 3, 2], [1.0, 2.0, 3.0]);
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let codes = orders.into_iter().flat_map(|order| (0..8).map(move |flips| (order, flips)));
    for (order, flips) in codes {
        // Axis `a` of the file runs along axis order[a] of the patient, against it where flipped.
        let flipped = |a: usize| flips >> a & 1 == 1;
        let dims = order.map(|d| sizes[d]);
        let mut linear = nalgebra::Matrix3::zeros();
        let mut origin = Vector3::new(10.0, -20.0, 30.0);
        for (a, &d) in order.iter().enumerate() {
            linear[(d, a)] = if flipped(a) { -1.0 } else { 1.0 };
            if flipped(a) {
                origin[d] += spacing[d] * (sizes[d] as f64 - 1.0);
            }
        }
        let voxels: Vec<f64> = (0..24)
            .map(|n| {
                let v = [n % dims[0], n / dims[0] % dims[1], n / (dims[0] * dims[1])];
                let mut at = [0; 3];
                for a in 0..3 {
                    at[order[a]] = if flipped(a) { dims[a] - 1 - v[a] } else { v[a] };
                }
                f64::from(base.at(at[0], at[1], at[2]))
            })
            .collect();
        let qfac = linear.determinant();
        let mut proper = linear;
        proper.column_mut(2).scale_mut(qfac);
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(proper)).into_inner();
        let q = if q.w < 0.0 { -q } else { q };
        for form in [Orientation::Sform, Orientation::Qform] {
            let image = read(&File::with(|f| {
                (f.sform_code, f.qform_code) =
                    (i16::from(form == Orientation::Sform), i16::from(form == Orientation::Qform));
                f.quatern = [q.i, q.j, q.k];
                f.pixdim[0] = qfac;
                f.qoffset = origin.into();
                for a in 0..3 {
                    f.dim[1 + a] = dims[a] as i64;
                    f.pixdim[1 + a] = spacing[order[a]];
                    f.srow[a] =
                        [0, 1, 2, 3].map(|c| if c < 3 { linear[(a, c)] * spacing[order[c]] } else { origin[a] });
                }
                f.voxels.clone_from(&voxels);
            }));
            assert_eq!((image.orientation, image.volume.grid.dims), (form, dims));
            for n in 0..24 {
                let voxel = Point3::from(base.grid.voxel(n).map(|v| v as f64));
                let found = image.volume.nearest(base.grid.position(voxel));
                assert_eq!(found, Some(base.data[n]), "{order:?} {flips:03b} {form:?}");
            }
        }
    }
}

#[test]
fn labels_and_masks_hold_what_they_should() {
    let options = ReadOptions::default();
    let (labels, _) = decode_labels(&File::sound().bytes(), NAME, &options).unwrap();
    assert_eq!(labels.data[23], 23);
    let fractions = File::with(|f| f.slope = 0.3);
    let text = decode_labels(&fractions, NAME, &options).unwrap_err().to_string();
    assert!(text.contains("voxels") && text.contains("whole numbers") && text.contains("label map"), "{text}");
    let (mask, _) = decode_mask(&File::sound().bytes(), NAME, &options).unwrap();
    assert_eq!((mask.count(), mask.data[0]), (23, false));
    let (soft, warnings) = decode_mask(&File::with(|f| f.slope = 1.0 / 24.0), NAME, &options).unwrap();
    assert!(soft.count() == 12 && warnings[0].contains("fractions"), "{} {warnings:?}", soft.count());
    let empty = File::with(|f| f.voxels = vec![0.0; 24]);
    let text = decode_mask(&empty, "mask.nii", &options).unwrap_err().to_string();
    assert!(text.starts_with("mask.nii: voxels: the mask is empty") && text.contains("leave the option out"), "{text}");
}

fn oblique() -> Grid<Pre> {
    let turn = Rotation3::new(Vector3::new(0.3, -0.2, 2.5)).to_homogeneous();
    let scale = Matrix4::new_nonuniform_scaling(&Vector3::new(0.9, 1.1, -2.5));
    let mut affine = turn * scale;
    affine.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::new(-1234.5, 67.8, 901.2));
    Grid::new([7, 6, 5], affine).unwrap()
}

#[test]
fn what_is_written_reads_back_with_both_forms_and_no_text() {
    let grid = oblique();
    let data: Vec<f32> = (0..grid.len()).map(|n| (n as f32).sin() * 1000.0).collect();
    let scan = Volume::from_data(grid, data);
    let bytes = encode_f32(&scan);
    assert_eq!(bytes, encode_f32(&scan));
    for prefer in [None, Some(Orientation::Sform), Some(Orientation::Qform)] {
        let options = ReadOptions { prefer, ..ReadOptions::default() };
        let image = decode(&bytes, NAME, &options).unwrap();
        assert!(image.warnings.is_empty(), "{:?}", image.warnings);
        assert_eq!(image.volume.data, scan.data);
        assert!(image.volume.grid.coincides(&grid.relabelled::<Native>(), 2e-4));
    }
    let labels = scan.map(|x| x as i32 as u8);
    assert_eq!(decode_labels(&encode_u8(&labels), NAME, &ReadOptions::default()).unwrap().0.data, labels.data);
    let whole = scan.map(|x| x as i16);
    let read_back: Vec<i16> = read(&encode_i16(&whole)).volume.data.iter().map(|&x| x as i16).collect();
    assert_eq!(read_back, whole.data);
    let mask: Mask<Pre> = scan.map(|x| x > 300.0);
    assert_eq!(decode_mask(&encode_mask(&mask), NAME, &ReadOptions::default()).unwrap().0.data, mask.data);
    let vectors = scan.map(|x| [x, 2.0 * x, -x]);
    for (component, factor) in [1.0, 2.0, -1.0].into_iter().enumerate() {
        let options = ReadOptions { volume: Some(component), ..ReadOptions::default() };
        let image = decode(&encode_vectors(&vectors), NAME, &options).unwrap();
        assert_eq!(image.volume.data, scan.map(|x| x * factor).data);
    }

    // Text of the input does not survive, and nothing else writes any: all text fields and the time are zero.
    let mut named = File::sound();
    named.text = true;
    let again = encode_f32(&read(&named.bytes()).volume);
    assert_eq!(again[3..9], [0; 6], "gzip flags, time and hint");
    let mut raw = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&again[..]), &mut raw).unwrap();
    assert!(raw[4..38].iter().chain(&raw[148..252]).chain(&raw[328..344]).chain(&raw[348..352]).all(|&b| b == 0));
}

#[test]
fn a_sheared_grid_is_written_without_the_quaternion_it_does_not_fit() {
    let mut affine = Matrix4::identity();
    affine[(0, 1)] = 0.3;
    let grid = Grid::<Mni>::new([3, 3, 3], affine).unwrap();
    let image = read(&encode_f32(&Volume::from_data(grid, (0..27u8).map(f32::from).collect())));
    assert!(image.volume.grid.coincides(&grid.relabelled::<Native>(), 1e-6));
    assert!(image.warnings.iter().any(|w| w.contains("perpendicular")), "{:?}", image.warnings);
}

#[test]
fn a_grid_too_long_for_the_first_version_is_written_in_the_second() {
    let grid = Grid::<Pre>::axis_aligned([40000, 2, 2], [0.1; 3], [0.0; 3]);
    let long = Volume::from_data(grid, (0..grid.len()).map(|n| (n % 251) as u8).collect());
    let image = read(&encode_u8(&long));
    assert_eq!(image.volume.grid.dims, grid.dims);
    assert!(image.warnings.is_empty() && image.volume.grid.coincides(&grid.relabelled::<Native>(), 1e-9));
}

/// Steps of a counter through a mixing function (splitmix64): the same inputs on every machine.
struct Mutations(u64);

impl Mutations {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e3779b97f4a7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
        ((z ^ (z >> 31)) % below as u64) as usize
    }
}

/// The number of inputs can be raised: `HGM_FUZZ_INPUTS=1000000 cargo test --release --test it arbitrary`.
#[test]
fn arbitrary_and_mutated_files_never_panic() {
    let inputs: u64 = std::env::var("HGM_FUZZ_INPUTS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let plain = [File::sound(), File::sound().version_2(), {
        let mut big = File::sound();
        big.big = true;
        big
    }]
    .map(|f| f.bytes());
    let packed = plain.clone().map(|b| gzip(&b));
    let (mut accepted, mut refused) = (0, 0);
    for n in 0..inputs {
        let mut random = Mutations(n << 20);
        let mut bytes = match random.next(8) {
            0 => (0..random.next(700)).map(|_| random.next(256) as u8).collect(),
            1 | 2 => packed[random.next(3)].clone(),
            _ => plain[random.next(3)].clone(),
        };
        for _ in 0..random.next(6) {
            if bytes.is_empty() {
                break;
            }
            let at = random.next(bytes.len());
            match random.next(5) {
                0 => bytes[at] = random.next(256) as u8,
                1 => bytes[at] ^= 1 << random.next(8),
                2 => bytes.truncate(at),
                3 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][random.next(5)],
                // In the header, where every byte means something.
                _ => {
                    let last = bytes.len().min(540) - 1;
                    bytes[at.min(last)] = random.next(256) as u8;
                }
            }
        }
        // Sometimes packed after the damage, so that the damage is behind a valid checksum.
        if random.next(10) == 0 {
            bytes = gzip(&bytes);
        }
        let options = ReadOptions {
            prefer: [None, Some(Orientation::Sform), Some(Orientation::Qform)][random.next(3)],
            volume: [None, Some(0), Some(1)][random.next(3)],
        };
        match decode(&bytes, "x.nii", &options) {
            Ok(image) => {
                accepted += 1;
                assert!(image.volume.data.iter().all(|x| x.is_finite()));
                assert_eq!(image.volume.data.len(), image.volume.grid.len());
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().starts_with("x.nii: "));
            }
        }
        let _ = decode_labels(&bytes, "x.nii", &options);
        let _ = decode_mask(&bytes, "x.nii", &options);
    }
    // Both roads are travelled, or this test tests nothing.
    assert!(accepted > inputs / 50 && refused > inputs / 50, "{accepted} {refused}");
}

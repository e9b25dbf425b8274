//! FreeSurfer's .mgh and .mgz: their header read into the fields of NIfTI's, so that the same guards judge both.
//!
//! Layout: `utils/mri.cpp` (`mghRead`) of the FreeSurfer sources. Everything is big-endian; voxels begin at byte 284.

use super::error::NiftiProblem;
use super::header::Header;
use nalgebra::{Matrix3, Vector3};
use nifti::Endianness;

/// Bytes before the first voxel.
pub(super) const HEADER_BYTES: usize = 284;
/// Bytes of it that are used.
const USED: usize = 90;

/// Whether a file's name says that it is one of FreeSurfer's.
pub(super) fn is_mgh(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.ends_with(".mgz") || name.ends_with(".mgh")
}

/// Reads the fields from the first bytes of an (unpacked) file.
pub(super) fn header(bytes: &[u8]) -> Result<Header, NiftiProblem> {
    if bytes.len() < USED {
        return Err(NiftiProblem::NotMgh { bytes: bytes.len(), version: 0 });
    }
    let raw = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
    let int = |n: usize| i32::from_be_bytes(raw(4 * n));
    let version = int(0);
    if version != 1 {
        return Err(NiftiProblem::NotMgh { bytes: bytes.len(), version });
    }
    let [width, height, depth, frames] = [1, 2, 3, 4].map(|n| i64::from(int(n)));
    let (datatype, bitpix) = match int(5) {
        0 => (2, 8),
        1 => (8, 32),
        3 => (16, 32),
        4 => (4, 16),
        10 => (512, 16),
        code => {
            return Err(NiftiProblem::DataType {
                code,
                kind: "not a type of MGH files that holds one number per voxel",
                remedy: "save it with mri_convert -odt float",
            });
        }
    };
    // Without this flag FreeSurfer assumes coronal slices: a guess about left and right.
    if i16::from_be_bytes([bytes[28], bytes[29]]) != 1 {
        return Err(NiftiProblem::NoRas);
    }
    let float = |n: usize| f64::from(f32::from_be_bytes(raw(30 + 4 * n)));
    let spacing = Vector3::new(float(0), float(1), float(2));
    // Columns are the directions of the voxel axes; the last three numbers are the position of the middle.
    let directions = Matrix3::from_fn(|row, column| float(3 + 3 * column + row));
    let middle = Vector3::new(float(12), float(13), float(14));
    let linear = directions * Matrix3::from_diagonal(&spacing);
    let origin = middle - linear * Vector3::new(width as f64, height as f64, depth as f64) / 2.0;
    let row = |r: usize| [linear[(r, 0)], linear[(r, 1)], linear[(r, 2)], origin[r]];
    Ok(Header {
        endianness: Endianness::Big,
        dim: [4, width, height, depth, frames, 1, 1, 1],
        intent: 0,
        datatype,
        bitpix,
        pixdim: [1.0, spacing.x, spacing.y, spacing.z, 1.0, 1.0, 1.0, 1.0],
        vox_offset: HEADER_BYTES as f64,
        scl_slope: 1.0,
        scl_inter: 0.0,
        xyzt_units: 2,
        qform_code: 0,
        sform_code: 1,
        quatern: [0.0; 3],
        qoffset: [0.0; 3],
        srow: [row(0), row(1), row(2)],
        size: HEADER_BYTES,
    })
}

#[cfg(test)]
mod tests {
    use super::super::{ReadOptions, decode, decode_codes};
    use crate::geometry::Position;

    /// A file as FreeSurfer conforms them: coronal slices, left to right reversed, head to foot reversed.
    fn conformed(kind: i32, flag: i16, voxel: impl Fn(usize) -> Vec<u8>) -> Vec<u8> {
        let mut bytes: Vec<u8> = [1, 4, 3, 5, 1, kind, 0].iter().flat_map(|x: &i32| x.to_be_bytes()).collect();
        bytes.extend(flag.to_be_bytes());
        let numbers = [1.0f32, 2.0, 1.5, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 10.0, -20.0, 30.0];
        bytes.extend(numbers.iter().flat_map(|x| x.to_be_bytes()));
        bytes.resize(284, 0);
        bytes.extend((0..60).flat_map(voxel));
        bytes
    }

    #[test]
    fn voxels_lie_where_the_header_puts_them() {
        let bytes = conformed(1, 1, |n| (n as i32).to_be_bytes().to_vec());
        for name in ["aseg.mgh", "ASEG.MGZ"] {
            let image = decode(&bytes, name, &ReadOptions::default()).unwrap();
            assert_eq!(image.volume.grid.dims, [4, 3, 5]);
            // The middle of the volume, between voxels, is at (10, -20, 30); i goes left, j down, k forward.
            let at = |x: f64, y: f64, z: f64| image.volume.nearest(Position::new(x, y, z));
            assert_eq!(
                at(12.0, -23.75, 33.0),
                Some(0.0),
                "first voxel: i - 2 of 1 mm, j - 1.5 of 2 mm, k - 2.5 of 1.5 mm"
            );
            assert_eq!(at(11.0, -23.75, 33.0), Some(1.0));
            assert_eq!(at(12.0, -23.75, 31.0), Some(4.0));
            assert_eq!(at(12.0, -22.25, 33.0), Some(12.0));
        }
    }

    #[test]
    fn every_type_is_read_and_large_label_numbers_stay_whole() {
        let int = conformed(1, 1, |n| if n < 30 { 12_175i32 } else { 2035 }.to_be_bytes().to_vec());
        let (codes, _) = decode_codes(&int, "aparc.mgz", &ReadOptions::default()).unwrap();
        assert_eq!((codes.data[0], codes.data[59]), (12_175, 2035));
        for (kind, bytes) in [
            (0, conformed(0, 1, |n| vec![n as u8])),
            (3, conformed(3, 1, |n| (n as f32).to_be_bytes().to_vec())),
            (4, conformed(4, 1, |n| (n as i16).to_be_bytes().to_vec())),
            (10, conformed(10, 1, |n| (n as u16).to_be_bytes().to_vec())),
        ] {
            let image = decode(&bytes, "t1.mgz", &ReadOptions::default()).unwrap();
            assert_eq!(image.volume.data[59], 59.0, "type {kind}");
        }
    }

    #[test]
    fn what_cannot_be_believed_is_refused_in_words() {
        let good = conformed(0, 1, |n| vec![n as u8]);
        let said = |bytes: &[u8]| decode(bytes, "t1.mgz", &ReadOptions::default()).unwrap_err().to_string();
        assert!(said(&conformed(0, 0, |n| vec![n as u8])).contains("goodRASFlag"));
        assert!(said(&conformed(2, 1, |n| vec![n as u8])).contains("datatype is 2"));
        assert!(said(&good[..300]).contains("truncated"));
        assert!(said(&good[..50]).contains("284"));
        assert!(said(b"this is some text and no image at all, whatever its name may say about that, and long enough to be one")
            .contains("version"));
    }
}

//! NIfTI-1 and NIfTI-2 bytes to volumes and back, and FreeSurfer's .mgh and .mgz to volumes, behind one guard.
//!
//! The voxels are decoded by the `nifti` crate; everything around it is checked here, because a wrong answer about a
//! patient's left and right is worse than none: gzip CRC and length, header against real size before anything is reserved,
//! data type, scaling, orientation (none, two that disagree, singular), voxel size. NaN voxels become 0 and are counted.

mod displacement;
mod encode;
mod error;
mod floor;
mod gzip;
mod header;
mod magnitude;
mod mgh;
mod orientation;
mod warning;
mod which;

pub use displacement::{decode_displacement, decode_displacement_as, encode_displacement};
pub use encode::{encode_f32, encode_i16, encode_intensities, encode_mask, encode_numbers, encode_u8, encode_vectors};
pub use error::{NiftiError, NiftiProblem};
pub use warning::NiftiWarning;
pub use which::Orientation;

use super::components::fill_holes;
use super::grid::Grid;
use super::volume::{LabelMap, Mask, Volume};
use crate::geometry::Native;
use header::{Header, Layout};
use nifti::{InMemNiftiVolume, IntoNdArray, NiftiType};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Choices that a file may leave open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReadOptions {
    /// Which affine to believe when sform and qform disagree; `None` refuses such a file.
    pub prefer: Option<Orientation>,
    /// Which volume (from 0) of a file that holds several; `None` refuses such a file. One that holds a single volume is
    /// read whatever is chosen.
    pub volume: Option<usize>,
}

/// A scan as read.
#[derive(Clone, Debug)]
pub struct NiftiImage {
    /// The scaled intensities on the file's own grid, all finite.
    pub volume: Volume<f32, Native>,
    /// What was odd and read all the same; without the file's name.
    pub warnings: Vec<NiftiWarning>,
    /// Voxels that were NaN or infinite and are 0 now.
    pub nonfinite_voxels: usize,
    /// How much of them lies within the image, not joined to its border, cc.
    pub hole_cc: f64,
    /// Which affine the grid comes from.
    pub orientation: Orientation,
}

/// Reads a scan. `name` is what messages call the file; it must end in `.nii`, `.nii.gz`, `.mgz` or `.mgh`.
///
/// # Errors
/// [`NiftiError`] names the file, the field and the remedy for everything that is refused.
pub fn decode(bytes: &[u8], name: &str, options: &ReadOptions) -> Result<NiftiImage, NiftiError> {
    let image = read(bytes, name, options)?;
    let first = image.volume.data[0];
    if image.volume.data.iter().all(|&x| x == first) {
        return Err(refused(name, NiftiProblem::Constant { value: first }));
    }
    Ok(image)
}

/// [`decode`] for what a scanner shows: where intensities begin well below zero they are counted from there, and where all are
/// tiny or huge they are read in another unit.
///
/// # Errors
/// As [`decode`].
pub fn decode_scan(bytes: &[u8], name: &str, options: &ReadOptions) -> Result<NiftiImage, NiftiError> {
    /// A few voxels are a resampler's slip; more is a place of which nothing is known, which 0 would make fluid.
    const LARGEST_HOLE_CC: f64 = 1.0;
    let mut image = decode(bytes, name, options)?;
    if image.hole_cc > LARGEST_HOLE_CC {
        return Err(refused(name, NiftiProblem::Hole { cc: image.hole_cc }));
    }
    let floor = floor::counted_from_their_floor(&mut image.volume.data);
    image.warnings.extend(floor.map(|floor| NiftiWarning::BelowZero { floor: f64::from(floor) }));
    let factor = magnitude::brought_to_a_usual_size(&mut image.volume.data);
    image.warnings.extend(factor.map(|factor| NiftiWarning::UnusualUnit { factor: f64::from(factor) }));
    Ok(image)
}

/// Reads numbers or labels of any kind: a scan, a label map, a map of one value. Returns the warnings beside it.
///
/// # Errors
/// [`NiftiError`] as [`decode`], but for an image of one value.
pub fn decode_intensities(
    bytes: &[u8],
    name: &str,
    options: &ReadOptions,
) -> Result<(Volume<f32, Native>, Vec<NiftiWarning>), NiftiError> {
    read(bytes, name, options).map(|image| (image.volume, image.warnings))
}

/// Reads a label map: whole numbers from 0 to 255. Returns the warnings beside it.
///
/// # Errors
/// [`NiftiError`], also for values that are no labels.
pub fn decode_labels(
    bytes: &[u8],
    name: &str,
    options: &ReadOptions,
) -> Result<(LabelMap<Native>, Vec<NiftiWarning>), NiftiError> {
    let image = read(bytes, name, options)?;
    // Scaling in 32 bits leaves 2.9999998 for 3.
    let is_label = |x: f32| (x - x.round_ties_even()).abs() < 1e-3 && (-0.5..255.5).contains(&x);
    let count = image.volume.data.par_iter().filter(|&&x| !is_label(x)).count();
    if count > 0 {
        let first = image.volume.data.iter().copied().find(|&x| !is_label(x)).unwrap_or(f32::NAN);
        return Err(refused(name, NiftiProblem::NotLabels { count, first }));
    }
    Ok((image.volume.map(|x| x.round_ties_even() as u8), image.warnings))
}

/// Reads a label map as another tool wrote it: whole numbers from 0 to 2^24. Returns the warnings beside it.
///
/// # Errors
/// [`NiftiError`], also for values that are no labels.
pub fn decode_codes(
    bytes: &[u8],
    name: &str,
    options: &ReadOptions,
) -> Result<(Volume<u32, Native>, Vec<NiftiWarning>), NiftiError> {
    let image = read(bytes, name, options)?;
    // Beyond this, 32-bit floats skip whole numbers.
    const LARGEST: f32 = 16_777_216.0;
    let is_code = |x: f32| (x - x.round()).abs() < 1e-3 && (-0.5..=LARGEST).contains(&x);
    let mut others = image.volume.data.iter().copied().filter(|&x| !is_code(x));
    if let Some(first) = others.next() {
        return Err(refused(name, NiftiProblem::NotCodes { count: 1 + others.count(), first }));
    }
    Ok((image.volume.map(|x| x.round() as u32), image.warnings))
}

/// Reads a mask. Whole numbers: one number besides 0, which is inside. Fractions (a soft mask): above half of the largest
/// value, and a warning says so. Returns the warnings beside it.
///
/// # Errors
/// [`NiftiError`], also for a mask without a voxel inside and for a label map.
pub fn decode_mask(
    bytes: &[u8],
    name: &str,
    options: &ReadOptions,
) -> Result<(Mask<Native>, Vec<NiftiWarning>), NiftiError> {
    let NiftiImage { volume, mut warnings, .. } = read(bytes, name, options)?;
    let soft = volume.data.iter().any(|x| (x - x.round()).abs() > 1e-3);
    let mask = if soft {
        let half = 0.5 * volume.data.iter().copied().fold(0f32, f32::max);
        warnings.push(NiftiWarning::SoftMask { half });
        volume.map(|x| x > half)
    } else {
        let mut numbers: Vec<i64> = Vec::new();
        for x in &volume.data {
            let number = x.round() as i64;
            if number != 0 && numbers.last() != Some(&number) && !numbers.contains(&number) {
                numbers.push(number);
            }
            if numbers.len() > MOST_LISTED {
                break;
            }
        }
        if numbers.len() > 1 {
            numbers.sort_unstable();
            return Err(refused(name, NiftiProblem::NotMask { numbers }));
        }
        volume.map(|x| x.round() != 0.0)
    };
    if mask.data.iter().all(|&inside| !inside) {
        return Err(refused(name, NiftiProblem::EmptyMask));
    }
    Ok((mask, warnings))
}

/// Numbers of a label map that a message lists.
const MOST_LISTED: usize = 6;

/// Where the voxels of a NIfTI file lie; they themselves are not looked at.
///
/// # Errors
/// [`NiftiError`] for a header that is refused.
pub fn decode_grid(bytes: &[u8], name: &str) -> Result<Grid<Native>, NiftiError> {
    let read = || {
        let header = Header::parse(&head_of(bytes)?)?;
        let dims = header.layout(Some(0))?.dims;
        Ok(orientation::grid(&header, dims, None, &mut Vec::new())?.0)
    };
    read().map_err(|problem| refused(name, problem))
}

/// Whether the header says that the coordinates are those of the MNI template (code 4 for the affine that is believed).
/// False for what is no NIfTI.
pub fn says_mni(bytes: &[u8]) -> bool {
    code_of(bytes) == Some(4)
}

/// Whether the header says that the coordinates are the scanner's (code 1 for the affine that is believed). False for what
/// is no NIfTI.
pub fn says_scanner(bytes: &[u8]) -> bool {
    code_of(bytes) == Some(1)
}

/// The code of the affine that is believed (1 scanner, 2 aligned to something else, 3 Talairach, 4 MNI; 0 or another where the
/// header says no frame). `None` for what is no NIfTI.
pub fn code_of(bytes: &[u8]) -> Option<i32> {
    let header = Header::parse(&head_of(bytes).ok()?).ok()?;
    Some(if header.sform_code > 0 { header.sform_code } else { header.qform_code })
}

fn refused(name: &str, problem: NiftiProblem) -> NiftiError {
    NiftiError { file: name.to_owned(), problem }
}

fn read(bytes: &[u8], name: &str, options: &ReadOptions) -> Result<NiftiImage, NiftiError> {
    let known = if mgh::is_mgh(name) { Ok(()) } else { check_extension(name) };
    known.and_then(|()| read_checked(bytes, mgh::is_mgh(name), options)).map_err(|problem| refused(name, problem))
}

fn check_extension(name: &str) -> Result<(), NiftiProblem> {
    let name = name.to_ascii_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
    if ends(&[".nii", ".nii.gz"]) {
        return Ok(());
    }
    let hint = if ends(&[".dcm", ".ima"]) {
        "convert the DICOM series with dcm2niix"
    } else if ends(&[".hdr", ".img", ".hdr.gz", ".img.gz"]) {
        "join the header/image pair into one .nii file (fslchfiletype NIFTI_GZ, or load and save with nibabel)"
    } else if ends(&[".nrrd", ".nhdr", ".mha", ".mhd"]) {
        "save it as NIfTI (3D Slicer or SimpleITK do)"
    } else {
        "convert the scan with dcm2niix"
    };
    Err(NiftiProblem::Extension { hint })
}

/// The first bytes, unpacked.
fn head_of(bytes: &[u8]) -> Result<Cow<'_, [u8]>, NiftiProblem> {
    if gzip::is_gzip(bytes) {
        gzip::head(bytes, header::HEADER_BYTES).map(Cow::Owned)
    } else {
        Ok(Cow::Borrowed(bytes))
    }
}

fn read_checked(bytes: &[u8], mgh: bool, options: &ReadOptions) -> Result<NiftiImage, NiftiProblem> {
    let packed = gzip::is_gzip(bytes);
    let head = head_of(bytes)?;
    let header = if mgh { mgh::header(&head)? } else { Header::parse(&head)? };
    let layout = header.layout(options.volume)?;
    let (slope, intercept) = header.scaling()?;
    let mut warnings = Vec::new();
    let (grid, orientation) = orientation::grid(&header, layout.dims, options.prefer.filter(|_| !mgh), &mut warnings)?;
    let of_datatype = 8 * layout.kind.size_of();
    if header.bitpix as usize != of_datatype {
        warnings.push(NiftiWarning::Bits { bitpix: header.bitpix, datatype: header.datatype, of_datatype });
    }
    let raw = if packed {
        gzip::part(bytes, layout.first, layout.bytes, layout.end)?
    } else {
        if (bytes.len() as u64) < layout.end {
            return Err(NiftiProblem::Truncated { declared: layout.end, found: bytes.len() as u64 });
        }
        // Behind the check the places fit usize.
        bytes[layout.first as usize..(layout.first + layout.bytes) as usize].to_vec()
    };
    let mut data = voxels(raw, &layout, &header, slope, intercept)?;
    let nonfinite_voxels = data.par_iter().filter(|x| !x.is_finite()).count();
    let mut hole_cc = 0.0;
    if nonfinite_voxels > 0 {
        let finite = Volume::from_fn(grid, |n| data[n].is_finite());
        hole_cc = fill_holes(&finite).volume_cc() - finite.volume_cc();
        data.par_iter_mut().filter(|x| !x.is_finite()).for_each(|x| *x = 0.0);
        warnings.push(NiftiWarning::NotFinite { voxels: nonfinite_voxels });
    }
    Ok(NiftiImage { volume: Volume::from_data(grid, data), warnings, nonfinite_voxels, hole_cc, orientation })
}

/// Voxels through the crate. The scaling is ours: the crate scales integers in the precision of the result.
fn voxels(
    raw: Vec<u8>,
    layout: &Layout,
    header: &Header,
    slope: f64,
    intercept: f64,
) -> Result<Vec<f32>, NiftiProblem> {
    let [nx, ny, nz] = layout.dims.map(|n| n as u16);
    let failed = |e: &nifti::NiftiError| NiftiProblem::DataType {
        code: header.datatype,
        kind: "not readable",
        remedy: if matches!(e, nifti::NiftiError::IncompatibleLength(..)) {
            "the data is shorter than declared; export the file again"
        } else {
            "save it as float32"
        },
    };
    let dim = [3, nx, ny, nz, 1, 1, 1, 1];
    let volume = InMemNiftiVolume::from_raw_fields(dim, layout.kind, 0.0, 0.0, raw, header.endianness);
    let volume = volume.map_err(|e| failed(&e))?;
    let plain = slope == 1.0 && intercept == 0.0;
    let scaled = |x: f64| (x * slope + intercept) as f32;
    // Up to 16 bits a 32-bit float holds every value; beyond, the scaling starts from 64 bits.
    match layout.kind {
        NiftiType::Int32 | NiftiType::Uint32 | NiftiType::Int64 | NiftiType::Uint64 | NiftiType::Float64 => {
            let array = volume.into_ndarray::<f64>().map_err(|e| failed(&e))?;
            Ok(array.into_raw_vec_and_offset().0.into_iter().map(scaled).collect())
        }
        _ => {
            let array = volume.into_ndarray::<f32>().map_err(|e| failed(&e))?;
            let mut data = array.into_raw_vec_and_offset().0;
            if !plain {
                for x in &mut data {
                    *x = scaled(f64::from(*x));
                }
            }
            Ok(data)
        }
    }
}

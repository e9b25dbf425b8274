//! Volumes to NIfTI bytes: one deterministic `.nii.gz`, without a word about the patient, the machine or the time.

use super::gzip::{self, Numbers};
use super::orientation::shear;
use crate::geometry::Frame;
use crate::image::{Grid, Mask, Volume};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rayon::prelude::*;

/// `NIFTI_INTENT_DISPVECT`: components along the axes of NIfTI's frame (RAS); ITK from 5.3 on turns them.
pub(super) const DISPLACEMENT: i16 = 1006;

/// 32-bit floats as `.nii.gz` bytes.
pub fn encode_f32<F: Frame>(volume: &Volume<f32, F>) -> Vec<u8> {
    scalars(volume, 16, f32::to_le_bytes)
}

/// 32-bit floats by voxel (i, j, k), packed in less time: maps of numbers that are like no other.
pub fn encode_numbers<F: Frame>(grid: &Grid<F>, value: impl Fn([usize; 3]) -> f32 + Sync) -> Vec<u8> {
    let write = |first, [piece]: [&mut [u8]; 1]| {
        let numbers = piece.as_chunks_mut::<4>().0;
        for ([i, j, k], row) in rows(grid.dims, first, numbers.len()) {
            for (n, out) in numbers[row].iter_mut().enumerate() {
                *out = value([i + n, j, k]).to_le_bytes();
            }
        }
    };
    gzip::pack_fast(&scalar_header(grid, 16, 32), &Numbers { count: grid.len(), size: 4, write: &write })
}

/// Bytes (labels, small intensities) as `.nii.gz` bytes.
pub fn encode_u8<F: Frame>(volume: &Volume<u8, F>) -> Vec<u8> {
    scalars(volume, 2, |x| [x])
}

/// 16-bit integers as `.nii.gz` bytes.
pub fn encode_i16<F: Frame>(volume: &Volume<i16, F>) -> Vec<u8> {
    scalars(volume, 4, i16::to_le_bytes)
}

/// Intensities as `.nii.gz` bytes: whole numbers in 8 or 16 bits where all are and fit, else 32-bit floats.
pub fn encode_intensities<F: Frame>(volume: &Volume<f32, F>) -> Vec<u8> {
    let whole = volume.data.par_iter().all(|x| *x == x.round());
    let within = |low: f32, high: f32| whole && volume.data.par_iter().all(|x| (low..=high).contains(x));
    if within(0.0, 255.0) {
        encode_u8(&volume.map(|x| x as u8))
    } else if within(f32::from(i16::MIN), f32::from(i16::MAX)) {
        encode_i16(&volume.map(|x| x as i16))
    } else {
        encode_f32(volume)
    }
}

/// A mask as `.nii.gz` bytes: 1 inside, 0 outside, 8 bits.
pub fn encode_mask<F: Frame>(mask: &Mask<F>) -> Vec<u8> {
    scalars(mask, 2, |inside| [u8::from(inside)])
}

/// Three 32-bit floats per voxel (a displacement in mm, RAS) as `.nii.gz` bytes, 5-D with `dim[5] = 3` as the NIfTI
/// standard stores vectors.
pub fn encode_vectors<F: Frame>(volume: &Volume<[f32; 3], F>) -> Vec<u8> {
    let grid = &volume.grid;
    let write = vectors(grid.dims, |[i, j, k]| volume.at(i, j, k));
    gzip::pack(&vector_header(grid, DISPLACEMENT), &Numbers { count: grid.len(), size: 4, write: &write })
}

/// Header of five dimensions and three components.
pub(super) fn vector_header<F: Frame>(grid: &Grid<F>, intent: i16) -> Vec<u8> {
    let mut header = header_1(grid, 16, 32);
    for (n, size) in [(0, 5i16), (4, 1), (5, 3)] {
        header[40 + 2 * n..42 + 2 * n].copy_from_slice(&size.to_le_bytes());
    }
    header[68..70].copy_from_slice(&intent.to_le_bytes());
    header
}

/// Writes components of vectors, one run each.
pub(super) fn vectors(
    dims: [usize; 3],
    value: impl Fn([usize; 3]) -> [f32; 3] + Sync,
) -> impl Fn(usize, [&mut [u8]; 3]) + Sync {
    move |first, pieces| {
        let [x, y, z] = pieces.map(|piece| piece.as_chunks_mut::<4>().0);
        for ([i, j, k], row) in rows(dims, first, x.len()) {
            let row = x[row.clone()].iter_mut().zip(&mut y[row.clone()]).zip(&mut z[row]);
            for (n, ((x, y), z)) in row.enumerate() {
                [*x, *y, *z] = value([i + n, j, k]).map(f32::to_le_bytes);
            }
        }
    }
}

/// The rows of `count` voxels from a place in memory on: the first voxel of each, and which of them lie in it.
fn rows(
    [nx, ny, _]: [usize; 3],
    first: usize,
    count: usize,
) -> impl Iterator<Item = ([usize; 3], std::ops::Range<usize>)> {
    let mut done = 0;
    std::iter::from_fn(move || {
        let n = first + done;
        let row = done..count.min(done + nx - n % nx);
        done = row.end;
        (!row.is_empty()).then(|| ([n % nx, n / nx % ny, n / nx / ny], row))
    })
}

/// Values of `N` bytes each with their header.
fn scalars<T: Copy + Sync, F: Frame, const N: usize>(
    volume: &Volume<T, F>,
    datatype: i16,
    to_bytes: impl Fn(T) -> [u8; N] + Sync,
) -> Vec<u8> {
    let write = |first: usize, [piece]: [&mut [u8]; 1]| {
        for (x, out) in volume.data[first..].iter().zip(piece.as_chunks_mut::<N>().0) {
            *out = to_bytes(*x);
        }
    };
    let header = scalar_header(&volume.grid, datatype, 8 * N as i16);
    gzip::pack(&header, &Numbers { count: volume.data.len(), size: N, write: &write })
}

/// NIfTI-1 stores sizes in 16 bits; everything reads it, so NIfTI-2 only where it must be.
fn scalar_header<F: Frame>(grid: &Grid<F>, datatype: i16, bits: i16) -> Vec<u8> {
    let large = grid.dims.iter().any(|&n| n > i16::MAX as usize);
    if large { header_2(grid, datatype, bits) } else { header_1(grid, datatype, bits) }
}

/// What the orientation fields of a grid hold.
struct Form {
    code: i16,
    /// The quaternion can only hold perpendicular axes.
    qform: bool,
    qfac: f64,
    quatern: [f64; 3],
    offset: [f64; 3],
    rows: [[f64; 4]; 3],
    size_mm: [f64; 3],
}

fn form<F: Frame>(grid: &Grid<F>) -> Form {
    let m = &grid.mm_from_voxel;
    let linear: Matrix3<f64> = m.fixed_view::<3, 3>(0, 0).into_owned();
    let size_mm = grid.spacing_mm();
    let qfac = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
    let axes = Matrix3::from_columns(&[
        linear.column(0) / size_mm[0],
        linear.column(1) / size_mm[1],
        linear.column(2) / (size_mm[2] * qfac),
    ]);
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)).into_inner();
    // The standard stores b, c, d and means the root with a >= 0.
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    Form {
        // Scanner coordinates, or aligned to another image: MNI is reached rigidly, so code 4 (MNI size) would be untrue.
        code: if F::NAME == "MNI" { 2 } else { 1 },
        qform: shear(&linear) < 1e-5,
        qfac,
        quatern: [q.i * sign, q.j * sign, q.k * sign],
        offset: [m[(0, 3)], m[(1, 3)], m[(2, 3)]],
        rows: std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)])),
        size_mm,
    }
}

/// Millimetres and seconds.
const UNITS: u8 = 2 | 8;

/// 348 bytes of header and the four that say that no extension follows. Text fields stay zero.
fn header_1<F: Frame>(grid: &Grid<F>, datatype: i16, bits: i16) -> Vec<u8> {
    let form = form(grid);
    let mut h = vec![0u8; 352];
    let mut put = |at: usize, bytes: &[u8]| h[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    put(38, b"r");
    put(40, &3i16.to_le_bytes());
    for n in 0..7 {
        let size = if n < 3 { grid.dims[n] as i16 } else { 1 };
        put(42 + 2 * n, &size.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &bits.to_le_bytes());
    let sizes = [form.qfac, form.size_mm[0], form.size_mm[1], form.size_mm[2], 1.0, 1.0, 1.0, 1.0];
    for (n, size) in sizes.into_iter().enumerate() {
        put(76 + 4 * n, &(size as f32).to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(112, &1f32.to_le_bytes());
    put(123, &[UNITS]);
    put(252, &(if form.qform { form.code } else { 0 }).to_le_bytes());
    put(254, &form.code.to_le_bytes());
    for (n, x) in form.quatern.iter().chain(&form.offset).chain(form.rows.iter().flatten()).enumerate() {
        put(256 + 4 * n, &(*x as f32).to_le_bytes());
    }
    put(344, b"n+1\0");
    h
}

/// 540 bytes of header and the four that say that no extension follows.
fn header_2<F: Frame>(grid: &Grid<F>, datatype: i16, bits: i16) -> Vec<u8> {
    let form = form(grid);
    let mut h = vec![0u8; 544];
    let mut put = |at: usize, bytes: &[u8]| h[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &540i32.to_le_bytes());
    put(4, b"n+2\0\r\n\x1a\n");
    put(12, &datatype.to_le_bytes());
    put(14, &bits.to_le_bytes());
    put(16, &3i64.to_le_bytes());
    for n in 0..7 {
        let size = if n < 3 { grid.dims[n] as i64 } else { 1 };
        put(24 + 8 * n, &size.to_le_bytes());
    }
    let sizes = [form.qfac, form.size_mm[0], form.size_mm[1], form.size_mm[2], 1.0, 1.0, 1.0, 1.0];
    for (n, size) in sizes.into_iter().enumerate() {
        put(104 + 8 * n, &size.to_le_bytes());
    }
    put(168, &544i64.to_le_bytes());
    put(176, &1f64.to_le_bytes());
    let code = i32::from(form.code);
    put(344, &(if form.qform { code } else { 0 }).to_le_bytes());
    put(348, &code.to_le_bytes());
    for (n, x) in form.quatern.iter().chain(&form.offset).chain(form.rows.iter().flatten()).enumerate() {
        put(352 + 8 * n, &x.to_le_bytes());
    }
    put(500, &i32::from(UNITS).to_le_bytes());
    h
}

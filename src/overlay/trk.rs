//! TrackVis' tracks (`.trk`), version 2: points in mm of the voxel grid, from the corner of its first voxel, in the order
//! of axes that the header names; the header's matrix leads to the scanner's frame.
//!
//! Sources: <http://trackvis.org/docs/?subsect=fileformat>, and nibabel's reading of what it leaves open.

use super::drawing::{Carried, Drawing, Kept, OverlayError, damaged, places};
use nalgebra::{Matrix3, Matrix4, Point3, Vector3};

const HEAD: usize = 1000;

/// Everything but the positions.
#[derive(Clone, Debug)]
pub(super) struct Tracks {
    head: Vec<u8>,
    /// To mm, RAS, from the file's numbers.
    mm_from_file: Matrix4<f64>,
    scalars: usize,
    /// Points of every line with the numbers kept for it: of every point, then of the line.
    lines: Vec<(usize, Vec<f32>)>,
}

fn i16_at(b: &[u8], at: usize) -> i16 {
    i16::from_le_bytes([b[at], b[at + 1]])
}

fn i32_at(b: &[u8], at: usize) -> i32 {
    i32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]])
}

fn f32_at(b: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]])
}

/// Which axis of the scanner each voxel axis runs along, and whether upwards: the nearest, each once.
fn axes_of(matrix: &Matrix4<f64>) -> [(usize, bool); 3] {
    let linear: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
    let mut axes = [(0, true); 3];
    let (mut rows, mut columns) = (vec![0, 1, 2], vec![0, 1, 2]);
    while !rows.is_empty() {
        let mut best = (f64::NEG_INFINITY, 0, 0);
        for &r in &rows {
            for &c in &columns {
                let share = linear[(r, c)].abs() / linear.column(c).norm().max(f64::MIN_POSITIVE);
                if share > best.0 {
                    best = (share, r, c);
                }
            }
        }
        axes[best.2] = (best.1, linear[(best.1, best.2)] > 0.0);
        rows.retain(|r| *r != best.1);
        columns.retain(|c| *c != best.2);
    }
    axes
}

fn axes_named(order: &[u8]) -> Option<[(usize, bool); 3]> {
    let axis = |letter: &u8| {
        let place = b"RLASIP".iter().position(|l| l == &letter.to_ascii_uppercase())?;
        Some(match place {
            0 => (0, true),
            1 => (0, false),
            2 => (1, true),
            3 => (2, true),
            4 => (2, false),
            _ => (1, false),
        })
    };
    let axes = [axis(order.first()?)?, axis(order.get(1)?)?, axis(order.get(2)?)?];
    let mut seen: Vec<usize> = axes.iter().map(|a| a.0).collect();
    seen.sort_unstable();
    (seen == [0, 1, 2]).then_some(axes)
}

pub(super) fn decode(bytes: &[u8], name: &str) -> Result<Drawing, OverlayError> {
    if bytes.len() < HEAD || !bytes.starts_with(b"TRACK") {
        return Err(damaged(name, "the header", "it does not begin with TRACK"));
    }
    if i32_at(bytes, 996) != 1000 {
        return Err(damaged(
            name,
            "hdr_size",
            "it is not 1000 in little-endian order; save the file again (nibabel does)",
        ));
    }
    let dims = [6, 8, 10].map(|at| f64::from(i16_at(bytes, at)));
    let sizes = [12, 16, 20].map(|at| f64::from(f32_at(bytes, at)));
    let vox_to_ras = Matrix4::from_fn(|r, c| f64::from(f32_at(bytes, 440 + 4 * (4 * r + c))));
    if vox_to_ras[(3, 3)] != 1.0 || sizes.iter().any(|s| s.is_nan() || *s <= 0.0) {
        let problem =
            "it is not set, so nobody knows where the lines are; save the file with its reference image (dipy does)";
        return Err(damaged(name, "vox_to_ras", problem));
    }
    let order = &bytes[948..952];
    // TrackVis takes an empty one for LPS, other programs for the order of the matrix.
    const LPS: [(usize, bool); 3] = [(0, false), (1, false), (2, true)];
    let unnamed = order[0] == 0;
    if unnamed && axes_of(&vox_to_ras) != LPS {
        let problem =
            "it is empty, which programs read in two ways; save the file with its reference image (dipy does)";
        return Err(damaged(name, "voxel_order", problem));
    }
    let named = if unnamed { Some(LPS) } else { axes_named(order) };
    let named = named.ok_or_else(|| damaged(name, "voxel_order", "it does not name three axes"))?;
    // To voxels in the order of the file's axes, then in that of the matrix.
    let scale = Matrix4::new_nonuniform_scaling(&Vector3::from(sizes.map(|s| 1.0 / s)));
    let to_voxel = Matrix4::new_translation(&Vector3::repeat(-0.5)) * scale;
    let mut reorder = Matrix4::zeros();
    reorder[(3, 3)] = 1.0;
    for (c, (axis, up)) in axes_of(&vox_to_ras).into_iter().enumerate() {
        let from = named.iter().position(|n| n.0 == axis).unwrap_or(c);
        let same = named[from].1 == up;
        reorder[(c, from)] = if same { 1.0 } else { -1.0 };
        reorder[(c, 3)] = if same { 0.0 } else { dims[from] - 1.0 };
    }
    let mm_from_file = vox_to_ras * reorder * to_voxel;
    let (scalars, properties) = (i16_at(bytes, 36).max(0) as usize, i16_at(bytes, 238).max(0) as usize);
    let (mut at, mut lines, mut points_mm) = (HEAD, Vec::new(), Vec::new());
    while at + 4 <= bytes.len() {
        let place = || format!("line {}", lines.len());
        let count = usize::try_from(i32_at(bytes, at))
            .map_err(|_| damaged(name, place(), "its number of points is negative"))?;
        let numbers = count.checked_mul(3 + scalars).and_then(|n| n.checked_add(properties));
        let end = numbers.and_then(|n| n.checked_mul(4)?.checked_add(at + 4)).filter(|end| *end <= bytes.len());
        let end = end.ok_or_else(|| damaged(name, place(), "the file ends within it: it was cut short"))?;
        let numbers: Vec<f32> = bytes[at + 4..end].as_chunks::<4>().0.iter().map(|w| f32::from_le_bytes(*w)).collect();
        let mut kept = Vec::with_capacity(count * scalars + properties);
        for p in numbers[..count * (3 + scalars)].chunks_exact(3 + scalars) {
            let x = Point3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
            points_mm.push(mm_from_file.transform_point(&x).into());
            kept.extend(&p[3..]);
        }
        kept.extend(&numbers[count * (3 + scalars)..]);
        lines.push((count, kept));
        at = end;
    }
    if at < bytes.len() {
        let problem = format!("{} bytes are left that are no line: it was cut short; save it again", bytes.len() - at);
        return Err(damaged(name, format!("line {}", lines.len()), problem));
    }
    // 0 is what a writer leaves that did not know how many there would be.
    let declared = i32_at(bytes, 988);
    if declared > 0 && usize::try_from(declared).ok() != Some(lines.len()) {
        let why = if declared as usize > lines.len() { "it was cut short" } else { "lines were added behind its head" };
        let problem = format!("it says {declared} lines and the file holds {}: {why}; save it again", lines.len());
        return Err(damaged(name, "n_count", problem));
    }
    let mut head = bytes[..HEAD].to_vec();
    // Reserved words, where tools note what they like; the order of axes keeps its place.
    head[504..948].fill(0);
    head[988..992].copy_from_slice(&(lines.len() as i32).to_le_bytes());
    let tracks = Tracks { head, mm_from_file, scalars, lines };
    Ok(Drawing { points_mm, names: Vec::new(), pairs_mm: Vec::new(), kept: Box::new(tracks) })
}

impl Kept for Tracks {
    fn streamlines(&self) -> Option<usize> {
        Some(self.lines.len())
    }

    /// The same lines in the same grid's numbers.
    fn encode(&self, carried: &[Carried], _: &[String]) -> Vec<u8> {
        let points_mm = &places(carried);
        // The matrix was checked: a grid with voxels of a size.
        let file_from_mm = self.mm_from_file.try_inverse().unwrap_or_else(Matrix4::identity);
        let mut bytes = self.head.clone();
        let mut points = points_mm.iter();
        for (count, kept) in &self.lines {
            bytes.extend((*count as i32).to_le_bytes());
            for (n, p) in points.by_ref().take(*count).enumerate() {
                let x = file_from_mm.transform_point(&Point3::from(*p));
                bytes.extend(x.iter().flat_map(|x| (*x as f32).to_le_bytes()));
                bytes.extend(kept[n * self.scalars..(n + 1) * self.scalars].iter().flat_map(|s| s.to_le_bytes()));
            }
            bytes.extend(kept[count * self.scalars..].iter().flat_map(|s| s.to_le_bytes()));
        }
        bytes
    }
}

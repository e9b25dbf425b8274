//! Displacement fields as ITK, ANTs and 3D Slicer read them: five dimensions, the intent "vector" (1007), components in mm
//! along left, posterior, superior. docs/FIELDS.md has the conventions side by side.

use super::encode::{DISPLACEMENT, vector_header, vectors};
use super::error::{NiftiError, NiftiProblem};
use super::gzip::{self, Numbers};
use super::header::Header;
use super::warning::NiftiWarning;
use super::{ReadOptions, check_extension, head_of, orientation, refused, voxels};
use crate::geometry::{Frame, Native};
use crate::image::{Grid, Volume};

/// `NIFTI_INTENT_VECTOR`: ITK takes the numbers as they are, in its own frame (LPS).
const VECTOR: i16 = 1007;

/// A field, and what was odd about its file.
type Told = (Volume<[f32; 3], Native>, Vec<NiftiWarning>);

/// A displacement (mm, RAS, by voxel (i, j, k)) as `.nii.gz` bytes.
///
/// ```
/// use hgm::geometry::Pre;
/// use hgm::image::{Grid, nifti};
///
/// let grid = Grid::<Pre>::axis_aligned([4, 3, 2], [2.0; 3], [-4.0, 0.0, 1.0]);
/// let bytes = nifti::encode_displacement(&grid, |_| [10.0, -1.25, 3.0]);
/// let back = nifti::decode_displacement(&bytes, "shift.nii.gz").unwrap();
/// assert_eq!(back.data[5], [10.0, -1.25, 3.0]);
/// ```
pub fn encode_displacement<F: Frame>(grid: &Grid<F>, mm: impl Fn([usize; 3]) -> [f32; 3] + Sync) -> Vec<u8> {
    // Plus zero: no -0 in a file.
    let lps = |[r, a, s]: [f32; 3]| [-r + 0.0, -a + 0.0, s];
    let write = vectors(grid.dims, |v| lps(mm(v)));
    gzip::pack_fast(&vector_header(grid, VECTOR), &Numbers { count: grid.len(), size: 4, write: &write })
}

/// Reads a displacement field of this program, ITK, ANTs or 3D Slicer, and turns it to RAS: three components in the fifth
/// dimension. Intent 1006 means RAS, every other intent ITK's LPS.
///
/// # Errors
/// [`NiftiError`], also for a file that holds no vectors of three components, or one that is not a finite number.
pub fn decode_displacement(bytes: &[u8], name: &str) -> Result<Volume<[f32; 3], Native>, NiftiError> {
    Ok(decode_displacement_as(bytes, name, &ReadOptions::default())?.0)
}

/// [`decode_displacement`] of a file that another program may have written: read as chosen where it leaves a choice. Returns the
/// warnings beside it.
///
/// # Errors
/// As [`decode_displacement`].
pub fn decode_displacement_as(bytes: &[u8], name: &str, options: &ReadOptions) -> Result<Told, NiftiError> {
    check_extension(name).and_then(|()| read(bytes, options)).map_err(|problem| refused(name, problem))
}

fn read(bytes: &[u8], options: &ReadOptions) -> Result<Told, NiftiProblem> {
    let packed = gzip::is_gzip(bytes);
    let header = Header::parse(&head_of(bytes)?)?;
    let layout = header.layout(Some(0))?;
    let size = |n: usize| if header.dim[0] >= n as i64 { header.dim[n] } else { 1 };
    if size(4) != 1 || size(5) != 3 || (6..8).any(|n| size(n) != 1) {
        return Err(NiftiProblem::Dimensions {
            dim: header.dim,
            rule: "a displacement field has five dimensions, the fourth of size 1 and the fifth of size 3".into(),
        });
    }
    let mut warnings = Vec::new();
    let (grid, _) = orientation::grid(&header, layout.dims, options.prefer, &mut warnings)?;
    let (slope, intercept) = header.scaling()?;
    let raw = if packed {
        gzip::part(bytes, layout.first, 3 * layout.bytes, layout.end)?
    } else {
        if (bytes.len() as u64) < layout.end {
            return Err(NiftiProblem::Truncated { declared: layout.end, found: bytes.len() as u64 });
        }
        bytes[layout.first as usize..layout.end as usize].to_vec()
    };
    let one = layout.bytes as usize;
    let component = |c: usize| voxels(raw[c * one..(c + 1) * one].to_vec(), &layout, &header, slope, intercept);
    let (x, y, z) = (component(0)?, component(1)?, component(2)?);
    let sign = if header.intent == i32::from(DISPLACEMENT) { 1.0 } else { -1.0 };
    let vectors: Vec<[f32; 3]> =
        x.iter().zip(&y).zip(&z).map(|((&x, &y), &z)| [sign * x + 0.0, sign * y + 0.0, z]).collect();
    if let Some(n) = vectors.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
        let [i, j, k] = grid.voxel(n);
        return Err(NiftiProblem::Dimensions {
            dim: header.dim,
            rule: format!(
                "the vector of voxel ({i}, {j}, {k}) is not finite: set it to 0 and leave the voxel out of a mask"
            ),
        });
    }
    Ok((Volume::from_data(grid, vectors), warnings))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pre;
    use crate::image::nifti::{Orientation, encode_vectors};

    #[test]
    fn what_itk_reads_and_what_the_standard_says_come_back_the_same() {
        // More than is packed at once, and rows that are cut there.
        let grid = Grid::<Pre>::axis_aligned([97, 61, 53], [1.0, 2.0, 3.0], [-4.0, 7.0, 1.0]);
        let shift = Volume::from_fn(grid, |n| [n as f32, -0.5 * n as f32, 0.25]);
        let itk = decode_displacement(&encode_displacement(&grid, |[i, j, k]| shift.at(i, j, k)), "a.nii.gz").unwrap();
        let standard = decode_displacement(&encode_vectors(&shift), "a.nii.gz").unwrap();
        assert_eq!(itk.relabelled::<Pre>(), shift);
        assert_eq!(standard.relabelled::<Pre>(), shift);
    }

    #[test]
    fn a_field_of_two_forms_is_read_by_the_one_that_is_chosen_and_that_is_told() {
        let grid = Grid::<Pre>::axis_aligned([5, 4, 3], [1.0; 3], [0.0; 3]);
        let mut bytes = Vec::new();
        let packed = encode_displacement(&grid, |_| [1.0, 0.0, 0.0]);
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&packed[..]), &mut bytes).unwrap();
        // qoffset_x of NIfTI-1, and the code that says the quaternion counts.
        bytes[252..254].copy_from_slice(&1i16.to_le_bytes());
        bytes[268..272].copy_from_slice(&7f32.to_le_bytes());
        assert!(decode_displacement(&bytes, "a.nii").unwrap_err().to_string().contains("sform"));
        for (prefer, x_mm) in [(Orientation::Sform, 0.0), (Orientation::Qform, 7.0)] {
            let options = ReadOptions { prefer: Some(prefer), ..ReadOptions::default() };
            let (field, told) = decode_displacement_as(&bytes, "a.nii", &options).unwrap();
            assert!((field.grid.centre([0, 0, 0]).mm.x - x_mm).abs() < 1e-6, "{prefer}");
            assert!(matches!(told[..], [NiftiWarning::OrientationsDiffer { asked: true, .. }]), "{told:?}");
        }
    }

    #[test]
    fn an_image_is_no_field() {
        let grid = Grid::<Pre>::axis_aligned([5, 4, 3], [1.0; 3], [0.0; 3]);
        let image = crate::image::nifti::encode_u8(&Volume::from_fn(grid, |n| n as u8));
        let refused = decode_displacement(&image, "t1.nii.gz").unwrap_err().to_string();
        assert!(refused.contains("t1.nii.gz") && refused.contains("fifth"), "{refused}");
    }
}

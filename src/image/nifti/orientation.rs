//! Which affine a header means, and whether its two answers agree.

use super::error::NiftiProblem;
use super::header::Header;
use super::warning::NiftiWarning;
use super::which::Orientation;
use crate::geometry::Native;
use crate::image::Grid;
use nalgebra::{Matrix3, Matrix4, Point3, Quaternion, UnitQuaternion, Vector3};

/// Differences below this come from storing the header in 32 bits.
const ROUNDING_MM: f64 = 0.01;

/// The grid of a header and which of its affines it came from; warnings are appended.
pub(super) fn grid(
    header: &Header,
    dims: [usize; 3],
    prefer: Option<Orientation>,
    warnings: &mut Vec<NiftiWarning>,
) -> Result<(Grid<Native>, Orientation), NiftiProblem> {
    let (has_sform, has_qform) = (header.sform_code > 0, header.qform_code > 0);
    if !has_sform && !has_qform {
        return Err(NiftiProblem::NoOrientation);
    }
    // The choice is asked for all files at once: one that has a single form leaves nothing to choose.
    let prefer = prefer.filter(|_| has_sform && has_qform);
    for (n, axis) in ['i', 'j', 'k'].into_iter().enumerate() {
        check_spacing("pixdim", axis, header.pixdim[n + 1].abs())?;
        if header.pixdim[n + 1] < 0.0 {
            warnings.push(NiftiWarning::NegativeSpacing { field: n + 1 });
        }
    }
    match header.xyzt_units & 7 {
        1 => warnings.push(NiftiWarning::Unit { unit: "metre" }),
        3 => warnings.push(NiftiWarning::Unit { unit: "micrometre" }),
        _ => {}
    }
    // The one that is not used may be broken: that is only told.
    let used = prefer.unwrap_or(if has_sform { Orientation::Sform } else { Orientation::Qform });
    let chosen = checked(affine(header, used), dims, used)?;
    if has_sform && has_qform {
        let other = if used == Orientation::Sform { Orientation::Qform } else { Orientation::Sform };
        let other_grid = checked(affine(header, other), dims, other);
        let allowed_mm = 0.5 * chosen.spacing_mm().iter().copied().fold(f64::INFINITY, f64::min);
        match (other_grid, prefer) {
            (Err(problem), None) => return Err(problem),
            (Err(problem), Some(_)) => warnings.push(NiftiWarning::OtherIsBroken { used, problem }),
            (Ok(other_grid), _) => {
                let difference_mm = largest_difference_mm(&chosen, &other_grid);
                if prefer.is_none() && difference_mm > allowed_mm {
                    return Err(NiftiProblem::OrientationsDisagree { difference_mm, allowed_mm });
                }
                if difference_mm > ROUNDING_MM {
                    let asked = prefer.is_some();
                    warnings.push(NiftiWarning::OrientationsDiffer { difference_mm, used, asked });
                }
            }
        }
    }
    for (n, size_mm) in chosen.spacing_mm().into_iter().enumerate() {
        let stated_mm = header.pixdim[n + 1].abs();
        if (stated_mm - size_mm).abs() > 0.01 * size_mm {
            warnings.push(NiftiWarning::Spacing { field: n + 1, stated_mm, size_mm, used });
        }
    }
    let linear: Matrix3<f64> = chosen.mm_from_voxel.fixed_view::<3, 3>(0, 0).into_owned();
    let shear = shear(&linear);
    if shear > 0.01 {
        warnings.push(NiftiWarning::Skewed { used, skew_deg: shear.asin().to_degrees() });
    }
    Ok((chosen, used))
}

/// Largest cosine between two voxel axes.
pub(super) fn shear(linear: &Matrix3<f64>) -> f64 {
    let axis = |n: usize| linear.column(n).normalize();
    [(0, 1), (0, 2), (1, 2)].iter().map(|&(a, b)| axis(a).dot(&axis(b)).abs()).fold(0.0, f64::max).min(1.0)
}

fn check_spacing(field: &'static str, axis: char, value: f64) -> Result<(), NiftiProblem> {
    // A little room for sizes stored as 10 in 32 bits; NaN is refused.
    if (0.01..=10.0001).contains(&value) { Ok(()) } else { Err(NiftiProblem::Spacing { field, axis, value }) }
}

fn affine(header: &Header, orientation: Orientation) -> Result<Matrix4<f64>, NiftiProblem> {
    match orientation {
        Orientation::Sform => {
            Ok(Matrix4::from_fn(|r, c| if r < 3 { header.srow[r][c] } else { f64::from(u8::from(c == 3)) }))
        }
        Orientation::Qform => {
            let [b, c, d] = header.quatern;
            let length2 = b * b + c * c + d * d;
            // A unit quaternion has b2 + c2 + d2 <= 1; rounding may pass it a little.
            if length2.is_nan() || length2 > 1.01 {
                let state = format!("no rotation: quatern_b,c,d = {b}, {c}, {d} are longer than 1");
                return Err(NiftiProblem::Affine { field: "quatern_b, quatern_c, quatern_d", state });
            }
            let a = (1.0 - length2).max(0.0).sqrt();
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(a, b, c, d));
            let [i, j, k] = [1, 2, 3].map(|n| header.pixdim[n].abs());
            // pixdim[0] is qfac: -1 for a left-handed voxel frame, anything else means 1.
            let k = if header.pixdim[0] < 0.0 { -k } else { k };
            let linear = rotation.to_rotation_matrix().matrix() * Matrix3::from_diagonal(&Vector3::new(i, j, k));
            let mut m = linear.to_homogeneous();
            m.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::from(header.qoffset));
            Ok(m)
        }
    }
}

fn checked(
    affine: Result<Matrix4<f64>, NiftiProblem>,
    dims: [usize; 3],
    orientation: Orientation,
) -> Result<Grid<Native>, NiftiProblem> {
    let affine = affine?;
    let field = match orientation {
        Orientation::Sform => "srow_x, srow_y, srow_z",
        Orientation::Qform => "quatern_b, quatern_c, quatern_d, qoffset",
    };
    let refuse = |state: &str| NiftiProblem::Affine { field, state: state.into() };
    if !affine.iter().all(|x| x.is_finite() && x.abs() < 1e6) {
        return Err(refuse("not a finite number of plausible size"));
    }
    let linear: Matrix3<f64> = affine.fixed_view::<3, 3>(0, 0).into_owned();
    for (n, axis) in ['i', 'j', 'k'].into_iter().enumerate() {
        check_spacing(field, axis, linear.column(n).norm())?;
    }
    let volume: f64 = linear.determinant().abs() / (0..3).map(|n| linear.column(n).norm()).product::<f64>();
    // 0.1: the axes span less than a tenth of the box they should; no scanner or registration makes that.
    if volume < 0.1 {
        return Err(refuse(&format!("singular or nearly so (determinant {:.2e})", linear.determinant())));
    }
    Grid::new(dims, affine).ok_or_else(|| refuse("singular"))
}

fn largest_difference_mm(a: &Grid<Native>, b: &Grid<Native>) -> f64 {
    // Two affines differ most at a corner.
    (0..8)
        .map(|corner| {
            let v = [0, 1, 2].map(|d| if corner >> d & 1 == 1 { a.dims[d] as f64 - 1.0 } else { 0.0 });
            a.position(Point3::from(v)).distance_mm(&b.position(Point3::from(v)))
        })
        .fold(0.0, f64::max)
}

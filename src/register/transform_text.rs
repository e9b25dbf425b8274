//! Transforms as text: the 4x4 matrix of this program and ITK's `.tfm`.
//!
//! The 4x4 text maps a moving point to the fixed image in RAS mm, row by row. ITK works in LPS and stores the map from a
//! fixed point to the moving image (what resampling needs), as `y = M (x - c) + c + t` with the centre `c` among the fixed
//! parameters; both conversions happen here and nowhere else.

use crate::geometry::{AffineTransform, Frame, NotRigid, RigidTransform};
use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector3};
use std::fmt::Write;
use thiserror::Error;

/// Why a text is not a transform.
#[derive(Debug, Error, PartialEq)]
pub enum TransformTextError {
    /// Not sixteen numbers.
    #[error("{name}: found {found} numbers, a 4x4 transform has 16: one row of four per line, RAS mm")]
    NotSixteen {
        /// The file.
        name: String,
        /// How many numbers there are.
        found: usize,
    },
    /// Something that is not a finite number.
    #[error("{name}: `{word}` is not a finite number: a transform file holds plain decimal numbers")]
    NotANumber {
        /// The file.
        name: String,
        /// The word.
        word: String,
    },
    /// The last row is not that of an affine map.
    #[error(
        "{name}: the last row is {} {} {} {}, it must be 0 0 0 1; make the file again with `hgm prep`",
        row[0], row[1], row[2], row[3]
    )]
    LastRow {
        /// The file.
        name: String,
        /// The row found.
        row: [f64; 4],
    },
    /// Not an ITK transform file.
    #[error("{name}: no `{field}:` line: an ITK transform text (.tfm) has Transform, Parameters and FixedParameters")]
    Missing {
        /// The file.
        name: String,
        /// The line looked for.
        field: &'static str,
    },
    /// A kind of ITK transform that is not affine, or several in one file.
    #[error(
        "{name}: the ITK transform is `{kind}`: give one Affine, MatrixOffsetTransformBase, Euler3D, VersorRigid3D or Translation transform in three dimensions"
    )]
    Kind {
        /// The file.
        name: String,
        /// What it holds.
        kind: String,
    },
    /// The wrong number of parameters for the kind.
    #[error("{name}: {found} values in `{field}`, this kind of transform has {expected}")]
    Count {
        /// The file.
        name: String,
        /// The line.
        field: &'static str,
        /// Values found.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// The matrix cannot be inverted.
    #[error("{name}: the transform is singular: it maps space onto a plane and has no inverse")]
    Singular {
        /// The file.
        name: String,
    },
    /// A rigid transform was wanted.
    #[error("{name}: not rigid: {source}; give a rotation and a shift only, or make the file again with `hgm prep`")]
    NotRigid {
        /// The file.
        name: String,
        /// How far it is from rigid.
        source: NotRigid,
    },
}

/// Text of the 4x4 matrix, RAS mm, one row per line; reading it back gives the same numbers.
pub fn to_matrix_text<M: Frame, F: Frame>(fixed_from_moving: &RigidTransform<M, F>) -> String {
    let m = fixed_from_moving.to_matrix();
    let row = |r: usize| (0..4).map(|c| plain(m[(r, c)])).collect::<Vec<_>>().join(" ");
    (0..4).map(|r| row(r) + "\n").collect()
}

/// Any affine transform from the text of its 4x4 matrix, RAS mm; lines that start with `#` are skipped.
///
/// # Errors
/// [`TransformTextError`] when the text is not sixteen numbers with the last row 0 0 0 1.
pub fn from_matrix_text<M: Frame, F: Frame>(
    text: &str,
    name: &str,
) -> Result<AffineTransform<M, F>, TransformTextError> {
    let lines = text.lines().filter(|l| !l.trim_start().starts_with('#'));
    let words = lines.flat_map(|l| l.split(|c: char| c.is_whitespace() || c == ',')).filter(|w| !w.is_empty());
    let x = words.map(|w| number(w, name)).collect::<Result<Vec<f64>, _>>()?;
    if x.len() != 16 {
        return Err(TransformTextError::NotSixteen { name: name.into(), found: x.len() });
    }
    let row = [x[12], x[13], x[14], x[15]];
    if row.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(a, b)| (a - b).abs() > 1e-6) {
        return Err(TransformTextError::LastRow { name: name.into(), row });
    }
    Ok(AffineTransform::from_matrix(&Matrix4::from_row_slice(&x)))
}

/// The same map as an ITK text transform (`AffineTransform_double_3_3`): LPS, from a fixed point to the moving image.
pub fn to_itk_text<M: Frame, F: Frame>(fixed_from_moving: &RigidTransform<M, F>) -> String {
    let lps = lps_from_ras();
    let m = lps * fixed_from_moving.inverse().to_matrix() * lps;
    let mut text = String::from("#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n");
    text += "Parameters:";
    let linear = (0..9).map(|n| m[(n / 3, n % 3)]);
    for x in linear.chain((0..3).map(|r| m[(r, 3)])) {
        // Writing to a String cannot fail.
        let _ = write!(text, " {}", plain(x));
    }
    text + "\nFixedParameters: 0 0 0\n"
}

/// The map from a moving point to the fixed image that an ITK text transform stands for.
///
/// # Errors
/// [`TransformTextError`] when the text holds no single affine, rigid or translation transform in three dimensions.
pub fn from_itk_text<M: Frame, F: Frame>(text: &str, name: &str) -> Result<AffineTransform<M, F>, TransformTextError> {
    let field = |field: &'static str| {
        let mut found = text.lines().filter_map(|l| l.trim().strip_prefix(field)?.strip_prefix(':')).map(str::trim);
        let first = found.next().ok_or_else(|| TransformTextError::Missing { name: name.into(), field })?;
        if found.next().is_some() {
            return Err(TransformTextError::Kind { name: name.into(), kind: "a list of several".into() });
        }
        Ok(first)
    };
    let kind = field("Transform")?;
    let numbers = |which: &'static str| {
        field(which)?.split_whitespace().map(|w| number(w, name)).collect::<Result<Vec<f64>, _>>()
    };
    let p = numbers("Parameters")?;
    let fixed = numbers("FixedParameters")?;
    let expect = |field: &'static str, values: &[f64], allowed: &[usize]| {
        if allowed.contains(&values.len()) {
            return Ok(());
        }
        Err(TransformTextError::Count { name: name.into(), field, found: values.len(), expected: allowed[0] })
    };
    let base = kind.strip_suffix("_double_3_3").or_else(|| kind.strip_suffix("_float_3_3")).unwrap_or(kind);
    let (linear, shift) = match base {
        "AffineTransform" | "MatrixOffsetTransformBase" => {
            expect("Parameters", &p, &[12])?;
            (Matrix3::from_row_slice(&p[..9]), Vector3::new(p[9], p[10], p[11]))
        }
        "Euler3DTransform" => {
            expect("Parameters", &p, &[6])?;
            // ITK turns by Z X Y unless a fourth fixed parameter says Z Y X.
            let about = |axis: Vector3<f64>, angle: f64| Rotation3::from_scaled_axis(axis * angle);
            let (x, y, z) = (about(Vector3::x(), p[0]), about(Vector3::y(), p[1]), about(Vector3::z(), p[2]));
            let turn = if fixed.get(3).is_some_and(|&f| f != 0.0) { z * y * x } else { z * x * y };
            (*turn.matrix(), Vector3::new(p[3], p[4], p[5]))
        }
        "VersorRigid3DTransform" => {
            expect("Parameters", &p, &[6])?;
            let v = Vector3::new(p[0], p[1], p[2]);
            let w = (1.0 - v.norm_squared()).max(0.0).sqrt();
            let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::from_parts(w, v));
            (*turn.to_rotation_matrix().matrix(), Vector3::new(p[3], p[4], p[5]))
        }
        "TranslationTransform" => {
            expect("Parameters", &p, &[3])?;
            (Matrix3::identity(), Vector3::new(p[0], p[1], p[2]))
        }
        _ => return Err(TransformTextError::Kind { name: name.into(), kind: kind.into() }),
    };
    expect("FixedParameters", &fixed, &[3, 4, 0])?;
    let centre = if fixed.len() >= 3 { Vector3::new(fixed[0], fixed[1], fixed[2]) } else { Vector3::zeros() };
    let mut moving_from_fixed = linear.to_homogeneous();
    moving_from_fixed.fixed_view_mut::<3, 1>(0, 3).copy_from(&(centre + shift - linear * centre));
    let lps = lps_from_ras();
    let ras = AffineTransform::<F, M>::from_matrix(&(lps * moving_from_fixed * lps));
    ras.inverse().map_err(|_| TransformTextError::Singular { name: name.into() })
}

/// A rigid transform from either text: ITK's when it starts as one, else the 4x4 matrix.
///
/// # Errors
/// [`TransformTextError`] when the text is neither, or the map is not rigid.
pub fn rigid_from_text<M: Frame, F: Frame>(text: &str, name: &str) -> Result<RigidTransform<M, F>, TransformTextError> {
    let itk = text.trim_start().starts_with("#Insight Transform File");
    let affine = if itk { from_itk_text::<M, F>(text, name)? } else { from_matrix_text(text, name)? };
    RigidTransform::from_matrix(&affine.to_matrix())
        .map_err(|source| TransformTextError::NotRigid { name: name.into(), source })
}

fn lps_from_ras() -> Matrix4<f64> {
    Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, -1.0, 1.0))
}

/// Shortest text that reads back as the same number, without a negative zero.
fn plain(x: f64) -> String {
    format!("{}", x + 0.0)
}

fn number(word: &str, name: &str) -> Result<f64, TransformTextError> {
    let value: Option<f64> = word.parse().ok();
    value
        .filter(|x| x.is_finite())
        .ok_or_else(|| TransformTextError::NotANumber { name: name.into(), word: word.into() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Position, Post, Pre};
    use proptest::prelude::*;

    fn turned() -> RigidTransform<Post, Pre> {
        RigidTransform::about([3.0, -20.0, 14.0].into(), Vector3::new(0.2, -0.1, 0.35), Vector3::new(10.0, -4.0, 7.5))
    }

    #[test]
    fn a_shift_to_the_right_is_minus_ten_in_itk_lps_and_again_in_the_fixed_to_moving_direction() {
        let right = RigidTransform::<Post, Pre>::new(UnitQuaternion::identity(), Vector3::new(10.0, 20.0, 30.0));
        let text = to_itk_text(&right);
        // Fixed to moving is -10 -20 -30 in RAS, which is +10 +20 -30 in LPS.
        assert!(text.contains("Parameters: 1 0 0 0 1 0 0 0 1 10 20 -30\n"), "{text}");
        assert_eq!(to_matrix_text(&right), "1 0 0 10\n0 1 0 20\n0 0 1 30\n0 0 0 1\n");
    }

    #[test]
    fn euler_versor_and_affine_of_one_motion_agree() {
        // Thirty degrees about z with a centre: the same map written in three of ITK's ways.
        let (s, c) = 30f64.to_radians().sin_cos();
        let half = 15f64.to_radians().sin();
        let head = "#Insight Transform File V1.0\n#Transform 0\nTransform: ";
        let tail = "1 2 3\nFixedParameters: 10 -5 2";
        let angle = 30f64.to_radians();
        let texts = [
            format!("{head}AffineTransform_double_3_3\nParameters: {c} {} 0 {s} {c} 0 0 0 1 {tail}\n", -s),
            format!("{head}Euler3DTransform_double_3_3\nParameters: 0 0 {angle} {tail} 0\n"),
            format!("{head}VersorRigid3DTransform_double_3_3\nParameters: 0 0 {half} {tail}\n"),
        ];
        let maps: Vec<RigidTransform<Post, Pre>> = texts.iter().map(|t| rigid_from_text(t, "x.tfm").unwrap()).collect();
        let x = Position::<Post>::new(11.0, 22.0, 33.0);
        for map in &maps[1..] {
            assert!(map.apply(x).distance_mm(&maps[0].apply(x)) < 1e-9);
        }
    }

    #[test]
    fn texts_that_are_no_rigid_transform_are_refused_by_name() {
        let refuse = |text: &str| rigid_from_text::<Post, Pre>(text, "x.txt").unwrap_err().to_string();
        assert!(refuse("1 0 0").contains("x.txt: found 3 numbers"));
        assert!(refuse("1 0 0 nan 0 1 0 0 0 0 1 0 0 0 0 1").contains("`nan`"));
        assert!(refuse("1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1").contains("last row"));
        assert!(refuse("2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1").contains("not rigid"));
        assert!(refuse("#Insight Transform File V1.0\nParameters: 1").contains("no `Transform:`"));
        let flat = "#Insight Transform File V1.0\nTransform: AffineTransform_double_3_3\n";
        assert!(refuse(&format!("{flat}Parameters: 1 2\nFixedParameters: 0 0 0")).contains("2 values"));
        let zeros = "0 ".repeat(12);
        assert!(refuse(&format!("{flat}Parameters: {zeros}\nFixedParameters: 0 0 0")).contains("singular"));
        let bspline =
            "#Insight Transform File V1.0\nTransform: BSplineTransform_double_3_3\nParameters: 1\nFixedParameters: 1";
        assert!(refuse(bspline).contains("BSplineTransform"));
    }

    proptest! {
        #[test]
        fn both_texts_read_back_as_the_same_map(shift in -80.0..80.0f64, p in prop::array::uniform3(-90.0..90.0f64)) {
            let map = turned().then(&RigidTransform::<Pre, Pre>::new(UnitQuaternion::identity(), Vector3::new(shift, 0.0, 1.0)));
            let x = Position::<Post>::new(p[0], p[1], p[2]);
            for text in [to_matrix_text(&map), to_itk_text(&map)] {
                let back: RigidTransform<Post, Pre> = rigid_from_text(&text, "x").unwrap();
                prop_assert!(back.apply(x).distance_mm(&map.apply(x)) < 1e-9);
            }
        }
    }
}

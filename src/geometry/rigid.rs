//! Rigid transforms between frames.

use super::affine::AffineTransform;
use super::frame::Frame;
use super::position::{Direction, Position};
use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, UnitQuaternion, Vector3};
use std::marker::PhantomData;
use thiserror::Error;

/// A rotation and a translation that map points of `From` to points of `To`; name it `to_from_from`.
///
/// ```
/// use hgm::geometry::{Mni, Position, Pre, RigidTransform};
/// use nalgebra::Vector3;
/// let mni_from_pre = RigidTransform::<Pre, Mni>::about(
///     nalgebra::Point3::new(1.0, 2.0, 3.0), Vector3::new(0.0, 0.0, 0.5), Vector3::new(10.0, 0.0, 0.0));
/// let tip = Position::<Pre>::new(4.0, 5.0, 6.0);
/// let back = mni_from_pre.inverse().apply(mni_from_pre.apply(tip));
/// assert!(back.distance_mm(&tip) < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidTransform<From: Frame, To: Frame> {
    /// The rotation.
    pub rotation: UnitQuaternion<f64>,
    /// The translation in mm, applied after the rotation.
    pub translation_mm: Vector3<f64>,
    frames: PhantomData<(From, To)>,
}

/// The matrix given is not a rotation and a translation.
#[derive(Debug, Error, PartialEq)]
#[error(
    "the 4x4 matrix turns and shifts, but also stretches or mirrors (axes off by {orthogonality_error:.3}, determinant \
     {determinant:.4})"
)]
pub struct NotRigid {
    /// Largest entry of R^T R - I.
    pub orthogonality_error: f64,
    /// Determinant of the 3x3 part.
    pub determinant: f64,
}

impl<From: Frame, To: Frame> RigidTransform<From, To> {
    /// Coordinates stay the same.
    pub fn identity() -> Self {
        Self::new(UnitQuaternion::identity(), Vector3::zeros())
    }

    /// `x -> rotation x + translation_mm`.
    pub fn new(rotation: UnitQuaternion<f64>, translation_mm: Vector3<f64>) -> Self {
        Self { rotation, translation_mm, frames: PhantomData }
    }

    /// Rotation by the axis-angle vector `rotation_rad` about `centre_mm`, then the shift `translation_mm`.
    pub fn about(centre_mm: Point3<f64>, rotation_rad: Vector3<f64>, translation_mm: Vector3<f64>) -> Self {
        let rotation = UnitQuaternion::from_scaled_axis(rotation_rad);
        Self::new(rotation, centre_mm.coords + translation_mm - rotation * centre_mm.coords)
    }

    /// From a homogeneous matrix; entries of R^T R may differ from the identity by 1e-3 (text files are rounded),
    /// the nearest rotation is taken.
    ///
    /// # Errors
    /// [`NotRigid`] when the 3x3 part is not a rotation.
    pub fn from_matrix(m: &Matrix4<f64>) -> Result<Self, NotRigid> {
        let r: Matrix3<f64> = m.fixed_view::<3, 3>(0, 0).into_owned();
        let orthogonality_error = (r.transpose() * r - Matrix3::identity()).abs().max();
        let determinant = r.determinant();
        // Written so that NaN fails.
        if !(orthogonality_error < 1e-3 && determinant > 0.0) {
            return Err(NotRigid { orthogonality_error, determinant });
        }
        Ok(Self::new(nearest_rotation(&r), Vector3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)])))
    }

    /// The homogeneous 4x4 matrix.
    pub fn to_matrix(&self) -> Matrix4<f64> {
        let mut m = self.rotation.to_homogeneous();
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation_mm);
        m
    }

    /// The same map as an affine transform.
    pub fn to_affine(&self) -> AffineTransform<From, To> {
        AffineTransform::from_parts(*self.rotation.to_rotation_matrix().matrix(), self.translation_mm)
    }

    /// Maps a point.
    pub fn apply(&self, p: Position<From>) -> Position<To> {
        Position::from_point(Point3::from(self.rotation * p.mm.coords + self.translation_mm))
    }

    /// Maps a direction (rotation only).
    pub fn apply_direction(&self, d: Direction<From>) -> Direction<To> {
        let v = self.rotation * d.mm;
        Direction::new(v.x, v.y, v.z)
    }

    /// The transform back.
    pub fn inverse(&self) -> RigidTransform<To, From> {
        let rotation = self.rotation.inverse();
        RigidTransform::new(rotation, -(rotation * self.translation_mm))
    }

    /// First `self`, then `next`: `c_from_a = b_from_a.then(&c_from_b)`.
    pub fn then<Next: Frame>(&self, next: &RigidTransform<To, Next>) -> RigidTransform<From, Next> {
        RigidTransform::new(next.rotation * self.rotation, next.rotation * self.translation_mm + next.translation_mm)
    }

    /// The same numbers under other frame names: for a caller that has learnt what a [`super::Native`] image is.
    pub fn relabelled<A: Frame, B: Frame>(&self) -> RigidTransform<A, B> {
        RigidTransform::new(self.rotation, self.translation_mm)
    }
}

/// The rotation of a linear map's polar decomposition, which is the nearest to it; the map must not mirror.
pub fn nearest_rotation(linear: &Matrix3<f64>) -> UnitQuaternion<f64> {
    let svd = linear.svd(true, true);
    let nearest = svd.u.unwrap_or_default() * svd.v_t.unwrap_or_default();
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(nearest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mni, Post, Pre};
    use proptest::prelude::*;

    fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
        [-limit..limit, -limit..limit, -limit..limit].prop_map(|[x, y, z]| Vector3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn inverse_undoes_transform(w in vector(2.0), t in vector(100.0), p in vector(200.0)) {
            let mni_from_pre = RigidTransform::<Pre, Mni>::about(Point3::from(p * 0.5), w, t);
            let tip = Position::<Pre>::from_point(Point3::from(p));
            prop_assert!(mni_from_pre.inverse().apply(mni_from_pre.apply(tip)).distance_mm(&tip) < 1e-10);
        }

        #[test]
        fn composition_is_successive_application(w in vector(2.0), v in vector(2.0), t in vector(50.0), p in vector(200.0)) {
            let pre_from_post = RigidTransform::<Post, Pre>::about(Point3::origin(), w, t);
            let mni_from_pre = RigidTransform::<Pre, Mni>::about(Point3::from(t), v, -t);
            let x = Position::<Post>::from_point(Point3::from(p));
            let both = pre_from_post.then(&mni_from_pre);
            prop_assert!(both.apply(x).distance_mm(&mni_from_pre.apply(pre_from_post.apply(x))) < 1e-10);
        }

        #[test]
        fn matrix_round_trip_keeps_the_transform(w in vector(3.0), t in vector(50.0), p in vector(200.0)) {
            let a = RigidTransform::<Pre, Mni>::about(Point3::origin(), w, t);
            let b = RigidTransform::<Pre, Mni>::from_matrix(&a.to_matrix()).unwrap();
            let x = Position::<Pre>::from_point(Point3::from(p));
            prop_assert!(a.apply(x).distance_mm(&b.apply(x)) < 1e-10);
        }
    }

    #[test]
    fn a_scaled_or_mirrored_matrix_is_refused() {
        assert!(RigidTransform::<Pre, Mni>::from_matrix(&Matrix4::new_scaling(1.1)).is_err());
        let mirror = Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, 1.0, 1.0));
        assert!(RigidTransform::<Pre, Mni>::from_matrix(&mirror).is_err());
        assert!(RigidTransform::<Pre, Mni>::from_matrix(&(Matrix4::identity() * f64::NAN)).is_err());
    }
}

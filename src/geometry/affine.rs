//! Affine transforms between frames.

use super::frame::Frame;
use super::position::Position;
use nalgebra::{Matrix3, Matrix4, Point3, Vector3};
use std::marker::PhantomData;
use thiserror::Error;

/// A linear map and a translation that map points of `From` to points of `To`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineTransform<From: Frame, To: Frame> {
    /// The 3x3 part.
    pub linear: Matrix3<f64>,
    /// The translation in mm, applied after the linear part.
    pub translation_mm: Vector3<f64>,
    frames: PhantomData<(From, To)>,
}

/// The affine has no inverse.
#[derive(Debug, Error, PartialEq)]
#[error("the affine is singular: determinant {determinant:e}")]
pub struct SingularAffine {
    /// Determinant of the 3x3 part.
    pub determinant: f64,
}

impl<From: Frame, To: Frame> AffineTransform<From, To> {
    /// Coordinates stay the same.
    pub fn identity() -> Self {
        Self::from_parts(Matrix3::identity(), Vector3::zeros())
    }

    /// `x -> linear x + translation_mm`.
    pub fn from_parts(linear: Matrix3<f64>, translation_mm: Vector3<f64>) -> Self {
        Self { linear, translation_mm, frames: PhantomData }
    }

    /// From a homogeneous matrix; the last row is ignored.
    pub fn from_matrix(m: &Matrix4<f64>) -> Self {
        Self::from_parts(m.fixed_view::<3, 3>(0, 0).into_owned(), m.fixed_view::<3, 1>(0, 3).into_owned())
    }

    /// The homogeneous 4x4 matrix.
    pub fn to_matrix(&self) -> Matrix4<f64> {
        let mut m = self.linear.to_homogeneous();
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation_mm);
        m
    }

    /// Maps a point.
    pub fn apply(&self, p: Position<From>) -> Position<To> {
        Position::from_point(Point3::from(self.linear * p.mm.coords + self.translation_mm))
    }

    /// The transform back.
    ///
    /// # Errors
    /// [`SingularAffine`] when the linear part cannot be inverted.
    pub fn inverse(&self) -> Result<AffineTransform<To, From>, SingularAffine> {
        let determinant = self.linear.determinant();
        let inverse = self.linear.try_inverse().filter(|_| determinant.is_finite());
        let inverse = inverse.ok_or(SingularAffine { determinant })?;
        Ok(AffineTransform::from_parts(inverse, -(inverse * self.translation_mm)))
    }

    /// First `self`, then `next`.
    pub fn then<Next: Frame>(&self, next: &AffineTransform<To, Next>) -> AffineTransform<From, Next> {
        AffineTransform::from_parts(next.linear * self.linear, next.linear * self.translation_mm + next.translation_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mni, Pre};

    #[test]
    fn inverse_undoes_transform_and_singular_is_refused() {
        let a = AffineTransform::<Pre, Mni>::from_parts(
            Matrix3::new(1.1, 0.2, 0.0, -0.1, 0.9, 0.3, 0.0, 0.1, 1.2),
            Vector3::new(1.0, 2.0, 3.0),
        );
        let x = Position::<Pre>::new(10.0, -20.0, 30.0);
        assert!(a.inverse().unwrap().apply(a.apply(x)).distance_mm(&x) < 1e-12);
        let flat = AffineTransform::<Pre, Mni>::from_parts(Matrix3::zeros(), Vector3::zeros());
        assert!(flat.inverse().is_err());
    }
}

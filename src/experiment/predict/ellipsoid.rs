//! The ellipsoid that holds a share of the draws of a point.

use super::spread::weighed_quantile;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// An ellipsoid around the mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ellipsoid {
    /// The mean displacement, mm.
    pub mean_mm: [f64; 3],
    /// Root of the trace of the covariance, mm.
    pub sd_mm: f64,
    /// Half axes, the longest first, mm.
    pub half_axes_mm: [f64; 3],
    /// Their directions.
    pub axes: [[f64; 3]; 3],
}

/// Thinnest half axis, mm: a spread along a line is an ellipsoid all the same.
const THINNEST_MM: f64 = 1e-3;

/// The directions and sizes of weighed displacements (mm) around their mean.
#[derive(Clone, Debug)]
pub struct Scatter {
    mean: Vector3<f64>,
    covariance: Matrix3<f64>,
    /// Standard deviations along the axes, the largest first.
    sd: [f64; 3],
    axes: [Vector3<f64>; 3],
    /// Distance of every draw from the mean in standard deviations, with its weight.
    distances: Vec<(f64, f64)>,
}

impl Scatter {
    /// Of these draws.
    pub fn of(draws: &[(f64, [f64; 3])]) -> Self {
        let all: f64 = draws.iter().map(|d| d.0).sum::<f64>().max(f64::MIN_POSITIVE);
        let mean: Vector3<f64> = draws.iter().map(|(w, u)| w / all * Vector3::from(*u)).sum();
        let covariance: Matrix3<f64> = draws
            .iter()
            .map(|(w, u)| {
                let away = Vector3::from(*u) - mean;
                w / all * away * away.transpose()
            })
            .sum();
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let sd = order.map(|a| eigen.eigenvalues[a].max(0.0).sqrt().max(THINNEST_MM));
        let axes = order.map(|a| {
            let axis: Vector3<f64> = eigen.eigenvectors.column(a).into();
            // An axis has no sign: the first component that is not zero is positive, always.
            if axis.iter().find(|v| v.abs() > 1e-9).is_some_and(|v| *v < 0.0) { -axis } else { axis }
        });
        let mut scatter = Self { mean, covariance, sd, axes, distances: Vec::new() };
        scatter.distances = draws.iter().map(|(w, u)| (scatter.distance(u), *w)).collect();
        scatter
    }

    /// The mean, mm.
    pub fn mean_mm(&self) -> [f64; 3] {
        self.mean.into()
    }

    /// Root of the trace of the covariance, mm.
    pub fn sd_mm(&self) -> f64 {
        self.covariance.trace().max(0.0).sqrt()
    }

    /// How far a displacement lies from the mean, in standard deviations along the axes.
    pub fn distance(&self, u: &[f64; 3]) -> f64 {
        let away = Vector3::from(*u) - self.mean;
        (0..3).map(|a| (self.axes[a].dot(&away) / self.sd[a]).powi(2)).sum::<f64>().sqrt()
    }

    /// The distance that this share of the draws does not exceed.
    pub fn radius(&self, share: f64) -> f64 {
        weighed_quantile(&mut self.distances.clone(), share)
    }
}

/// The ellipsoid of weighed displacements (mm): its shape is their covariance's, its size such that it holds 95 % of them. So
/// it holds them also where they are no Gaussian.
pub fn ellipsoid_95(draws: &[(f64, [f64; 3])]) -> Ellipsoid {
    let scatter = Scatter::of(draws);
    let radius = scatter.radius(0.95);
    Ellipsoid {
        mean_mm: scatter.mean_mm(),
        sd_mm: scatter.sd_mm(),
        half_axes_mm: scatter.sd.map(|h| radius * h),
        axes: scatter.axes.map(|a| a.map(|x| x + 0.0).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::low_discrepancy::normals;
    use super::*;

    #[test]
    fn a_gaussian_has_the_ellipsoid_of_the_chi_squared_law() {
        let turn = nalgebra::Rotation3::new(Vector3::new(0.3, 0.2, -0.5));
        let draw = |n: usize| {
            let z = normals(n, 0, 3);
            (1.0, (turn * Vector3::new(3.0 * z[0], z[1], 0.5 * z[2]) + Vector3::new(1.0, 2.0, 3.0)).into())
        };
        let draws: Vec<(f64, [f64; 3])> = (0..4000).map(draw).collect();
        let found = ellipsoid_95(&draws);
        // Root of the 95th percentile for three degrees of freedom.
        let radius = 2.795_483;
        for (half, sd) in found.half_axes_mm.iter().zip([3.0, 1.0, 0.5]) {
            assert!((half / (radius * sd) - 1.0).abs() < 0.03, "{found:?}");
        }
        assert!((found.sd_mm - 10.25f64.sqrt()).abs() < 0.05 && (found.mean_mm[1] - 2.0).abs() < 0.02);
        let along = Vector3::from(found.axes[0]).dot(&(turn * Vector3::x())).abs();
        assert!(along > 0.999, "{along}");
    }
}

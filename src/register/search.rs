//! From a guess to the pose of largest mutual information: the rigid chart, one level's optimisation, and the coarse
//! search that replaces a good guess.

use super::bfgs::{self, Stopping};
use super::mutual_information::{Bins, Interpolated, Pose, Similarity, similarity};
use super::sample::Samples;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

/// One resolution of the problem.
pub(super) struct Level<'a> {
    pub samples: Samples,
    pub other: Interpolated<'a>,
    pub bins: Bins,
    pub spacing_mm: f64,
}

impl Level<'_> {
    pub(super) fn at(&self, pose: &Pose) -> Similarity {
        similarity(&self.samples, &self.other, self.bins, pose, false)
    }

    /// Mutual information, with poses that hide much of the sampled head from the other image counted less.
    fn score(&self, pose: &Pose) -> f64 {
        let s = self.at(pose);
        s.mutual_information * s.known.sqrt()
    }
}

/// Result of one level's optimisation.
#[derive(Clone, Debug)]
pub(super) struct Optimum {
    pub pose: Pose,
    pub inverse_hessian: DMatrix<f64>,
    pub evaluations: usize,
}

/// What the pose may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Freedom {
    /// Turn and move: 6 parameters.
    Rigid,
    /// Any linear map: 12 parameters.
    Affine,
}

impl Freedom {
    /// The base pose after a motion. All parameters are in mm: the first three move, the others turn (axis-angle) or
    /// deform, times the radius of the head.
    fn moved(self, base: &Pose, radius_mm: f64, parameters: &DVector<f64>) -> Pose {
        let target = base.target + parameters.fixed_rows::<3>(0);
        let linear = match self {
            Self::Rigid => *Rotation3::from_scaled_axis(parameters.fixed_rows::<3>(3) / radius_mm).matrix(),
            Self::Affine => Matrix3::identity() + Matrix3::from_column_slice(&parameters.as_slice()[3..12]) / radius_mm,
        };
        Pose { linear: linear * base.linear, target, ..*base }
    }

    /// Derivative of mutual information with respect to the parameters of [`Self::moved`], from that with respect to the pose
    /// reached.
    fn gradient(
        self,
        base: &Pose,
        radius_mm: f64,
        parameters: &DVector<f64>,
        at: &Pose,
        s: &Similarity,
    ) -> DVector<f64> {
        let linear: Vec<f64> = match self {
            Self::Rigid => {
                // y = turn(w) r: the torque r x force, through the chart's Jacobian.
                let lever = at.linear * s.moment.transpose();
                let torque = Vector3::new(
                    lever[(1, 2)] - lever[(2, 1)],
                    lever[(2, 0)] - lever[(0, 2)],
                    lever[(0, 1)] - lever[(1, 0)],
                );
                let w: Vector3<f64> = parameters.fixed_rows::<3>(3) / radius_mm;
                (left_jacobian(w).transpose() * torque).as_slice().to_vec()
            }
            Self::Affine => (s.moment * base.linear.transpose()).as_slice().to_vec(),
        };
        DVector::from_iterator(3 + linear.len(), s.force.iter().copied().chain(linear.iter().map(|x| x / radius_mm)))
    }

    fn parameters(self) -> usize {
        match self {
            Self::Rigid => 6,
            Self::Affine => 12,
        }
    }
}

/// Left Jacobian of the rotation group at the rotation vector `w`: exp(w + dw) = exp(J dw) exp(w).
fn left_jacobian(w: Vector3<f64>) -> Matrix3<f64> {
    let angle = w.norm();
    let k = w.cross_matrix();
    let (a, b) = if angle < 1e-4 {
        (0.5, 1.0 / 6.0)
    } else {
        ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3))
    };
    Matrix3::identity() + k * a + k * k * b
}

/// Maximises mutual information over motions from a base pose.
pub(super) fn optimise(
    level: &Level<'_>,
    base: &Pose,
    freedom: Freedom,
    inverse_hessian: Option<DMatrix<f64>>,
    stopping: Stopping,
) -> Optimum {
    let radius_mm = level.samples.radius_mm;
    let floor = 0.25 * level.at(base).known;
    let minimum = bfgs::minimise(DVector::zeros(freedom.parameters()), inverse_hessian, stopping, |parameters| {
        let pose = freedom.moved(base, radius_mm, parameters);
        let s = similarity(&level.samples, &level.other, level.bins, &pose, true);
        if s.known < floor {
            // Sliding out of the other image is not a match.
            return (f64::INFINITY, DVector::zeros(freedom.parameters()));
        }
        (-s.mutual_information, -freedom.gradient(base, radius_mm, parameters, &pose, &s))
    });
    Optimum {
        pose: freedom.moved(base, radius_mm, &minimum.at),
        inverse_hessian: minimum.inverse_hessian,
        evaluations: minimum.evaluations,
    }
}

/// The reach of a coarse search around its guess.
pub(super) struct Reach {
    /// Rotations about each axis, radians.
    pub turns_rad: Vec<f64>,
    /// Shifts along x, y and z, mm.
    pub shifts_mm: [Vec<f64>; 3],
}

/// Tries every turn and shift around the guesses, refines the best few, and returns them, best first. The second
/// value is the median score of all that was tried, a yardstick for how much the best stands out.
pub(super) fn coarse(level: &Level<'_>, guesses: &[Pose], reach: &Reach, keep: usize) -> (Vec<Pose>, f64) {
    let mut poses = guesses.to_vec();
    let guess = guesses[0];
    for &a in &reach.turns_rad {
        for &b in &reach.turns_rad {
            for &c in &reach.turns_rad {
                let linear = *Rotation3::from_euler_angles(a, b, c).matrix() * guess.linear;
                for &x in &reach.shifts_mm[0] {
                    for &y in &reach.shifts_mm[1] {
                        for &z in &reach.shifts_mm[2] {
                            poses.push(Pose { linear, target: guess.target + Vector3::new(x, y, z), ..guess });
                        }
                    }
                }
            }
        }
    }
    let mut ranked = rank(level, poses);
    let median = ranked[ranked.len() / 2].0;
    ranked.truncate(6 * keep);
    let stopping = Stopping { longest_step_mm: 8.0, shortest_step_mm: 0.3, evaluations: 25 };
    let refined: Vec<Pose> =
        ranked.par_iter().map(|(_, pose)| optimise(level, pose, Freedom::Rigid, None, stopping).pose).collect();
    let mut best: Vec<Pose> = Vec::new();
    for (_, pose) in rank(level, refined) {
        // Starts that ended in one place count once.
        let close = |other: &Pose| {
            let turn = (pose.linear - other.linear).norm() / 2f64.sqrt() * level.samples.radius_mm;
            turn + (pose.target - other.target).norm() < 6.0
        };
        if best.len() < keep && !best.iter().any(close) {
            best.push(pose);
        }
    }
    (best, median)
}

/// Poses with their scores, best first; ties keep their order.
pub(super) fn rank(level: &Level<'_>, poses: Vec<Pose>) -> Vec<(f64, Pose)> {
    let mut ranked: Vec<(f64, Pose)> = poses.into_par_iter().map(|p| (level.score(&p), p)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked
}

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

/// The pose turned by `parameters[0..3] / radius` (axis-angle about the centre) and moved by `parameters[3..6]` mm.
fn moved(base: &Pose, radius_mm: f64, parameters: &DVector<f64>) -> Pose {
    let w = Vector3::new(parameters[0], parameters[1], parameters[2]) / radius_mm;
    let t = Vector3::new(parameters[3], parameters[4], parameters[5]);
    let turn = Rotation3::from_scaled_axis(w);
    Pose { linear: turn.matrix() * base.linear, centre: base.centre, target: base.target + t }
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

/// Maximises mutual information over rigid motions from a base pose.
pub(super) fn optimise(
    level: &Level<'_>,
    base: &Pose,
    inverse_hessian: Option<DMatrix<f64>>,
    stopping: Stopping,
) -> Optimum {
    let radius_mm = level.samples.radius_mm;
    let floor = 0.25 * level.at(base).known;
    let minimum = bfgs::minimise(DVector::zeros(6), inverse_hessian, stopping, |parameters| {
        let pose = moved(base, radius_mm, parameters);
        let s = similarity(&level.samples, &level.other, level.bins, &pose, true);
        if s.known < floor {
            // Sliding out of the other image is not a match.
            return (f64::INFINITY, DVector::zeros(6));
        }
        // dy/dw of y = turn(w) r: the torque r x force, through the chart's Jacobian.
        let lever = pose.linear * s.moment.transpose();
        let torque =
            Vector3::new(lever[(1, 2)] - lever[(2, 1)], lever[(2, 0)] - lever[(0, 2)], lever[(0, 1)] - lever[(1, 0)]);
        let w = Vector3::new(parameters[0], parameters[1], parameters[2]) / radius_mm;
        let turn = left_jacobian(w).transpose() * torque / radius_mm;
        let gradient = [turn.x, turn.y, turn.z, s.force.x, s.force.y, s.force.z];
        (-s.mutual_information, -DVector::from_row_slice(&gradient))
    });
    Optimum {
        pose: moved(base, radius_mm, &minimum.at),
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
    let refined: Vec<Pose> = ranked.par_iter().map(|(_, pose)| optimise(level, pose, None, stopping).pose).collect();
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

//! From a guess to the pose of largest mutual information: the rigid chart, one level's optimisation, and the coarse
//! search that replaces a good guess.

use super::bfgs::{self, Stopping};
use super::mutual_information::{Bins, Interpolated, Pose, Similarity, similarity};
use super::normalised::{LARGEST, agreement};
use super::sample::Samples;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use rayon::prelude::*;

/// What a pose is judged by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Measure {
    /// Mutual information: for two images of one head, or at the end.
    Information,
    /// Agreement of images over their own neighbourhoods, for a search: no gain and no histogram misleads it.
    Agreement,
}

/// One resolution of the problem.
pub(super) struct Level<'a> {
    pub measure: Measure,
    pub samples: Samples,
    pub other: Interpolated<'a>,
    pub bins: Bins,
    pub spacing_mm: f64,
}

impl Level<'_> {
    pub(super) fn at(&self, pose: &Pose) -> Similarity {
        self.similarity(pose, false)
    }

    fn similarity(&self, pose: &Pose, with_gradient: bool) -> Similarity {
        match self.measure {
            Measure::Information => similarity(&self.samples, &self.other, self.bins, pose, with_gradient),
            Measure::Agreement => {
                let range = [-LARGEST, LARGEST];
                agreement(&self.samples, &self.other, self.bins.sampled, range, pose, with_gradient)
            }
        }
    }

    /// The measure, with poses that hide much of the sampled head from the other image counted less.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Freedom {
    /// Turn and move: 6 parameters.
    Rigid,
    /// Any linear map: 12 parameters, held back from stretches that no head has.
    Affine(Tether),
}

/// What a pose that stretches loses: a Gaussian prior of the stretch, in the measure's own unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tether {
    /// Standard deviation of the stretch along an axis (logarithm).
    pub stretch: f64,
    /// Standard deviation of a shear.
    pub shear: f64,
    /// How much mutual information a stretch of one standard deviation may cost, twice, in nats.
    pub weight: f64,
}

/// How far heads differ from the mean one: the standard deviation of length, width or height among adults is about 5 %;
/// three-year-olds, the old with wide ventricles and other scanners' gradients ask for more. Shears come from gradients
/// and asymmetric skulls. A stretch of one standard deviation costs about what moving a head by a mm costs.
pub(super) const TETHER: Tether = Tether { stretch: 0.08, shear: 0.05, weight: 0.01 };

impl Tether {
    /// The loss at a linear map and its derivative with respect to the map. The strain is Green's, (L^T L - I) / 2: blind
    /// to turns, and the logarithm of the stretch to first order.
    fn loss(&self, linear: &Matrix3<f64>) -> (f64, Matrix3<f64>) {
        let strain = 0.5 * (linear.transpose() * linear - Matrix3::identity());
        let precision = Matrix3::from_fn(|a, b| self.weight / if a == b { self.stretch } else { self.shear }.powi(2));
        let stress = strain.component_mul(&precision);
        (0.5 * stress.dot(&strain), linear * stress)
    }
}

impl Freedom {
    /// The base pose after a motion. All parameters are in mm: the first three move, the others turn (axis-angle) or
    /// deform, times the radius of the head.
    fn moved(self, base: &Pose, radius_mm: f64, parameters: &DVector<f64>) -> Pose {
        let target = base.target + parameters.fixed_rows::<3>(0);
        let linear = match self {
            Self::Rigid => *Rotation3::from_scaled_axis(parameters.fixed_rows::<3>(3) / radius_mm).matrix(),
            Self::Affine(_) => {
                Matrix3::identity() + Matrix3::from_column_slice(&parameters.as_slice()[3..12]) / radius_mm
            }
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
            Self::Affine(_) => (s.moment * base.linear.transpose()).as_slice().to_vec(),
        };
        DVector::from_iterator(3 + linear.len(), s.force.iter().copied().chain(linear.iter().map(|x| x / radius_mm)))
    }

    fn parameters(self) -> usize {
        match self {
            Self::Rigid => 6,
            Self::Affine(_) => 12,
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

/// Maximises the level's measure over motions from a base pose.
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
        let mut s = level.similarity(&pose, true);
        if s.known < floor {
            // Sliding out of the other image is not a match.
            return (f64::INFINITY, DVector::zeros(freedom.parameters()));
        }
        if let Freedom::Affine(tether) = freedom {
            let (loss, slope) = tether.loss(&pose.linear);
            s.mutual_information -= loss;
            s.moment -= slope;
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
#[derive(Clone)]
pub(super) struct Reach {
    /// Turns of the guess.
    pub turns: Vec<Rotation3<f64>>,
    /// Shifts along x, y and z, mm.
    pub shifts_mm: [Vec<f64>; 3],
    /// Sizes of the sampled head in the other image.
    pub scales: Vec<f64>,
    /// What the refinement of the best may do.
    pub freedom: Freedom,
}

/// No turn, or one by `step_rad` to either side, about each axis.
pub(super) fn turns_about_axes(step_rad: f64) -> Vec<Rotation3<f64>> {
    let steps = [-step_rad, 0.0, step_rad];
    let mut turns = Vec::with_capacity(27);
    for a in steps {
        for b in steps {
            turns.extend(steps.map(|c| Rotation3::from_euler_angles(a, b, c)));
        }
    }
    turns
}

/// Tries every turn and shift around the guesses, refines the best few, and returns them, best first. The second
/// value is the median score of all that was tried, a yardstick for how much the best stands out.
pub(super) fn coarse(level: &Level<'_>, guesses: &[Pose], reach: &Reach, keep: usize) -> (Vec<Pose>, f64) {
    let mut poses = guesses.to_vec();
    let guess = guesses[0];
    for (turn, scale) in reach.turns.iter().flat_map(|t| reach.scales.iter().map(move |s| (t, s))) {
        let linear = *turn.matrix() * guess.linear * *scale;
        for &x in &reach.shifts_mm[0] {
            for &y in &reach.shifts_mm[1] {
                for &z in &reach.shifts_mm[2] {
                    poses.push(Pose { linear, target: guess.target + Vector3::new(x, y, z), ..guess });
                }
            }
        }
    }
    let mut ranked = rank(level, poses);
    let median = ranked[ranked.len() / 2].0;
    ranked.truncate(6 * keep);
    let stopping = Stopping { longest_step_mm: 8.0, shortest_step_mm: 0.3, evaluations: 25 };
    let refined: Vec<Pose> =
        ranked.par_iter().map(|(_, pose)| optimise(level, pose, reach.freedom, None, stopping).pose).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tether_is_blind_to_turns_and_its_slope_is_its_derivative() {
        let tether = Tether { stretch: 0.08, shear: 0.05, weight: 0.01 };
        let turn = *Rotation3::from_euler_angles(0.4, -0.7, 1.1).matrix();
        assert!(tether.loss(&turn).0 < 1e-20);
        // One standard deviation along one axis costs half the weight (to first order of the logarithm).
        let stretched = turn * Matrix3::from_diagonal(&Vector3::new(0.08f64.exp(), 1.0, 1.0));
        assert!((tether.loss(&stretched).0 / 0.005 - 1.0).abs() < 0.2);
        let linear = stretched + Matrix3::new(0.01, 0.02, -0.03, 0.04, 0.0, 0.01, -0.02, 0.03, 0.05);
        let (_, slope) = tether.loss(&linear);
        for (a, b) in [(0, 0), (1, 2), (2, 1)] {
            let value = |h: f64| {
                let mut moved = linear;
                moved[(a, b)] += h;
                tether.loss(&moved).0
            };
            let difference = (value(1e-5) - value(-1e-5)) / 2e-5;
            assert!((difference - slope[(a, b)]).abs() < 1e-6 * slope.norm().max(1.0), "{difference} {slope}");
        }
    }
}

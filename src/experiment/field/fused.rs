//! Model and seen displacement together: the model everywhere, put right by what it leaves of the seen displacement.
//!
//! What is left at the places that were seen is a remainder of the rigid registration (the fields are given beside that
//! registration, so it belongs to them), a discrepancy of the model, alike over a distance, and noise of the registration,
//! alike over another. How much noise there is was measured, and a body made from scans is never exact: what is left beyond the
//! noise is the model's. The remainder is found by least squares, as far as those are believed; model, remainder and discrepancy
//! are added up (Rasmussen and Williams, "Gaussian Processes for Machine Learning", 2.7: a process with explicit basis functions).
//!
//! What was seen has been put right by showing the model's own state to the registration, whose rigid half follows a part of any
//! shift. What it followed of that state goes back into the field: beside the registration of the scans it is missing.

use crate::experiment::estimate::{CorrelatedErrors, Factor, MovedNode, Process, RigidModes, Unexplained, spread_out};
use crate::experiment::rmse::root_mean_square;
use crate::geometry::{Mni, Position, RigidTransform};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// What a body made from scans misses of a brain's movement even where it leaves no more than noise: measured on patients whose
/// displacement is known (docs/evidence/patients.md).
const USUAL: Process = Process { sd_mm: 0.025, length_mm: 25.0 };
/// Fewer places say nothing of remainder, discrepancy and noise apart.
const FEWEST_PLACES: usize = 10;
/// Nodes per task; part of the determinism, not to depend on the machine.
const NODES_AT_ONCE: usize = 512;

/// A state of the model put right by what was seen.
#[derive(Clone, Debug)]
pub struct Fused {
    /// Displacement of every node, mm.
    pub displacement_mm: Vec<[f64; 3]>,
    /// Standard deviation of every node (root of the trace), mm.
    pub sd_mm: Vec<f64>,
    /// The same of the model alone: its own spread, and all that it leaves.
    pub model_sd_mm: Vec<f64>,
    /// What is left and how it is explained; `None` where nothing was seen to move, or too little was seen.
    pub left: Option<Left>,
}

/// What a model leaves of the seen displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// Noise and discrepancy.
    pub unexplained: Unexplained,
    /// Size of one component of what is left without the rigid remainder, mm.
    pub size_mm: f64,
    /// Size over the places of all that the rigid registration has left or taken up, mm.
    pub rigid_mm: f64,
    /// Places that were looked at.
    pub places: usize,
}

/// The model's displacement with the most probable remainder and discrepancy added, carried by what the rigid registration is known
/// to follow of it (`taken_up`: from where a point has gone to where the scans show it). `model_sd_mm`: of every node, from the
/// posterior. Where too little was seen, the model stands with its own spread.
pub fn fused(
    nodes_mm: &[[f64; 3]],
    model_mm: &[[f64; 3]],
    model_sd_mm: &[f64],
    seen: &[MovedNode],
    errors: &CorrelatedErrors,
    taken_up: &RigidTransform<Mni, Mni>,
) -> Fused {
    let Some(rest) = Rest::of(nodes_mm, model_mm, seen, (errors, taken_up)) else {
        let sd = model_sd_mm.to_vec();
        return Fused { displacement_mm: model_mm.to_vec(), sd_mm: sd.clone(), model_sd_mm: sd, left: None };
    };
    let Unexplained { noise, discrepancy } = rest.left.unexplained;
    let (moved, variance_mm2): (Vec<[f64; 3]>, Vec<f64>) =
        nodes_mm.par_chunks(NODES_AT_ONCE).flat_map_iter(|points| rest.at(points)).unzip();
    let put_right = |((x, u), d): ((&[f64; 3], &[f64; 3]), &[f64; 3])| {
        let there = [0, 1, 2].map(|a| u[a] + d[a]);
        let followed = followed_mm(taken_up, [0, 1, 2].map(|a| x[a] + there[a]));
        [0, 1, 2].map(|a| there[a] + followed[a])
    };
    let displacement_mm = nodes_mm.iter().zip(model_mm).zip(&moved).map(put_right).collect();
    // What the model misses over a few millimetres looks like noise, and is no part of the discrepancy: without as much in the
    // spread it is too narrow (docs/evidence/patients.md).
    let noise_mm2 = 3.0 * noise.sd_mm.powi(2);
    let with = |more_mm2: f64| move |model: &f64| (model * model + more_mm2).sqrt();
    let alone_mm2 = noise_mm2 + 3.0 * discrepancy.sd_mm.powi(2) + rest.left.rigid_mm.powi(2);
    Fused {
        displacement_mm,
        sd_mm: model_sd_mm.iter().zip(variance_mm2).map(|(model, v)| with(noise_mm2 + v)(model)).collect(),
        model_sd_mm: model_sd_mm.iter().map(with(alone_mm2)).collect(),
        left: Some(rest.left),
    }
}

impl Fused {
    /// The state of what was not seen to move, with the model's spread: what is seen there all the same is the registration's
    /// noise, and no shift of anybody. How far the rigid registration is off nobody has seen either: `rigid_mm` is expected
    /// of it.
    pub fn at_rest(model_sd_mm: &[f64], rigid_mm: f64) -> Self {
        let sd_mm: Vec<f64> = model_sd_mm.iter().map(|sd| sd.hypot(rigid_mm)).collect();
        Self { displacement_mm: vec![[0.0; 3]; sd_mm.len()], model_sd_mm: sd_mm.clone(), sd_mm, left: None }
    }
}

/// What is left, by its size: noise as it is stated, and all beyond it the model's.
fn what_is_left(left_mm: f64, noise: Process) -> Unexplained {
    let beyond_mm2 = (left_mm.powi(2) - noise.sd_mm.powi(2)).max(0.0);
    Unexplained { noise, discrepancy: Process { sd_mm: USUAL.sd_mm.hypot(beyond_mm2.sqrt()), ..USUAL } }
}

/// Amounts of the rigid movements and their covariance, from least squares and from what is expected of them (`precision`).
///
/// A process that is smooth enough takes a shift of everything for its own, and by its covariance the outermost places would speak
/// for all; the registration's errors even out over a brain (docs/evidence/patients.md). So least squares find the amounts, and the
/// process of what they leave (`process` of its size) says how far they are believed (White, Econometrica 48, 1980).
fn remainder(
    columns_mm: &DMatrix<f64>,
    left_mm: &DVector<f64>,
    precision: &DMatrix<f64>,
    process: impl Fn(f64) -> Option<Factor>,
) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let inverse = (columns_mm.transpose() * columns_mm).try_inverse()?;
    let by_squares = &inverse * (columns_mm.transpose() * left_mm);
    let size_mm = root_mean_square((left_mm - columns_mm * &by_squares).as_slice())?;
    let spread = process(size_mm)?.lower_transposed_times(columns_mm) * &inverse;
    let told = (spread.transpose() * spread).try_inverse()?;
    let covariance = (&told + precision).try_inverse()?;
    Some((&covariance * (told * by_squares), covariance))
}

/// How far rigid registration carries what has gone to `y`, mm.
fn followed_mm(taken_up: &RigidTransform<Mni, Mni>, y: [f64; 3]) -> [f64; 3] {
    let y = Position::new(y[0], y[1], y[2]);
    (taken_up.apply(y).mm - y.mm).into()
}

/// What is left, conditioned on what was seen.
struct Rest {
    left: Left,
    places_mm: Vec<[f64; 3]>,
    factor: Factor,
    rigid: RigidModes,
    /// Amounts of the rigid movements, and their covariance.
    amounts: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Inverse covariance of the places times what remains without the rigid movements, and times those.
    weights: DMatrix<f64>,
    weights_of_rigid: DMatrix<f64>,
}

impl Rest {
    /// `None` where too little was seen.
    fn of(
        nodes_mm: &[[f64; 3]],
        model_mm: &[[f64; 3]],
        seen: &[MovedNode],
        (errors, taken_up): (&CorrelatedErrors, &RigidTransform<Mni, Mni>),
    ) -> Option<Self> {
        let positions: Vec<[f64; 3]> = seen.iter().map(|(n, _)| nodes_mm[*n as usize]).collect();
        let chosen = spread_out(&positions, errors.places);
        let places_mm: Vec<[f64; 3]> = chosen.iter().map(|&n| positions[n]).collect();
        if places_mm.len() < FEWEST_PLACES {
            return None;
        }
        let left_mm = DVector::from_fn(3 * places_mm.len(), |row, _| {
            let (node, u) = seen[chosen[row / 3]];
            u[row % 3] - model_mm[node as usize][row % 3]
        });
        let rigid = RigidModes::new(&places_mm, errors.rigid_mm);
        let precision = rigid.precision();
        let (amounts, covariance) = remainder(&rigid.columns_mm, &left_mm, &precision, |size_mm| {
            what_is_left(size_mm, errors.noise).factor(&places_mm)
        })?;
        let moved = &rigid.columns_mm * &amounts;
        let remains = &left_mm - &moved;
        let size_mm = root_mean_square(remains.as_slice())?;
        let unexplained = what_is_left(size_mm, errors.noise);
        let factor = unexplained.factor(&places_mm)?;
        let weights_of_rigid = factor.solve(&rigid.columns_mm);
        let weights = factor.solve(&DMatrix::from_column_slice(remains.len(), 1, remains.as_slice()));
        let followed = places_mm.iter().zip(&chosen).flat_map(|(x, &n)| {
            let u = model_mm[seen[n].0 as usize];
            followed_mm(taken_up, [0, 1, 2].map(|a| x[a] + u[a]))
        });
        let followed = DVector::from_iterator(3 * places_mm.len(), followed);
        let left = Left {
            unexplained,
            size_mm,
            rigid_mm: ((moved + followed).norm_squared() / places_mm.len() as f64).sqrt(),
            places: places_mm.len(),
        };
        Some(Self { left, places_mm, factor, rigid, amounts, covariance, weights, weights_of_rigid })
    }

    /// Remainder and discrepancy at some points (mm), and the sum of their three variances (mm2).
    fn at(&self, points_mm: &[[f64; 3]]) -> Vec<([f64; 3], f64)> {
        let process = self.left.unexplained.discrepancy;
        let count = self.places_mm.len();
        let shared = |place: usize, point: usize| {
            let squared = |a: usize| (self.places_mm[place][a] - points_mm[point][a]).powi(2);
            process.covariance_mm2((squared(0) + squared(1) + squared(2)).sqrt())
        };
        let shared = DMatrix::from_fn(count, points_mm.len(), shared);
        let known = self.factor.known_mm2(points_mm.len(), |place, point| shared[(place, point)]);
        let point = |p: usize| {
            let mut basis = self.rigid.at(points_mm[p]);
            let mut mean = basis * &self.amounts;
            for (place, k) in shared.column(p).iter().enumerate() {
                for a in 0..3 {
                    mean[a] += k * self.weights[(3 * place + a, 0)];
                    for column in 0..basis.ncols() {
                        basis[(a, column)] -= k * self.weights_of_rigid[(3 * place + a, column)];
                    }
                }
            }
            let of_rigid = (basis * &self.covariance * basis.transpose()).trace();
            let of_process = 3.0 * (process.sd_mm.powi(2) - known[p]).max(0.0);
            (mean.into(), of_rigid + of_process)
        };
        (0..points_mm.len()).map(point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::phantom::block;
    use crate::material::random::CounterRng;

    const ERRORS: CorrelatedErrors = CorrelatedErrors {
        noise: Process { sd_mm: 0.05, length_mm: 10.0 },
        corrected_mm: 0.05,
        rigid_mm: 0.1,
        places: 300,
    };

    fn every_fourth(u: &[[f64; 3]]) -> Vec<MovedNode> {
        (0..u.len()).step_by(4).map(|n| (n as u32, u[n])).collect()
    }

    fn rms(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
        let squares = a.iter().zip(b).map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>());
        (squares.sum::<f64>() / a.len() as f64).sqrt()
    }

    /// A model that moves half as far as the tissue, seen at every fourth node.
    #[test]
    fn where_the_model_falls_short_the_seen_part_is_added_and_the_spread_says_how_well() {
        let mesh = block(8);
        let nodes = mesh.nodes_mm();
        let truth: Vec<[f64; 3]> = nodes.iter().map(|x| [0.0, 0.02 * x[1], -3.0 + 0.03 * x[2]]).collect();
        let model: Vec<[f64; 3]> = truth.iter().map(|u| u.map(|x| 0.5 * x)).collect();
        let found =
            fused(nodes, &model, &vec![0.1; nodes.len()], &every_fourth(&truth), &ERRORS, &RigidTransform::identity());
        let off = rms(&found.displacement_mm, &truth);
        assert!(off < 0.1 * rms(&model, &truth), "{off} {}", rms(&model, &truth));
        let left = found.left.unwrap();
        assert!(left.places <= ERRORS.places && left.unexplained.discrepancy.sd_mm > 0.0);
        assert!(found.sd_mm.iter().zip(&found.model_sd_mm).all(|(sd, alone)| *sd >= 0.1 && alone > sd));
    }

    #[test]
    fn a_model_that_explains_all_is_left_as_it_is() {
        let mesh = block(4);
        let u: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| [0.01 * x[2], 0.0, 1.0]).collect();
        let found =
            fused(mesh.nodes_mm(), &u, &vec![0.2; u.len()], &every_fourth(&u), &ERRORS, &RigidTransform::identity());
        assert!(found.displacement_mm == u, "{:?}", found.left);
        assert_eq!(found.left.unwrap().unexplained, Unexplained { noise: ERRORS.noise, discrepancy: USUAL });
        // The model's own, noise, and what is not known of discrepancy and remainder: less than both of them beforehand.
        let known = 0.2f64.powi(2) + 3.0 * ERRORS.noise.sd_mm.powi(2);
        let most = 3.0 * USUAL.sd_mm.powi(2) + 3.0 * ERRORS.noise.sd_mm.powi(2);
        assert!(found.sd_mm.iter().all(|sd| (known..known + most).contains(&sd.powi(2))));
    }

    /// What the rigid registration has taken up, the field gives back: beside it, the two carry a point where it went.
    #[test]
    fn a_remainder_of_the_rigid_registration_belongs_to_the_field() {
        let mesh = block(6);
        let model: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| [0.01 * x[2], 0.0, 1.0]).collect();
        let turned = |x: &[f64; 3], u: &[f64; 3]| [u[0] + 0.06 - 1e-3 * x[1], u[1] + 1e-3 * x[0], u[2]];
        let truth: Vec<[f64; 3]> = mesh.nodes_mm().iter().zip(&model).map(|(x, u)| turned(x, u)).collect();
        let found = fused(
            mesh.nodes_mm(),
            &model,
            &vec![0.0; model.len()],
            &every_fourth(&truth),
            &ERRORS,
            &RigidTransform::identity(),
        );
        let [after, before] = [rms(&found.displacement_mm, &truth), rms(&model, &truth)];
        assert!(after < 0.2 * before && found.left.unwrap().rigid_mm > 0.5 * before, "{after} of {before}");
    }

    /// Errors that are alike over a third of the body and even out over the whole: by their covariance the remainder would be lost.
    #[test]
    fn smooth_errors_do_not_hide_a_rigid_remainder() {
        let mesh = block(8);
        let places: Vec<[f64; 3]> = mesh.nodes_mm().iter().step_by(4).copied().collect();
        let rigid = RigidModes::new(&places, ERRORS.rigid_mm);
        let factor = Factor::new(&places, &[Process { sd_mm: 0.12, length_mm: 33.0 }]).unwrap();
        let shift = [0.02, 0.1, -0.03];
        let (columns, precision) = (&rigid.columns_mm, rigid.precision());
        let off = |amounts: &DVector<f64>| {
            let found: Vec<[f64; 3]> = (columns * amounts).as_slice().chunks(3).map(|u| [u[0], u[1], u[2]]).collect();
            rms(&found, &vec![shift; places.len()])
        };
        let process_of = |size_mm| what_is_left(size_mm, ERRORS.noise).factor(&places);
        let (mut by_squares, mut by_covariance) = (0.0, 0.0);
        for phase in 0..6 {
            let wave = |x: &[f64; 3], a: usize| {
                let at = |b: usize| (x[b] / 8.0 + f64::from(phase) + a as f64).sin();
                0.1 * (at(0) + at(1) + at(2)) / 1.5f64.sqrt()
            };
            let left = DVector::from_fn(3 * places.len(), |row, _| shift[row % 3] + wave(&places[row / 3], row % 3));
            by_squares += off(&remainder(columns, &left, &precision, process_of).unwrap().0) / 6.0;
            let weights = factor.solve(columns);
            let inverse = (columns.transpose() * &weights + &precision).try_inverse().unwrap();
            by_covariance += off(&(inverse * (weights.transpose() * &left))) / 6.0;
        }
        assert!(
            by_squares < 0.5 * rms(&[shift], &[[0.0; 3]]) && by_squares < 0.5 * by_covariance,
            "{by_squares} {by_covariance}"
        );
    }

    /// What rigid registration is known to follow of the model is missing beside the scans, whatever was seen of it.
    #[test]
    fn what_the_rigid_registration_follows_goes_back_into_the_field() {
        let mesh = block(4);
        let model: Vec<[f64; 3]> = mesh.nodes_mm().iter().map(|x| [0.01 * x[2], 0.0, 1.0]).collect();
        let turn = nalgebra::Vector3::new(0.0, 0.0, 2e-3);
        let taken_up = RigidTransform::about(nalgebra::Point3::origin(), turn, nalgebra::Vector3::new(0.05, 0.0, -0.1));
        let found = fused(mesh.nodes_mm(), &model, &vec![0.0; model.len()], &every_fourth(&model), &ERRORS, &taken_up);
        for ((x, u), there) in mesh.nodes_mm().iter().zip(&model).zip(&found.displacement_mm) {
            let apparent = taken_up.apply(Position::new(x[0] + u[0], x[1] + u[1], x[2] + u[2]));
            let there = Position::<Mni>::new(x[0] + there[0], x[1] + there[1], x[2] + there[2]);
            assert!(there.distance_mm(&apparent) < 1e-9);
        }
        // The model alone lacks it.
        let left = found.left.unwrap();
        assert!(left.rigid_mm > 0.1 && found.model_sd_mm.iter().all(|sd| *sd >= left.rigid_mm), "{left:?}");
    }

    #[test]
    fn nothing_seen_leaves_the_model_alone() {
        let mesh = block(3);
        let u = vec![[1.0, 0.0, 0.0]; mesh.nodes_mm().len()];
        let found = fused(mesh.nodes_mm(), &u, &vec![0.3; u.len()], &[], &ERRORS, &RigidTransform::identity());
        assert!(found.displacement_mm == u && found.sd_mm == found.model_sd_mm && found.left.is_none());
    }

    /// What is left is little more than the noise, and smooth: adding the likely part of it brings the model nearer to the truth, and
    /// where the model is exact, noise does not carry it far.
    #[test]
    fn a_model_that_is_nearly_right_is_put_right_by_what_noise_does_not_explain() {
        let mesh = block(8);
        let nodes = mesh.nodes_mm();
        let model = vec![[0.0, 0.0, -1.0]; nodes.len()];
        let wave = |x: &[f64; 3], a: usize, length: f64| {
            let at = |b: usize| (x[b] / length + 1.3 * (a + b) as f64).sin();
            (at(0) + at(1) + at(2)) / 1.5f64.sqrt()
        };
        let moved = |missed: f64, noise: f64| -> Vec<[f64; 3]> {
            let of = |(x, u): (&[f64; 3], &[f64; 3])| {
                [0, 1, 2].map(|a| u[a] + missed * wave(x, a, 12.0) + noise * wave(x, a + 1, 2.5))
            };
            nodes.iter().zip(&model).map(of).collect()
        };
        let off = |missed: f64| {
            let seen = every_fourth(&moved(missed, ERRORS.noise.sd_mm));
            let found = fused(nodes, &model, &vec![0.0; nodes.len()], &seen, &ERRORS, &RigidTransform::identity());
            rms(&found.displacement_mm, &moved(missed, 0.0))
        };
        let (little, nothing) = (off(0.08), off(0.0));
        assert!(little < 0.6 * rms(&model, &moved(0.08, 0.0)), "{little} of {}", rms(&model, &moved(0.08, 0.0)));
        assert!(nothing < 0.5 * 3f64.sqrt() * ERRORS.noise.sd_mm, "{nothing}");
    }

    /// A smooth discrepancy of random waves under smooth noise: nineteen of twenty places lie in their reach.
    #[test]
    fn the_spread_covers_the_error() {
        let mesh = block(8);
        let nodes = mesh.nodes_mm();
        let model = vec![[0.0, 0.0, -1.0]; nodes.len()];
        // A sum of waves of random direction, of this size and length.
        let waves = |stream: u64, size: f64, length: f64, x: &[f64; 3], a: usize| {
            let rng = CounterRng::new(21, stream + 100 * a as u64);
            let wave = |k: u64| {
                let direction = [0, 1, 2].map(|b| rng.between(10 * k + b, -1.0, 1.0));
                let along: f64 = (0..3).map(|b| direction[b] * x[b]).sum();
                (along / length + rng.between(10 * k + 5, 0.0, std::f64::consts::TAU)).cos()
            };
            size * (2.0 / 24.0f64).sqrt() * (0..24).map(wave).sum::<f64>()
        };
        let (mut inside, mut all) = (0, 0);
        for stream in 0..8 {
            let add = |u: &[[f64; 3]], stream: u64, size: f64, length: f64| -> Vec<[f64; 3]> {
                let of = |(x, u): (&[f64; 3], &[f64; 3])| [0, 1, 2].map(|a| u[a] + waves(stream, size, length, x, a));
                nodes.iter().zip(u).map(of).collect()
            };
            let truth = add(&model, 2 * stream, 0.4, 30.0);
            let seen = every_fourth(&add(&truth, 2 * stream + 1, 0.05, 8.0));
            let found = fused(nodes, &model, &vec![0.0; nodes.len()], &seen, &ERRORS, &RigidTransform::identity());
            for (n, u) in found.displacement_mm.iter().enumerate() {
                let reach = 1.96 * found.sd_mm[n] / 3f64.sqrt();
                inside += (0..3).filter(|&a| (u[a] - truth[n][a]).abs() < reach).count();
                all += 3;
            }
        }
        let share = f64::from(inside as u32) / f64::from(all);
        assert!(share > 0.9, "{share}");
    }

    #[test]
    fn what_is_at_rest_is_known_no_better_than_the_scans_lie_to_each_other() {
        let still = Fused::at_rest(&[0.0, 0.3], 0.2);
        assert_eq!(still.displacement_mm, [[0.0; 3]; 2]);
        assert_eq!(still.sd_mm, [0.2, 0.3f64.hypot(0.2)]);
        assert_eq!(still.model_sd_mm, still.sd_mm);
    }
}

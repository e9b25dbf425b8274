//! What an estimate starts from: a body, what is not known of it, and what was observed.

use super::LogPrior;
use super::body::Observation;
use super::correlated::CorrelatedErrors;
use super::re_registration::Instrument;
use super::shape::ShapeError;
use super::unknown::Unknown;
use crate::fem::Scenario;
use crate::mesh::TetMesh;

/// What is known of the errors of what was observed.
#[derive(Clone, Debug, PartialEq)]
pub enum Errors {
    /// Independent of each other but for a share (neighbours see the same error), of the descent's noise.
    Independent {
        /// Share of the observations that are independent.
        share: f64,
    },
    /// Alike over some distance, with a rigid remainder and a discrepancy of the model.
    Correlated(CorrelatedErrors),
}

/// Everything an estimate starts from.
pub struct Problem<'a> {
    /// The body at rest.
    pub mesh: &'a TetMesh,
    /// Loads, supports, solver; the materials are the unknowns'.
    pub template: &'a Scenario,
    /// What is estimated, with the prior of each logarithm in the same order.
    pub unknowns: Vec<(Unknown, LogPrior)>,
    /// Poisson's ratio of every tissue.
    pub poisson_ratio: f64,
    /// What was observed.
    pub observation: Observation,
    /// How far it is believed.
    pub errors: Errors,
    /// Standard deviation of ln(modulus) that mesh and element add; 0 for a body known exactly. Only taken where it cannot be
    /// found from a coarser mesh.
    pub model_log_sd: f64,
    /// Standard deviation of ln(modulus) that labels and supports add; 0 for a body known exactly.
    pub body_log_sd: f64,
    /// How far its shape may be off; only taken where there is a coarser mesh to find out what that does, and told to be taken as exact
    /// where there is none.
    pub shape: ShapeError,
    /// The same body in a coarser mesh: what mesh, element and shape add is found from it, case by case.
    pub coarser: Option<&'a TetMesh>,
    /// Whether the rigid half of what measures displacements follows the brain, as where a scan shows no skull: then nothing is seen
    /// of what moves rigidly.
    pub rigid_follows: bool,
    /// Whether body and load are known exactly (a phantom's): then nothing is held against what is known of tissue.
    pub body_known: bool,
    /// Where to start; the prior's mean when empty.
    pub start: Vec<f64>,
    /// The measurement behind nodes' displacements, where its own error is to be taken out, and how many times.
    pub instrument: Option<(&'a Instrument<'a>, usize)>,
}

impl<'a> Problem<'a> {
    /// A body that is known exactly, seen by an instrument whose own error stays in; from the prior's mean.
    pub fn new(
        mesh: &'a TetMesh,
        template: &'a Scenario,
        unknowns: Vec<(Unknown, LogPrior)>,
        poisson_ratio: f64,
        (observation, errors): (Observation, Errors),
    ) -> Self {
        Self {
            mesh,
            template,
            unknowns,
            poisson_ratio,
            observation,
            errors,
            model_log_sd: 0.0,
            body_log_sd: 0.0,
            shape: ShapeError::default(),
            coarser: None,
            rigid_follows: false,
            body_known: true,
            start: Vec::new(),
            instrument: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::{Estimate, EstimateSettings, Process, solve_problem};
    use crate::experiment::phantom::{PhantomSettings, block};
    use crate::experiment::rmse::root_mean_square;
    use crate::experiment::sample::Tissue;
    use crate::experiment::sweep::scenario_of;
    use crate::experiment::verdict::{Claim, Finding, Reason};
    use crate::fem::simulate;

    const SHAPE: ShapeError = ShapeError { outline_mm: 1.0, falx_mm: 0.0, support_edges_mm: 0.0 };

    fn known(mean_pa: f64, sd: f64) -> Vec<(Unknown, LogPrior)> {
        let unknowns = Tissue::grey_and_white().into_iter().map(Unknown::ShearModulus);
        unknowns.map(|unknown| (unknown.clone(), unknown.prior(mean_pa.ln(), sd))).collect()
    }

    fn taken_as_exact(found: &Estimate) -> Option<usize> {
        found.outcome.verdict.reasons.iter().find_map(|reason| match reason {
            Reason::ShapeTakenAsExact { amounts } => Some(*amounts),
            _ => None,
        })
    }

    #[test]
    fn a_shape_without_a_mesh_to_find_out_what_it_does_is_told_to_be_taken_as_exact() {
        let (mesh, settings) = (block(4), PhantomSettings::pushed_from_above());
        let scenario = settings.scenario();
        let truth = scenario_of(&scenario, &settings.tissue_list(), &settings.reference_sample()).unwrap();
        let u = simulate(&mesh, &truth, &|_| {}).unwrap().displacement_mm;
        let told = |shape| {
            let nodes = u.iter().enumerate().map(|(n, u)| (n as u32, *u)).collect();
            let seen = (Observation::Nodes(nodes), Errors::Independent { share: 1.0 });
            let start = vec![2299f64.ln(), 1195f64.ln()];
            let problem = Problem { shape, start, ..Problem::new(&mesh, &scenario, known(1100.0, 2.0), 0.45, seen) };
            let precise = EstimateSettings { noise_mm: 1e-3, ..EstimateSettings::default() };
            let found = solve_problem(problem, &precise).unwrap();
            assert!(found.outcome.verdict.finding.has_stiffness(), "{:?}", found.outcome.verdict);
            taken_as_exact(&found)
        };
        assert_eq!([told(ShapeError::default()), told(SHAPE)], [None, Some(4)]);
    }

    const NOISE_MM: f64 = 0.02;

    fn errors() -> CorrelatedErrors {
        let noise = Process { sd_mm: NOISE_MM, length_mm: 7.5 };
        CorrelatedErrors { noise, corrected_mm: noise.sd_mm, rigid_mm: 0.1, places: 150 }
    }

    /// What is seen of every node of a body that has not moved.
    fn less_than_noise(mesh: &TetMesh) -> Vec<(u32, [f64; 3])> {
        let wave = |x: &[f64; 3]| [(0.2 * x[1]).sin(), (0.15 * x[2]).cos(), (0.25 * x[0]).sin()].map(|v| 0.01 * v);
        mesh.nodes_mm().iter().enumerate().map(|(n, x)| (n as u32, wave(x))).collect()
    }

    #[test]
    fn where_nothing_has_moved_what_is_left_is_what_was_seen_beside_the_measurements_own_noise() {
        let (mesh, scenario) = (block(4), PhantomSettings::pushed_from_above().scenario());
        let seen = (Observation::Nodes(less_than_noise(&mesh)), Errors::Correlated(errors()));
        let problem = Problem::new(&mesh, &scenario, known(1100.0, 0.4), 0.45, seen);
        let found = solve_problem(problem, &EstimateSettings::default()).unwrap();
        assert_eq!(found.outcome.verdict.finding, Finding::NoShift, "{:?}", found.outcome.verdict);
        let seen_mm: Vec<f64> = found.seen.iter().flat_map(|(_, u)| *u).collect();
        let left_mm = found.outcome.residual_rms_mm;
        assert!((left_mm - root_mean_square(&seen_mm).unwrap()).abs() < 1e-12, "{left_mm}");
        assert_eq!(found.outcome.noise_mm, NOISE_MM);
    }

    #[test]
    fn bounds_without_a_shift_leave_room_for_the_shape_or_say_that_they_do_not() {
        let (mesh, coarse, scenario) = (block(4), block(3), PhantomSettings::pushed_from_above().scenario());
        let bounds = |shape, coarser| {
            let seen = (Observation::Nodes(less_than_noise(&mesh)), Errors::Correlated(errors()));
            let posed = Problem::new(&mesh, &scenario, known(1100.0, 0.4), 0.45, seen);
            let problem = Problem { shape, coarser, body_known: false, ..posed };
            let found = solve_problem(problem, &EstimateSettings::default()).unwrap();
            assert_eq!(found.outcome.verdict.finding, Finding::NoShift, "{:?}", found.outcome.verdict);
            let bound = |(_, claim): &(String, Claim)| match claim {
                Claim::Above { bound_pa } => *bound_pa,
                other => panic!("{other:?}"),
            };
            let all: Vec<f64> = found.outcome.verdict.moduli.iter().map(bound).collect();
            (all, taken_as_exact(&found))
        };
        let (exact, none) = bounds(ShapeError::default(), Some(&coarse));
        let (unknown, found) = bounds(SHAPE, Some(&coarse));
        assert!(exact.iter().zip(&unknown).all(|(exact, unknown)| unknown < exact), "{exact:?} {unknown:?}");
        assert_eq!([none, found, bounds(SHAPE, None).1], [None, None, Some(4)]);
    }
}

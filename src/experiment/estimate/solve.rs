//! From a posed problem to the estimate that is reported.

use super::body::{Body, Observation, Solved};
use super::correlated::{self, Beside};
use super::findings::ProblemError;
use super::fluid::FluidOutcome;
use super::independent::fit_independent;
use super::load_assumed::load_assumed;
use super::mesh_error::{at_places, left_of_difference};
use super::outcome::{Estimate, EstimateOutcome};
use super::problem::{Errors, Problem};
use super::shape::Shape;
use super::spread::spread;
use super::unknown::Unknown;
use super::verdict_of_fit::{Posed, verdict_of_fit};
use super::{EstimateSettings, LogPrior, laplace};
use crate::experiment::sample::Tissue;
use crate::experiment::verdict::Finding;
use crate::fem::Within;
use crate::material::law::Material;
use std::collections::BTreeMap;

/// How far a single room between cortex and skull is off for a head, mm: it differs from place to place by more, and a
/// head leans on much of its skull at once.
const ROOM_MM: f64 = 0.3;

/// How good equilibria and sensitivities are on the way to what two scans show (docs/evidence/choices.md).
const AS_SEEN: Within = Within::Energy(1e-3);

/// Finds the most probable parameters and how sure they are.
///
/// # Errors
/// [`ProblemError`].
pub fn solve_problem(problem: Problem<'_>, settings: &EstimateSettings) -> Result<Estimate, ProblemError> {
    let (unknowns, prior): (Vec<Unknown>, Vec<LogPrior>) = problem.unknowns.into_iter().unzip();
    let start: Vec<f64> = if problem.start.is_empty() { prior.iter().map(|p| p.mean).collect() } else { problem.start };
    let assumed = load_assumed(&problem.template.loads, &unknowns);
    let mut model_error: Vec<f64> = unknowns
        .iter()
        .map(|u| if matches!(u, Unknown::ShearModulus(_)) { problem.model_log_sd } else { 0.0 })
        .collect();
    let tissues: Vec<Option<String>> = unknowns.iter().map(Unknown::tissue).collect();
    let unknown = unknowns.clone();
    let exact = Within::Residual(problem.template.solver.relative_residual);
    let seen_in_scans = matches!(problem.errors, Errors::Correlated(_));
    let mut body = Body::new(problem.mesh, problem.template, unknowns, problem.poisson_ratio, problem.observation)?;
    if seen_in_scans {
        body = body.within(AS_SEEN, AS_SEEN);
    }
    let start = body.start(&start);
    let shape = Shape {
        mesh: problem.coarser.unwrap_or(problem.mesh),
        template: problem.template,
        unknowns: &unknown,
        poisson_ratio: problem.poisson_ratio,
        error: problem.shape,
    };
    let known = problem.coarser.map(|_| &shape);
    let fitted = match &problem.errors {
        Errors::Correlated(errors) => {
            let beside = Beside { instrument: problem.instrument, shape: known, rigid_follows: problem.rigid_follows };
            correlated::fit(&mut body, errors, &prior, &start, beside, settings)?
        }
        Errors::Independent { share } => {
            fit_independent(&mut body, *share, &prior, &start, problem.instrument, settings)?
        }
    };
    let posterior = laplace(&fitted.descent.log_parameters, &fitted.fisher, &prior);
    let Solved { outcome: mut state, sensitivities } = body.solve(&fitted.descent.log_parameters)?;
    if seen_in_scans {
        body = body.within(exact, AS_SEEN);
        state = body.equilibrium(&fitted.descent.log_parameters)?;
    }
    // A model that is too stiff is made up for by a modulus that is too low: its error is not one of the displacement.
    let (displacement_sd_mm, displacement_95_mm) = spread(&state.displacement_mm, &sensitivities, &posterior);
    let mut mesh_log_sd = Vec::new();
    if let (Some(coarse), Some(found)) = (problem.coarser, &fitted.correlated) {
        let nothing = Observation::Nodes(Vec::new());
        let there = Body::new(coarse, problem.template, unknown.clone(), problem.poisson_ratio, nothing)
            .and_then(|mut body| body.solve(&fitted.descent.log_parameters));
        // Without an equilibrium on it, or a change that parameters make up for, what is expected of meshes stands.
        if let Ok(there) = there {
            let there = at_places(coarse, &there.outcome.displacement_mm, &found.places_mm);
            let change =
                |row: usize| state.displacement_mm[found.nodes[row / 3] as usize][row % 3] - there[row / 3][row % 3];
            if let Some(made) = found.made_up_by(change, prior.len()) {
                let left = left_of_difference(problem.mesh, coarse);
                mesh_log_sd = made.iter().map(|m| (m * left).abs()).collect();
                model_error.clone_from(&mesh_log_sd);
            }
        }
    }
    let of_mesh = model_error.iter().copied().fold(0.0, f64::max);
    for (error, unknown) in model_error.iter_mut().zip(&unknown) {
        if matches!(unknown, Unknown::ShearModulus(_)) {
            *error = error.hypot(problem.body_log_sd);
        }
    }
    let posterior = posterior.with_model_error(&model_error, &fitted.descent.log_parameters, &prior);
    let posterior = unknown.iter().enumerate().fold(posterior, |posterior, (n, unknown)| match unknown {
        Unknown::Gap(_) => {
            let values = &fitted.descent.log_parameters;
            posterior.known_no_better(n, ROOM_MM / values[n].exp(), values, &prior)
        }
        _ => posterior,
    });
    let unsolved = known.and(fitted.correlated.as_ref()).map(|found| found.shape.unsolved);
    let posed = Posed {
        prior: &prior,
        tissues: &tissues,
        assumed,
        model_error: &model_error,
        shape_as_exact: unsolved.unwrap_or_else(|| shape.amounts()),
        gravity_m_per_s2: problem.template.loads.gravity_m_per_s2,
        body_known: problem.body_known,
    };
    let verdict = verdict_of_fit(&fitted, settings, &posterior, &posed);
    let materials = tissue_materials(&unknown, &fitted.descent.log_parameters, problem.poisson_ratio);
    let posterior = match verdict.finding {
        Finding::Widened => posterior.widened(),
        finding if finding.has_stiffness() => posterior,
        _ => posterior.withheld(),
    };
    let fluid = FluidOutcome::of(&unknown, &prior, &fitted.descent.log_parameters, &posterior)
        .filter(|_| verdict.finding.has_stiffness());
    let [residual_rms_mm, noise_mm] = fitted.left_mm(verdict.finding, settings);
    let correlated = fitted.correlated;
    let shape = correlated.as_ref().map(|c| c.shape).unwrap_or_default();
    let outcome = EstimateOutcome {
        taught_by: None,
        fluid,
        ventricles: None,
        limits: verdict.because(),
        verdict,
        observations: fitted.observations,
        independent_observations: fitted.independent,
        noise_mm,
        residual_rms_mm,
        taken_out_rms_mm: fitted.taken_out_rms_mm,
        rigid_taken_up: fitted.taken_up.map(|taken_up| taken_up.to_matrix().transpose().into()),
        convergence: fitted.descent.convergence,
        solves: body.solves,
        tangent_solves: body.tangent_solves,
        model_log_sd: of_mesh,
        body_log_sd: problem.body_log_sd,
        mesh_log_sd,
        unexplained: correlated.as_ref().map(|c| c.unexplained),
        measured_noise: correlated.as_ref().map(|c| c.measured_noise),
        odds: correlated.as_ref().map(|c| c.odds),
        rigid_remainder_mm: correlated.as_ref().map(|c| c.rigid_remainder_mm),
        outline_mm: shape.outline,
        falx_mm: shape.falx,
        falx_edge_mm: shape.falx_edge,
        base_edge_mm: shape.base_edge,
        shift: correlated.map(|c| c.shift),
        posterior,
        prior,
    };
    let numbers = fitted.descent.log_parameters;
    let seen = body.observed_nodes().to_vec();
    Ok(Estimate { outcome, state, displacement_sd_mm, displacement_95_mm, seen, materials, numbers })
}

/// The material of every tissue at these parameters.
fn tissue_materials(unknowns: &[Unknown], values: &[f64], poisson_ratio: f64) -> BTreeMap<String, Material> {
    let shape = |of: &Tissue| {
        unknowns.iter().zip(values).find_map(|(unknown, value)| match unknown {
            Unknown::Shape(tissue, shape) if tissue == of => Some((*shape, *value)),
            _ => None,
        })
    };
    let of = |(unknown, value): (&Unknown, &f64)| match unknown {
        Unknown::ShearModulus(tissue) => {
            Some((tissue.name.clone(), super::material(value.exp(), shape(tissue), poisson_ratio)))
        }
        _ => None,
    };
    unknowns.iter().zip(values).filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::{
        Average, CorrelatedErrors, Instrument, InstrumentError, Process, Scale, Shown, Turn, material,
    };
    use crate::experiment::observed::ObservedSurfaces;
    use crate::experiment::phantom::{PhantomSettings, block};
    use crate::experiment::prior::{PriorSettings, law_priors};
    use crate::experiment::sweep::scenario_of;
    use crate::experiment::verdict::{Claim, Reason, Verdict};
    use crate::fem::{Loads, Scenario, simulate};
    use crate::material::law::{gent, mooney_rivlin, ogden};
    use crate::material::meta_model::MetaModel;
    use crate::mesh::{TetMesh, TriMesh};

    fn problem<'a>(mesh: &'a TetMesh, scenario: &'a Scenario, observed: Vec<(u32, [f64; 3])>) -> Problem<'a> {
        let unknown = |tissue: Tissue| {
            let unknown = Unknown::ShearModulus(tissue);
            let prior = unknown.prior(7.0, 2.0);
            (unknown, prior)
        };
        let unknowns = Tissue::grey_and_white().into_iter().map(unknown).collect();
        let seen = (Observation::Nodes(observed), Errors::Independent { share: 1.0 });
        Problem { start: vec![2299f64.ln(), 1195f64.ln()], ..Problem::new(mesh, scenario, unknowns, 0.45, seen) }
    }

    /// A block with its loads, and how the reference's moduli move its nodes, mm.
    fn phantom(cells: usize) -> (TetMesh, Scenario, Vec<(u32, [f64; 3])>) {
        let (mesh, settings) = (block(cells), PhantomSettings::pushed_from_above());
        let scenario = settings.scenario();
        let truth = scenario_of(&scenario, &settings.tissue_list(), &settings.reference_sample()).unwrap();
        let observed = every_node(&simulate(&mesh, &truth, &|_| {}).unwrap().displacement_mm);
        (mesh, scenario, observed)
    }

    fn every_node(displacement_mm: &[[f64; 3]]) -> Vec<(u32, [f64; 3])> {
        displacement_mm.iter().enumerate().map(|(n, u)| (n as u32, *u)).collect()
    }

    #[test]
    fn the_moduli_behind_a_simulation_come_back_from_far_away() {
        let (mesh, scenario, observed) = phantom(4);
        let precise = EstimateSettings { noise_mm: 1e-3, ..EstimateSettings::default() };
        let found = solve_problem(problem(&mesh, &scenario, observed), &precise).unwrap();
        let [grey, white] = [found.outcome.posterior.mode[0], found.outcome.posterior.mode[1]];
        assert!((grey / 1370.0 - 1.0).abs() < 1e-4 && (white / 990.0 - 1.0).abs() < 1e-4, "{grey} {white}");
        assert!(found.outcome.tangent_solves <= 24, "{}", found.outcome.tangent_solves);
        assert!(found.outcome.limits.is_empty(), "{:?}", found.outcome.limits);
    }

    #[test]
    fn an_estimate_that_begins_where_nothing_is_in_equilibrium_begins_stiffer() {
        let (mesh, mut scenario, observed) = phantom(4);
        // Where a load is not cut, a body this soft has no equilibrium that is found.
        scenario.solver.newton_iterations = 8;
        scenario.solver.smallest_load_step = 1.0;
        let posed = |start| Problem { start, ..problem(&mesh, &scenario, observed.clone()) };
        let unknowns = posed(Vec::new()).unknowns.into_iter().map(|(unknown, _)| unknown).collect();
        let mut body = Body::new(&mesh, &scenario, unknowns, 0.45, Observation::Nodes(Vec::new())).unwrap();
        let softer = (0..20).map(|halved| vec![7.0 - 0.7 * f64::from(halved); 2]);
        let soft = softer.into_iter().find(|moduli| body.equilibrium(moduli).is_err()).expect("too soft for its load");
        let precise = EstimateSettings { noise_mm: 1e-3, ..EstimateSettings::default() };
        let found = solve_problem(posed(soft), &precise).unwrap().outcome.posterior.mode;
        assert!((found[0] / 1370.0 - 1.0).abs() < 1e-3 && (found[1] / 990.0 - 1.0).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn a_softer_body_moves_more_and_the_spread_follows_the_interval() {
        let (mesh, scenario, observed) = phantom(3);
        let rough = EstimateSettings { noise_mm: 0.5, ..EstimateSettings::default() };
        let fine = EstimateSettings { noise_mm: 0.05, ..EstimateSettings::default() };
        let rough = solve_problem(problem(&mesh, &scenario, observed.clone()), &rough).unwrap();
        let fine = solve_problem(problem(&mesh, &scenario, observed), &fine).unwrap();
        let top = mesh.node_sets["superior"][5] as usize;
        assert!(rough.displacement_sd_mm[top] > 5.0 * fine.displacement_sd_mm[top]);
        let held = mesh.node_sets["base"][0] as usize;
        assert_eq!((fine.displacement_sd_mm[held], fine.displacement_95_mm[held]), (0.0, 0.0));
    }

    /// Gravity and nothing else.
    fn pulled(gravity_m_per_s2: [f64; 3]) -> Scenario {
        let loads = Loads { gravity_m_per_s2, density_kg_per_m3: 300.0, ..Loads::default() };
        Scenario { loads, ..PhantomSettings::pushed_from_above().scenario() }
    }

    #[test]
    fn a_turn_of_gravity_comes_back_with_the_modulus() {
        let mesh = block(3);
        let scenario = pulled([0.0, 0.0, -9.81]);
        let brain = Unknown::ShearModulus(Tissue::whole_brain().remove(0));
        let list = vec![brain, Unknown::GravityTurn(Turn::Nodding), Unknown::GravityTurn(Turn::Rolling)];
        let priors = [(7.0, 2.0), (0.0, 0.5), (0.0, 0.5)];
        let unknowns = list.iter().zip(priors).map(|(u, (mean, sd))| (u.clone(), u.prior(mean, sd))).collect();
        let mut truth = Body::new(&mesh, &scenario, list, 0.45, Observation::Nodes(Vec::new())).unwrap();
        let degrees = [8.0f64, -5.0];
        let theta = [800f64.ln(), degrees[0].to_radians(), degrees[1].to_radians()];
        let u = truth.solve(&theta).unwrap().outcome.displacement_mm;
        let problem = Problem {
            unknowns,
            observation: Observation::Nodes(every_node(&u)),
            start: Vec::new(),
            ..problem(&mesh, &scenario, Vec::new())
        };
        let precise = EstimateSettings { noise_mm: 1e-3, ..EstimateSettings::default() };
        let found = solve_problem(problem, &precise).unwrap().outcome.posterior;
        assert!((found.mode[0] / 800.0 - 1.0).abs() < 1e-3, "{:?}", found.mode);
        assert!(
            (found.mode[1] - degrees[0]).abs() < 0.02 && (found.mode[2] - degrees[1]).abs() < 0.02,
            "{:?}",
            found.mode
        );
        assert!(found.interval_95[2][0] < degrees[1] && degrees[1] < found.interval_95[2][1]);
    }

    /// An instrument that sees a tenth too little on one axis and adds a drift.
    #[test]
    fn an_instruments_own_error_does_not_reach_the_moduli() {
        let (mesh, scenario, observed) = phantom(4);
        let shown = |u: &[[f64; 3]]| -> Result<Shown, InstrumentError> {
            let drift = |n: usize| 0.002 * mesh.nodes_mm()[n][0];
            let seen = u.iter().enumerate().map(|(n, u)| (n as u32, [u[0], u[1] + drift(n), 0.9 * u[2]]));
            Ok(seen.collect::<Vec<_>>().into())
        };
        let truth: Vec<[f64; 3]> = observed.iter().map(|(_, u)| *u).collect();
        let noise = EstimateSettings { noise_mm: 1e-3, ..EstimateSettings::default() };
        let off = |times| {
            let seen = shown(&truth).unwrap().nodes;
            let posed = Problem { instrument: Some((&shown, times)), ..problem(&mesh, &scenario, seen) };
            let found = solve_problem(posed, &noise).unwrap().outcome;
            let mode = &found.posterior.mode;
            (f64::max((mode[0] / 1370.0).ln().abs(), (mode[1] / 990.0).ln().abs()), found.taken_out_rms_mm)
        };
        let [(plain, none), (once, some), (four, _)] = [off(0), off(1), off(4)];
        assert!(none.is_none() && some.is_some());
        assert!(plain > 0.03, "{plain}");
        // Each round leaves the instrument's error on the change only: a tenth of what was left.
        assert!(once < 0.3 * plain && four < 1e-3, "{plain} {once} {four}");
    }

    #[test]
    fn a_models_own_error_widens_the_moduli_and_nothing_else() {
        let (mesh, scenario, observed) = phantom(3);
        let noise = EstimateSettings { noise_mm: 0.05, ..EstimateSettings::default() };
        let exact = solve_problem(problem(&mesh, &scenario, observed.clone()), &noise).unwrap();
        let rough = Problem { model_log_sd: 0.1, body_log_sd: 0.05, ..problem(&mesh, &scenario, observed) };
        let rough = solve_problem(rough, &noise).unwrap();
        let [narrow, wide] = [&exact, &rough].map(|e| e.outcome.posterior.log_sd[0]);
        assert!((wide - narrow.hypot(0.1).hypot(0.05)).abs() < 1e-12, "{narrow} {wide}");
        assert_eq!(exact.outcome.posterior.mode, rough.outcome.posterior.mode);
        assert_eq!(exact.displacement_sd_mm, rough.displacement_sd_mm);
    }

    #[test]
    fn the_average_of_the_studies_judges_a_figure_and_does_not_draw_it() {
        let (mesh, scenario, observed) = phantom(3);
        let precise = EstimateSettings { noise_mm: 1e-3, ..EstimateSettings::default() };
        // The reference's 1370 and 990 Pa, so many standard deviations from an average of theirs.
        let found = |sds: f64| {
            let mut posed = Problem { body_known: false, ..problem(&mesh, &scenario, observed.clone()) };
            for ((_, prior), truth) in posed.unknowns.iter_mut().zip([1370f64, 990.0]) {
                prior.average = Some(Average { mean: truth.ln() - 0.3 * sds, sd: 0.3 });
            }
            solve_problem(posed, &precise).unwrap().outcome
        };
        let ([near, far], [allowed, refused]) = ([3.5, 5.0].map(found), [Finding::Identified, Finding::Conflict]);
        assert_eq!([near.verdict.finding, far.verdict.finding], [allowed, refused]);
        assert_eq!(near.posterior.mode, far.posterior.mode);
        assert!(far.verdict.moduli.iter().all(|(_, claim)| *claim == Claim::Withheld), "{:?}", far.verdict);
    }

    /// A block pushed by `force_n`, seen with errors that neighbours share by a model that knows of a push from above.
    fn seen_by_a_model_of_a_push_from_above(force_n: Option<[f64; 3]>, add: impl Fn([f64; 3]) -> [f64; 3]) -> Estimate {
        let (mesh, settings) = (block(5), PhantomSettings::pushed_from_above());
        let u = match force_n {
            Some(two_tissue_force_n) => {
                let pushed = PhantomSettings { two_tissue_force_n, ..settings.clone() };
                let (scenario, tissues) = (pushed.scenario(), pushed.tissue_list());
                let truth = scenario_of(&scenario, &tissues, &pushed.reference_sample()).unwrap();
                simulate(&mesh, &truth, &|_| {}).unwrap().displacement_mm
            }
            None => vec![[0.0; 3]; mesh.nodes_mm().len()],
        };
        let moved = |(x, u): (&[f64; 3], &[f64; 3])| {
            let more = add(*x);
            [0, 1, 2].map(|a| u[a] + more[a])
        };
        let observed: Vec<[f64; 3]> = mesh.nodes_mm().iter().zip(&u).map(moved).collect();
        estimated(&mesh, &settings.scenario(), &observed, None)
    }

    /// What is seen of the nodes, told with errors that neighbours share.
    fn estimated(
        mesh: &TetMesh,
        scenario: &Scenario,
        observed: &[[f64; 3]],
        instrument: Option<(&Instrument<'_>, usize)>,
    ) -> Estimate {
        let noise = Process { sd_mm: 0.02, length_mm: 7.5 };
        let errors = CorrelatedErrors { noise, corrected_mm: noise.sd_mm, rigid_mm: 0.1, places: 150 };
        estimated_with(errors, mesh, scenario, observed, instrument)
    }

    fn estimated_with(
        errors: CorrelatedErrors,
        mesh: &TetMesh,
        scenario: &Scenario,
        observed: &[[f64; 3]],
        instrument: Option<(&Instrument<'_>, usize)>,
    ) -> Estimate {
        let known = |unknown: Unknown| {
            let prior = unknown.prior(1100f64.ln(), 0.4);
            (unknown, prior)
        };
        let problem = Problem {
            unknowns: Tissue::grey_and_white().into_iter().map(|t| known(Unknown::ShearModulus(t))).collect(),
            errors: Errors::Correlated(errors),
            start: Vec::new(),
            body_known: false,
            instrument,
            ..problem(mesh, scenario, every_node(observed))
        };
        solve_problem(problem, &EstimateSettings::default()).unwrap()
    }

    #[test]
    fn a_shift_of_everything_is_taken_for_the_registrations_and_not_for_the_moduli() {
        let found = seen_by_a_model_of_a_push_from_above(Some([0.0, 0.0, -0.1]), |_| [0.06, -0.04, 0.05]).outcome;
        for (n, truth) in [1370.0, 990.0].into_iter().enumerate() {
            let [low, high] = found.posterior.interval_95[n];
            assert!(low < truth && truth < high, "{:?}", found.posterior);
        }
        assert!(found.verdict.finding.has_stiffness(), "{:?}", found.verdict);
        assert!(found.shift.unwrap().explained_share > 0.95, "{:?}", found.shift);
        let remainder = found.rigid_remainder_mm.unwrap();
        assert!((remainder - 0.0877).abs() < 0.03, "{remainder}");
    }

    #[test]
    fn the_state_that_is_told_is_in_equilibrium_as_the_scenario_asks_whatever_was_enough_on_the_way() {
        let found = seen_by_a_model_of_a_push_from_above(Some([0.0, 0.0, -0.1]), |_| [0.0; 3]);
        let (mesh, scenario) = (block(5), PhantomSettings::pushed_from_above().scenario());
        let asked = scenario.solver.relative_residual;
        assert!(found.state.convergence.relative_residual <= asked);
        let unknowns = Tissue::grey_and_white().into_iter().map(Unknown::ShearModulus).collect();
        let body = Body::new(&mesh, &scenario, unknowns, 0.45, Observation::Nodes(Vec::new())).unwrap();
        let on_the_way = body.within(AS_SEEN, AS_SEEN).equilibrium(&found.numbers).unwrap();
        assert!(on_the_way.convergence.relative_residual > asked);
    }

    #[test]
    fn without_a_shift_there_is_a_bound_and_no_stiffness() {
        let wave = |x: [f64; 3]| [0.01 * (0.2 * x[1]).sin(), 0.01 * (0.15 * x[2]).cos(), 0.01 * (0.25 * x[0]).sin()];
        let whole = seen_by_a_model_of_a_push_from_above(None, wave);
        let found = whole.outcome.clone();
        assert_eq!(found.verdict.finding, Finding::NoShift, "{:?}", found.verdict);
        let bounds = found.verdict.moduli.iter().map(|(_, answer)| match answer {
            Claim::Above { bound_pa } => *bound_pa,
            other => panic!("{other:?}"),
        });
        // The body of the prior's mean would have moved by half a millimetre: noise of .02 mm leaves a tenth of it at most.
        assert!(bounds.into_iter().all(|bound| bound > 4000.0), "{:?}", found.verdict);
        let said = &found.posterior.identifiability.verdicts;
        assert!(said.iter().all(|v| *v != crate::experiment::estimate::Knowledge::Identified), "{said:?}");
        // The state is rest, as sure as the measurement is of it.
        let reach_mm = found.shift.unwrap().would_be_seen_mm;
        let state = whole.at_rest();
        assert!(state.state.displacement_mm.iter().all(|u| *u == [0.0; 3]) && reach_mm > 0.0);
        assert!(state.displacement_95_mm.iter().all(|reach| *reach == reach_mm));
    }

    #[test]
    fn an_instruments_own_error_at_rest_is_no_shift() {
        let (mesh, scenario) = (block(5), PhantomSettings::pushed_from_above().scenario());
        let own = |x: [f64; 3]| [0.05 * (0.2 * x[1]).sin(), 0.05 * (0.15 * x[2]).cos(), 0.05 * (0.25 * x[0]).sin()];
        let shown = |u: &[[f64; 3]]| -> Result<Shown, InstrumentError> {
            let seen = |(n, u): (usize, &[f64; 3])| {
                let error = own(mesh.nodes_mm()[n]);
                (n as u32, [0, 1, 2].map(|a| u[a] + error[a]))
            };
            Ok(u.iter().enumerate().map(seen).collect::<Vec<_>>().into())
        };
        let at_rest = vec![[0.0; 3]; mesh.nodes_mm().len()];
        let observed: Vec<[f64; 3]> = shown(&at_rest).unwrap().nodes.into_iter().map(|(_, u)| u).collect();
        let found = estimated(&mesh, &scenario, &observed, Some((&shown, 2))).outcome;
        assert!(found.taken_out_rms_mm.is_some_and(|mm| mm > 0.02), "{:?}", found.taken_out_rms_mm);
        assert_eq!(found.verdict.finding, Finding::NoShift, "{:?}", found.verdict);
    }

    /// What the model leaves is less than the measurement's noise, and more than is left of that without the instrument's error.
    #[test]
    fn a_model_is_held_against_what_is_left_of_the_noise_once_the_instruments_own_error_is_out() {
        let (mesh, scenario) = (block(5), PhantomSettings::pushed_from_above().scenario());
        let truth = PhantomSettings::pushed_from_above();
        let posed = scenario_of(&scenario, &truth.tissue_list(), &truth.reference_sample()).unwrap();
        let u = simulate(&mesh, &posed, &|_| {}).unwrap().displacement_mm;
        let wave = |x: &[f64; 3]| [(0.2 * x[1]).sin(), (0.15 * x[2]).cos(), (0.25 * x[0]).sin()].map(|v| 0.03 * v);
        let with_wave = |(x, u): (&[f64; 3], &[f64; 3])| {
            let left = wave(x);
            [0, 1, 2].map(|a| u[a] + left[a])
        };
        let observed: Vec<[f64; 3]> = mesh.nodes_mm().iter().zip(&u).map(with_wave).collect();
        let exact = |u: &[[f64; 3]]| -> Result<Shown, InstrumentError> { Ok(every_node(u).into()) };
        let noise = Process { sd_mm: 0.05, length_mm: 7.5 };
        let told = |corrected_mm: f64, rounds: usize| {
            let errors = CorrelatedErrors { noise, corrected_mm, rigid_mm: 0.1, places: 150 };
            let found = estimated_with(errors, &mesh, &scenario, &observed, Some((&exact, rounds))).outcome;
            (found.verdict.reasons.iter().any(|r| matches!(r, Reason::Discrepancy { .. })), found.posterior)
        };
        let ((lenient, before), (strict, after)) = (told(noise.sd_mm, 1), told(0.005, 1));
        assert!(!lenient && strict);
        assert_eq!(before.interval_95, after.interval_95);
        // Nothing was taken out: the noise counts as it was measured.
        assert!(!told(0.005, 0).0);
    }

    #[test]
    fn a_push_from_the_side_is_not_explained_by_one_from_above() {
        let found = seen_by_a_model_of_a_push_from_above(Some([0.1, 0.0, 0.0]), |_| [0.0; 3]).outcome;
        assert!(!found.verdict.finding.has_stiffness(), "{:?}", found.verdict);
        assert!(found.shift.unwrap().seen, "{:?}", found.odds);
    }

    #[test]
    fn a_body_that_lay_another_way_is_not_explained_and_the_way_it_went_is_named() {
        let mesh = block(5);
        let (upright, lying) = ([0.0, 0.0, -9.81], [-9.81, 0.0, 0.0]);
        let truth = scenario_of(
            &pulled(lying),
            &PhantomSettings::pushed_from_above().tissue_list(),
            &PhantomSettings::pushed_from_above().reference_sample(),
        )
        .unwrap();
        let observed = simulate(&mesh, &truth, &|_| {}).unwrap().displacement_mm;
        let found = |assumed| estimated(&mesh, &pulled(assumed), &observed, None).outcome.verdict;
        let names_a_way = |verdict: &Verdict| verdict.reasons.iter().any(|r| matches!(r, Reason::OtherWayDown { .. }));
        let wrong = found(upright);
        assert!(!wrong.finding.has_stiffness() && names_a_way(&wrong), "{wrong:?}");
        assert!(wrong.sentence.contains("towards the left side"), "{}", wrong.sentence);
        let right = found(lying);
        assert!(right.finding.has_stiffness() && !names_a_way(&right), "{right:?}");
    }

    #[test]
    fn surfaces_no_further_from_rest_than_they_are_known_claim_no_stiffness() {
        let (mesh, scenario, observed) = phantom(4);
        let found = |share: f64| {
            let moved = mesh.nodes_mm().iter().zip(&observed);
            let nodes: Vec<[f64; 3]> = moved.map(|(x, (_, u))| std::array::from_fn(|a| x[a] + share * u[a])).collect();
            let (surface, _) = TriMesh::from_facets(&nodes, &mesh.boundary_facets(|_| true));
            let surfaces = BTreeMap::from([("superior".to_owned(), surface)]);
            let seen = Observation::Surfaces(ObservedSurfaces::new(&mesh, surfaces).unwrap());
            let posed = problem(&mesh, &scenario, Vec::new());
            let noise = EstimateSettings { noise_mm: 0.3, ..EstimateSettings::default() };
            solve_problem(Problem { observation: seen, ..posed }, &noise).unwrap().outcome.verdict
        };
        let still = found(0.05);
        assert_eq!(still.finding, Finding::NoShift, "{still:?}");
        assert!(still.sentence.contains("mm at rest") && still.moduli.iter().all(|(_, c)| *c == Claim::Withheld));
        assert!(found(1.0).finding.has_stiffness());
    }

    /// The block, pushed hard enough that a law's shape shows, with the truth's law and the prior of that law.
    fn of_law(truth: &Material, law: MetaModel) -> (EstimateOutcome, BTreeMap<String, Material>) {
        let mesh = block(4);
        let mut scenario =
            PhantomSettings { two_tissue_force_n: [0.0, 0.0, -0.35], ..PhantomSettings::pushed_from_above() }
                .scenario();
        for name in ["grey_matter", "white_matter"] {
            scenario.materials.insert(name.to_owned(), truth.clone());
        }
        let observed = every_node(&simulate(&mesh, &scenario, &|_| {}).unwrap().displacement_mm);
        let prior = PriorSettings { law, ..PriorSettings::default() };
        let brain = Tissue::whole_brain().remove(0);
        let problem = Problem {
            unknowns: law_priors(std::slice::from_ref(&brain), &prior).unwrap(),
            start: Vec::new(),
            ..problem(&mesh, &scenario, observed)
        };
        let noise = EstimateSettings { noise_mm: 0.01, ..EstimateSettings::default() };
        let found = solve_problem(problem, &noise).unwrap();
        (found.outcome, found.materials)
    }

    #[test]
    fn the_parameters_of_ogdens_and_of_mooney_and_rivlins_law_come_back_inside_their_intervals() {
        let (alpha, modulus) = (-19.0, 670.0);
        let truth = material(modulus, Some((&ogden::SHAPE, alpha)), 0.45);
        let (found, materials) = of_law(&truth, MetaModel::OGDEN);
        let inside = |outcome: &EstimateOutcome, n: usize, value: f64| {
            let [low, high] = outcome.posterior.interval_95[n];
            assert!(low.min(high) <= value && value <= high.max(low), "{value} {:?}", outcome.posterior);
        };
        inside(&found, 0, modulus);
        inside(&found, 1, alpha);
        assert_eq!(materials["brain"].name(), "ogden");
        let truth = material(670.0, Some((&mooney_rivlin::SHAPE, 0.5)), 0.45);
        let (found, materials) = of_law(&truth, MetaModel::MOONEY_RIVLIN);
        inside(&found, 0, 670.0);
        inside(&found, 1, Scale::Share.value(0.5));
        assert_eq!(materials["brain"].name(), "mooney-rivlin");
    }

    #[test]
    fn the_parameters_of_gents_law_come_back_inside_their_intervals() {
        let (jm, modulus) = (1.5_f64, 670.0);
        let truth = material(modulus, Some((&gent::SHAPE, jm.ln())), 0.45);
        let meta_model = MetaModel::all().find(|law| law.name() == "gent").unwrap();
        let (found, materials) = of_law(&truth, meta_model);
        let inside = |n: usize, value: f64| {
            let [low, high] = found.posterior.interval_95[n];
            assert!(low <= value && value <= high, "{value} {:?}", found.posterior);
        };
        inside(0, modulus);
        inside(1, jm);
        assert_eq!(materials["brain"].name(), "gent");
        assert_ne!(found.verdict.finding, Finding::Conflict, "{:?}", found.verdict);
    }
}

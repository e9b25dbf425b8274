//! Stage `estimate`: the most probable moduli with their intervals, and the state they lead to.

use super::brain_shift::SeenShift;
use super::held_body::HeldBody;
use super::held_by::held_by;
use crate::artefact::{Produced, Stage};
use crate::experiment::compare::{Candidate, Comparison, compare, with_weakest_bounds};
use crate::experiment::estimate::{
    Errors, Estimate, EstimateOutcome, EstimateSettings, Instrument, LogPrior, MovedNode, Observation, Problem,
    SEEN_AT, SEEN_DISPLACEMENT, ShapeError, Shown, Unknown, moved_by, solve_problem,
};
use crate::experiment::outcome::SampleOutcome;
use crate::experiment::prior::{PriorSettings, law_priors};
use crate::experiment::sample::{Sample, Tissue, TissueSample};
use crate::experiment::sweep::Reference;
use crate::experiment::ventricles::VentricleChange;
use crate::experiment::verdict::{Finding, Verdict};
use crate::fem::{Loads, Scenario};
use crate::geometry::{Frame, Mni};
use crate::layout::{ESTIMATE_JSON, ESTIMATE_STATE};
use crate::material::law::Material;
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use crate::workflow::error::WorkflowError;
use crate::workflow::estimate_options::{EstimateOptions, Observed};
use crate::workflow::facts::EstimateFacts;
use crate::workflow::stage_name::StageName;
use crate::workflow::warning::Warning;
use crate::workflow::work::{Made, Work, facts};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 38;
const NAME: StageName = StageName::Estimate;
/// How near to its own minimum the search on the coarse mesh ends, in standard deviations of the posterior.
const NEARLY: f64 = 0.1;
/// Name of the estimate among the samples.
const ESTIMATE: &str = "estimate";

impl EstimateOptions {
    /// Refuses to estimate loads that are not there.
    pub(super) fn suits(&self, loads: &Loads) -> Result<(), &'static str> {
        let weightless = loads.gravity_m_per_s2 == [0.0; 3] || loads.density_kg_per_m3 == 0.0;
        if (self.density || self.gravity_direction) && weightless {
            return Err(
                "`density` and `gravity_direction` need gravity, and this body is loaded without it (a phantom is \
                        pushed by a force); take them away",
            );
        }
        if self.density && (loads.csf.is_some() || !self.fluid.may_be_given()) {
            return Err(
                "`density` is the effective density of a brain without a fluid around it; in fluid it is the tissue's own, \
                        which is known: take `density` away, or [resection.csf] (`fluid = \"unknown\"` estimates the part drained)",
            );
        }
        if self.fluid.may_be_unknown() && loads.gravity_m_per_s2 == [0.0; 3] {
            return Err(
                "`fluid` needs gravity, and this body is loaded without it (a phantom is pushed by a force); take it away",
            );
        }
        if self.pressure && (loads.pressure.is_empty() || loads.pressure.iter().any(|load| load.pressure_pa == 0.0)) {
            return Err(
                "`pressure` needs pressures other than 0 to begin with, since how large each is, is estimated as a factor of it: \
                        give them in [[resection.pressure]], or take it away",
            );
        }
        Ok(())
    }
}

/// What an estimate needs of its case.
pub(crate) struct EstimateInput<'a> {
    /// The undeformed mesh and its file's bytes.
    pub mesh: (&'a TetMesh, &'a [u8]),
    /// Loads, supports, solver.
    pub scenario: &'a Scenario,
    /// The tissues whose moduli are estimated.
    pub tissues: &'a [Tissue],
    /// Poisson's ratio of all of them.
    pub poisson_ratio: f64,
    /// What the state is compared with.
    pub reference: &'a Reference,
    /// The same body in a coarser mesh where it has one, made when it is asked for.
    pub coarser: Option<&'a dyn Fn() -> Result<Option<TetMesh>, WorkflowError>>,
    /// The body as each of the supports that are tried holds it, made when it is asked for; the one above where there are none.
    pub held: Option<&'a dyn Fn() -> Result<Vec<HeldBody>, WorkflowError>>,
    /// The same with every fluid that a comparison crosses them with.
    pub every_fluid: Option<&'a dyn Fn() -> Result<Vec<HeldBody>, WorkflowError>>,
    /// The body with its cortex stuck to the skull, which is not believed of it, made when it is asked for.
    pub stuck: Option<&'a dyn Fn() -> Result<HeldBody, WorkflowError>>,
    /// What the images show of the displacement, where there are images.
    pub shift: Option<&'a SeenShift>,
    /// Standard deviation of one distance to a surface (of a node of a phantom), mm.
    pub noise_mm: f64,
    /// Expected error of the rigid registration, mm.
    pub rigid_error_mm: f64,
    /// The ventricles' volume on the scans, before and after, cm3.
    pub ventricles_cc: Option<[f64; 2]>,
}

impl EstimateInput<'_> {
    /// Whether rigid registration has followed the brain: it does where a scan shows no skull.
    fn rigid_follows(&self) -> bool {
        self.shift.is_some_and(|shift| !shift.registration().skull_is_shown)
    }
}

/// The stage with its settings and inputs.
pub(crate) fn estimate_stage(work: &Work<'_>, made: &Made, input: &EstimateInput<'_>) -> Result<Stage, WorkflowError> {
    let (options, prior) = (&work.settings.estimate, &work.settings.prior);
    options.suits(&input.scenario.loads).map_err(WorkflowError::EstimateLoads)?;
    let posed = serde_json::json!({
        "scenario": input.scenario, "tissues": input.tissues, "poisson_ratio": input.poisson_ratio,
        "noise_mm": input.noise_mm, "estimate": options, "prior": prior, "held": held_by(work),
    });
    Ok(work.stage(made, &NAME, VERSION, &posed).input("mesh", input.mesh.1).frame(Mni::NAME))
}

/// The estimate of this case and these settings, where it is there.
pub(crate) fn present_estimate(
    work: &Work<'_>,
    made: &mut Made,
    input: &EstimateInput<'_>,
) -> Result<Option<EstimateFacts>, WorkflowError> {
    // What cannot be posed is not there.
    let Ok(stage) = estimate_stage(work, made, input) else { return Ok(None) };
    if !stage.why().is_empty() {
        return Ok(None);
    }
    let (manifest, facts) = work.case.stage(&NAME)?;
    made.add(NAME, manifest);
    Ok(Some(facts))
}

/// Runs (or skips) the estimate.
pub(crate) fn estimate(
    work: &Work<'_>,
    made: &mut Made,
    input: &EstimateInput<'_>,
) -> Result<EstimateFacts, WorkflowError> {
    let stage = estimate_stage(work, made, input)?;
    work.run(made, &NAME, &stage, || {
        let bodies = Bodies::of(work, input)?;
        work.tell(|p| p.begin("estimate", bodies.list.len()));
        let (mut models, mut left_out, mut refused) = (Vec::new(), Vec::new(), None);
        let prior = &work.settings.prior;
        for (n, body) in bodies.list.iter().enumerate() {
            match bodies.solved(work, input, n, input.tissues, prior) {
                Ok(found) => models.push((body.name(), found)),
                // The others are still tried; what could not be solved is neither refuted nor borne out.
                Err(error) => {
                    left_out.push((body.name(), error.to_string()));
                    refused.get_or_insert(error);
                }
            }
            work.tell(|p| p.step());
        }
        work.tell(|p| p.end());
        let found = match (models.len(), refused) {
            (0, Some(error)) => return Err(error),
            (0, None) => return Err(WorkflowError::NoEvidence),
            (1, None) => (models.remove(0), None),
            _ => chosen(models),
        };
        let taught_by = work.settings.prior.patients();
        let ((name, found), comparison) = found;
        let body = bodies.list.iter().find(|body| body.name() == name).unwrap_or(&bodies.list[0]);
        let of = (input.tissues, prior);
        let verdict = bodies.bounded(work, input, of, &found.seen, found.outcome.verdict.clone())?;
        let verdict = verdict.beside_unsolved(left_out.iter().map(|(model, _)| model.clone()));
        let comparison = comparison.map(|c| Comparison { verdict: verdict.clone(), ..c });
        let outcome = EstimateOutcome { taught_by, limits: verdict.because(), verdict, ..found.outcome };
        let found = Estimate { outcome, ..found };
        let loads = bodies.loads_in_words(
            &work.settings.estimate,
            (name.as_str(), comparison.as_ref()),
            found.outcome.verdict.finding,
        );
        let mut produced = produced(body, input, found, (comparison, loads))?;
        produced.warn(left_out.into_iter().map(|(model, reason)| Warning::ModelLeftOut { model, reason }));
        Ok(produced)
    })
}

/// The most probable model with the verdict over all of them.
fn chosen(mut models: Vec<(String, Estimate)>) -> ((String, Estimate), Option<Comparison>) {
    let outcomes = models.iter().map(|(name, found)| (name.clone(), found.outcome.clone())).collect();
    let Some((comparison, outcome)) = compare(outcomes) else {
        // Errors that are not correlated give no evidence: the first of the family stands.
        return (models.remove(0), None);
    };
    let best = comparison.candidates.first().map(|c| c.name.clone()).unwrap_or_default();
    let place = models.iter().position(|(name, _)| *name == best).unwrap_or(0);
    let (name, found) = models.swap_remove(place);
    ((name, Estimate { outcome, ..found }), Some(comparison))
}

/// The bodies that are tried, with what is observed of all of them.
pub(super) struct Bodies {
    pub list: Vec<HeldBody>,
    /// Nodes deep enough to be believed, with their places (mm).
    deep: Vec<(u32, [f64; 3])>,
    /// The same body in a coarser mesh, where it has one.
    coarser: Option<TetMesh>,
}

impl Bodies {
    /// Makes them.
    pub fn of(work: &Work<'_>, input: &EstimateInput<'_>) -> Result<Self, WorkflowError> {
        let options = &work.settings.estimate;
        let list = match input.held {
            Some(make) if options.observed == Observed::Displacement => make()?,
            _ => Vec::new(),
        };
        let as_posed = || HeldBody {
            settings: input.held.map(|_| work.settings.resection.clone()),
            scenario: input.scenario.clone(),
            mesh: input.mesh.0.clone(),
            reference: input.reference.clone(),
            levels: None,
        };
        let list = if list.is_empty() { vec![as_posed()] } else { list };
        let coarser = match input.coarser {
            Some(make) if options.two_meshes && options.observed == Observed::Displacement => make()?,
            _ => None,
        };
        // The same places for every body: evidence is of one set of data.
        let deep = options.displacement.observed(input.mesh.0, |x| x);
        Ok(Self { list, deep, coarser })
    }

    /// Loads and supports in words of what a verdict of this finding is about, a body each: of the model of this name, of every one
    /// that an average is over, of all where a bound has to hold for all. None of a phantom.
    fn loads_in_words(
        &self,
        options: &EstimateOptions,
        (best, compared): (&str, Option<&Comparison>),
        finding: Finding,
    ) -> Vec<String> {
        let name = |candidate: &Candidate| candidate.name.clone();
        let about = match (compared, finding) {
            (Some(compared), Finding::CannotTell) => compared.averaged().map(name).collect(),
            (Some(compared), Finding::NoShift) => compared.candidates.iter().map(name).collect(),
            _ => vec![best.to_owned()],
        };
        let bodies = about.iter().filter_map(|name| self.list.iter().find(|body| body.name() == *name));
        bodies.filter_map(|body| body.loads_in_words(options, finding)).collect()
    }

    /// What is estimated of one of them, and its scenario.
    fn posed(
        work: &Work<'_>,
        body: &HeldBody,
        tissues: &[Tissue],
        prior: &PriorSettings,
    ) -> Result<(Vec<(Unknown, LogPrior)>, Scenario), WorkflowError> {
        let options = &work.settings.estimate;
        let mut unknowns = law_priors(tissues, prior)?;
        let loads = options.unknown_loads(&body.scenario.loads);
        unknowns.extend(loads.into_iter().map(|(unknown, known)| (unknown, prior.learnt(known))));
        unknowns.extend(body.unknown_room());
        unknowns.extend(body.unknown_fluid(options));
        let mut scenario = body.scenario.clone();
        if matches!(body.reference, Reference::Surfaces(_)) {
            scenario.solver.element = options.element;
        }
        Ok((unknowns, scenario))
    }

    /// The coarser mesh as one of them is held.
    fn coarser_of(&self, body: &HeldBody) -> Result<Option<TetMesh>, WorkflowError> {
        let supported = |coarse: &TetMesh| match &body.settings {
            Some(settings) => settings.supported_mesh(coarse.clone(), &body.scenario),
            None => Ok(coarse.clone()),
        };
        Ok(self.coarser.as_ref().map(supported).transpose()?)
    }

    /// The estimate of one of them on the coarse mesh, which knows nearly where to look in a fraction of the time; `None`
    /// without that mesh, or where it finds none.
    fn roughly(
        &self,
        work: &Work<'_>,
        input: &EstimateInput<'_>,
        body: &HeldBody,
        tissues: &[Tissue],
        prior: &PriorSettings,
    ) -> Result<Option<Estimate>, WorkflowError> {
        let options = &work.settings.estimate;
        let (Some(bare), Some(coarse), Some(shift)) = (&self.coarser, self.coarser_of(body)?, input.shift) else {
            return Ok(None);
        };
        let (unknowns, scenario) = Self::posed(work, body, tissues, prior)?;
        let (_, errors, noise_mm) = self.observation(body, input, options);
        let nodes = options.displacement.observed(bare, |x| moved_by(&shift.seen, x));
        let problem = Problem {
            rigid_follows: input.rigid_follows(),
            body_known: !matches!(body.reference, Reference::Surfaces(_)),
            ..Problem::new(&coarse, &scenario, unknowns, input.poisson_ratio, (Observation::Nodes(nodes), errors))
        };
        let settings = EstimateSettings { noise_mm, decrement_tolerance: NEARLY, ..options.descent.clone() };
        Ok(solve_problem(problem, &settings).ok())
    }

    /// The estimate of one of them under a prior, begun where the coarse mesh has found it.
    pub fn solved(
        &self,
        work: &Work<'_>,
        input: &EstimateInput<'_>,
        number: usize,
        tissues: &[Tissue],
        prior: &PriorSettings,
    ) -> Result<Estimate, WorkflowError> {
        let options = &work.settings.estimate;
        let body = &self.list[number];
        let rough = self.roughly(work, input, body, tissues, prior)?;
        let mesh = &body.mesh;
        let (unknowns, scenario) = Self::posed(work, body, tissues, prior)?;
        let patient = matches!(body.reference, Reference::Surfaces(_));
        let (observation, errors, noise_mm) = self.observation(body, input, options);
        let believed = &options.displacement;
        let instrument = input.shift.filter(|_| options.observed == Observed::Displacement).map(|shift| {
            move |known: &[[f64; 3]]| {
                work.tell(|p| p.doing("registering the estimate"));
                let (shown, taken_up) = shift.registration().sees(mesh, known, &shift.seen)?;
                Ok(Shown { nodes: self.deep.iter().map(|(n, x)| (*n, moved_by(&shown, *x))).collect(), taken_up })
            }
        });
        let coarser = self.coarser_of(body)?;
        let problem = Problem {
            model_log_sd: if patient { options.model_log_sd } else { 0.0 },
            body_log_sd: if patient { body.log_sd(options) } else { 0.0 },
            shape: if patient { options.shape_error() } else { ShapeError::default() },
            coarser: coarser.as_ref(),
            rigid_follows: input.rigid_follows(),
            body_known: !patient,
            start: rough.map_or_else(Vec::new, |found| found.numbers),
            instrument: instrument.as_ref().map(|show| (show as &Instrument<'_>, believed.re_registrations)),
            ..Problem::new(mesh, &scenario, unknowns, input.poisson_ratio, (observation, errors))
        };
        let settings = EstimateSettings { noise_mm, ..options.descent.clone() };
        Ok(solve_problem(problem, &settings)?)
    }

    /// A verdict of no shift with bounds that hold for a cortex stuck to the skull as well, by the same displacement, `seen`; where
    /// such a body has no equilibrium nobody knows what it would bound, and none is told. Other verdicts stay as they are.
    pub fn bounded(
        &self,
        work: &Work<'_>,
        input: &EstimateInput<'_>,
        (tissues, prior): (&[Tissue], &PriorSettings),
        seen: &[MovedNode],
        verdict: Verdict,
    ) -> Result<Verdict, WorkflowError> {
        let Some(make) = input.stuck.filter(|_| verdict.finding == Finding::NoShift) else { return Ok(verdict) };
        let options = &work.settings.estimate;
        let body = make()?;
        let (unknowns, scenario) = Self::posed(work, &body, tissues, prior)?;
        let (_, errors, noise_mm) = self.observation(&body, input, options);
        let seen = (Observation::Nodes(seen.to_vec()), errors);
        let coarser = self.coarser_of(&body)?.map(|mesh| body.stuck_mesh(mesh));
        let problem = Problem {
            body_known: false,
            model_log_sd: options.model_log_sd,
            body_log_sd: body.log_sd(options),
            shape: options.shape_error(),
            coarser: coarser.as_ref(),
            rigid_follows: input.rigid_follows(),
            ..Problem::new(&body.mesh, &scenario, unknowns, input.poisson_ratio, seen)
        };
        let settings = EstimateSettings { noise_mm, ..options.descent.clone() };
        let Ok(stuck) = solve_problem(problem, &settings) else { return Ok(verdict.without_bounds()) };
        Ok(with_weakest_bounds(verdict.clone(), &[&verdict, &stuck.outcome.verdict].into_iter()))
    }

    /// What is observed, how far it is believed, and the standard deviation of one observation in mm.
    fn observation(
        &self,
        body: &HeldBody,
        input: &EstimateInput<'_>,
        options: &EstimateOptions,
    ) -> (Observation, Errors, f64) {
        match (&body.reference, input.shift) {
            (Reference::Nodes(u), _) => {
                let nodes = u.iter().enumerate().map(|(n, u)| (n as u32, *u)).collect();
                (Observation::Nodes(nodes), Errors::Independent { share: 1.0 }, input.noise_mm)
            }
            (Reference::Surfaces(_), Some(shift)) if options.observed == Observed::Displacement => {
                let believed = &options.displacement;
                let nodes = self.deep.iter().map(|(n, x)| (*n, moved_by(&shift.seen, *x))).collect();
                let errors = Errors::Correlated(believed.errors(input.rigid_error_mm));
                (Observation::Nodes(nodes), errors, believed.noise_mm)
            }
            (Reference::Surfaces(surfaces), _) => {
                // A node of a surface mesh of edge h stands for sqrt(3)/2 h^2 of it.
                let area_mm2 = 0.75f64.sqrt() * body.mesh.median_edge_mm().powi(2);
                let share = (area_mm2 / options.correlation_mm.powi(2)).min(1.0);
                (Observation::Surfaces(surfaces.clone()), Errors::Independent { share }, input.noise_mm)
            }
        }
    }
}

/// With the ventricles' change beside what the scans show of it; a change that contradicts them is among what limits the figures.
fn with_ventricles(body: &HeldBody, input: &EstimateInput<'_>, mut found: Estimate) -> Estimate {
    let Some(seen_cc) = input.ventricles_cc.filter(|_| found.outcome.verdict.finding.has_stiffness()) else {
        return found;
    };
    let log_sd = found.outcome.posterior.log_sd.iter().zip(&found.outcome.posterior.names);
    let log_sd = log_sd.filter(|(_, name)| name.starts_with("shear_modulus_pa")).map(|(sd, _)| *sd).fold(0.0, f64::max);
    let change = VentricleChange::of(&body.mesh, &found.state.displacement_mm, seen_cc, log_sd);
    found.outcome.limits.extend(change.filter(|change| !change.agrees()).map(|change| change.sentence()));
    found.outcome.ventricles = change;
    found
}

fn produced(
    body: &HeldBody,
    input: &EstimateInput<'_>,
    found: Estimate,
    (comparison, loads): (Option<Comparison>, Vec<String>),
) -> Result<Produced, WorkflowError> {
    let mesh = &body.mesh;
    let found = if found.outcome.verdict.finding == Finding::NoShift { found.at_rest() } else { found };
    let found = with_ventricles(body, input, found);
    let Estimate { outcome, state, displacement_sd_mm, displacement_95_mm, seen, materials, numbers: _ } = found;
    let errors = body.reference.errors(mesh, &state.displacement_mm);
    let tissue = |t: &Tissue| {
        // The parameters are named after the tissue.
        let name = Unknown::ShearModulus(t.clone()).name();
        let n = outcome.posterior.names.iter().position(|of| *of == name).unwrap_or(0);
        let (mode, prior) = (outcome.posterior.mode[n], &outcome.prior[n]);
        let level = prior.sd.map_or(0.0, |sd| (mode.ln() - prior.mean) / sd);
        let neo_hookean = || Material::neo_hookean(mode, input.poisson_ratio);
        let material = materials.get(&t.name).cloned().unwrap_or_else(neo_hookean);
        (t.name.clone(), TissueSample { sd_level: level, shear_modulus_pa: mode, material })
    };
    let sample = Sample { id: ESTIMATE.to_owned(), tissues: input.tissues.iter().map(tissue).collect(), task: None };
    let largest = state.displacement_mm.iter().map(|u| u.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max);
    let file = ESTIMATE_STATE.to_owned();
    let record = SampleOutcome {
        id: sample.id.clone(),
        task: None,
        sd_levels: sample.tissues.iter().map(|(name, t)| (name.clone(), t.sd_level)).collect(),
        shear_modulus_pa: sample.tissues.iter().map(|(name, t)| (name.clone(), t.shear_modulus_pa)).collect(),
        laws: sample.tissues.iter().map(|(name, t)| (name.clone(), t.law())).collect(),
        rmse_mm: errors.rmse_mm,
        surface_distance_mm: errors.surface_distance_mm,
        converged: true,
        newton_iterations: state.convergence.iterations.len(),
        relative_residuals: state.convergence.iterations.iter().map(|i| i.relative_residual).collect(),
        displacement_max_mm: Some(largest),
        file: Some(file.clone()),
    };
    let observed = errors.node_observed.iter().map(|&seen| f64::from(u8::from(seen))).collect();
    let mut seen_at = vec![0.0; mesh.nodes_mm().len()];
    let mut seen_mm = vec![[0.0; 3]; mesh.nodes_mm().len()];
    for (n, u) in seen {
        (seen_at[n as usize], seen_mm[n as usize]) = (1.0, u);
    }
    let points = [
        Field::vector("displacement", &state.displacement_mm),
        Field::vector("reaction_n", &state.reaction_n),
        Field::scalar("rmse_mm", errors.node_error_mm),
        Field::scalar("rmse_observed", observed),
        Field::vector("displacement_mean", &state.displacement_mm),
        Field::scalar("displacement_sd", displacement_sd_mm),
        Field::scalar("displacement_95", displacement_95_mm),
        Field::vector(SEEN_DISPLACEMENT, &seen_mm),
        Field::scalar(SEEN_AT, seen_at),
    ];
    let cells = [
        Field::scalar("jacobian", state.jacobian),
        Field::scalar("strain_energy_density_pa", state.strain_energy_density_pa),
    ];
    let json = serde_json::to_string_pretty(&outcome).expect("figures are plain data") + "\n";
    let limits = outcome.limits.iter().cloned();
    let of_state = state.warnings.iter().map(ToString::to_string);
    Ok(Produced {
        files: vec![(file, vtu::encode(mesh, &points, &cells)?), (ESTIMATE_JSON.to_owned(), json.into_bytes())],
        warnings: limits.chain(of_state).map(|limit| format!("estimate: {limit}")).collect(),
        facts: facts(&EstimateFacts { estimate: outcome, record, comparison, loads }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::label;
    use crate::experiment::resection::{ResectionSettings, Supports};
    use nalgebra::UnitQuaternion;

    fn body(supports: Supports) -> HeldBody {
        let settings = ResectionSettings { supports, ..ResectionSettings::default() };
        let held = if supports == Supports::Sliding { "brainstem" } else { "base" };
        let scenario = Scenario { fixed: vec![held.to_owned()], ..settings.scenario(&UnitQuaternion::identity()) };
        let nodes = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]], vec![label::GREY_MATTER]).unwrap();
        HeldBody { settings: Some(settings), scenario, mesh, reference: Reference::Nodes(Vec::new()), levels: None }
    }

    #[test]
    fn loads_are_told_of_the_bodies_that_a_verdict_is_about() {
        let list = [Supports::Fixed, Supports::Sliding].map(body).into();
        let bodies = Bodies { list, deep: Vec::new(), coarser: None };
        let told = |finding, log_odds: f64| {
            let candidate = |(name, log_evidence): (&str, f64)| Candidate {
                name: name.to_owned(),
                log_evidence,
                weight: 0.5,
                finding: Finding::Identified,
                explained_share: 0.9,
                moduli_pa: Vec::new(),
            };
            let candidates = [("supports sliding", 0.0), ("supports fixed", -log_odds)].map(candidate).to_vec();
            let compared = Comparison { candidates, log_odds: Some(log_odds), verdict: Verdict::default() };
            bodies.loads_in_words(&EstimateOptions::default(), ("supports sliding", Some(&compared)), finding)
        };
        let is_of = |said: &[String], held: &[&str]| {
            said.len() == held.len() && said.iter().zip(held).all(|(said, held)| said.contains(&format!("{held} held")))
        };
        let sliding = told(Finding::Identified, 99.0);
        assert!(is_of(&sliding, &["brainstem"]) && sliding[0].contains("skull estimated along"), "{sliding:?}");
        assert!(is_of(&told(Finding::CannotTell, 1.0), &["brainstem", "base"]));
        assert!(is_of(&told(Finding::CannotTell, 99.0), &["brainstem"]), "not of one that is ruled out");
        let every = told(Finding::NoShift, 99.0);
        assert!(is_of(&every, &["brainstem", "base"]) && every[0].contains("skull not taken as known"), "{every:?}");
    }
}

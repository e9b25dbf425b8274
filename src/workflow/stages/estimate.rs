//! Stage `estimate`: the most probable moduli with their intervals, and the state they lead to.

use super::brain_shift::SeenShift;
use crate::artefact::{Produced, Stage};
use crate::experiment::estimate::{
    Estimate, EstimateSettings, Instrument, LogPrior, Observation, Problem, Turn, Unknown, moved_by, solve_problem,
};
use crate::experiment::outcome::SampleOutcome;
use crate::experiment::phantom::neo_hookean;
use crate::experiment::prior::log_prior;
use crate::experiment::sample::{Sample, Tissue};
use crate::experiment::sweep::Reference;
use crate::fem::{Loads, Scenario};
use crate::geometry::{Frame, Mni};
use crate::layout::{ESTIMATE_JSON, ESTIMATE_STATE};
use crate::material::meta_model::MetaModel;
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use crate::workflow::error::WorkflowError;
use crate::workflow::estimate_options::{EstimateOptions, Observed};
use crate::workflow::facts::EstimateFacts;
use crate::workflow::stage_name::StageName;
use crate::workflow::work::{Made, Work, facts};

/// Raised when the stage's code changes its result.
const VERSION: u32 = 5;
const NAME: StageName = StageName::Estimate;
/// Name of the estimate among the samples.
const ESTIMATE: &str = "estimate";

impl EstimateOptions {
    /// Refuses to estimate loads that are not there.
    fn suits(&self, loads: &Loads) -> Result<(), &'static str> {
        let weightless = loads.gravity_m_per_s2 == [0.0; 3] || loads.density_kg_per_m3 == 0.0;
        if (self.density || self.gravity_direction) && weightless {
            return Err(
                "`density` and `gravity_direction` need gravity, and this body is loaded without it (a phantom is \
                        pushed by a force); take them away",
            );
        }
        if self.pressure && loads.pressure.is_empty() {
            return Err(
                "`pressure` needs a pressure to begin with: give one in [[resection.pressure]], or take it away",
            );
        }
        Ok(())
    }

    /// The loads that are estimated, with what is known of them beforehand.
    fn unknown_loads(&self, loads: &Loads) -> Vec<(Unknown, LogPrior)> {
        let mut unknowns = Vec::new();
        let mut add = |unknown: Unknown, mean: f64, sd: f64| {
            let prior = unknown.prior(mean, sd);
            unknowns.push((unknown, prior));
        };
        if self.density {
            add(Unknown::Density, loads.density_kg_per_m3.ln(), self.density_log_sd);
        }
        if self.gravity_direction {
            for turn in [Turn::Nodding, Turn::Rolling] {
                add(Unknown::GravityTurn(turn), 0.0, self.gravity_direction_sd_deg.to_radians());
            }
        }
        if self.pressure {
            for (n, load) in loads.pressure.iter().enumerate() {
                add(Unknown::Pressure(n), load.pressure_pa.abs().ln(), self.pressure_log_sd);
            }
        }
        unknowns
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
    /// What the images show of the displacement, where there are images.
    pub shift: Option<&'a SeenShift>,
    /// Standard deviation of one distance to a surface (of a node of a phantom), mm.
    pub noise_mm: f64,
}

/// The stage with its settings and inputs.
pub(crate) fn estimate_stage(work: &Work<'_>, made: &Made, input: &EstimateInput<'_>) -> Result<Stage, WorkflowError> {
    let (options, prior) = (&work.settings.estimate, &work.settings.prior);
    options.suits(&input.scenario.loads).map_err(WorkflowError::EstimateLoads)?;
    if prior.law != MetaModel::NEO_HOOKEAN {
        return Err(WorkflowError::EstimateLaw { law: prior.law.name().to_owned() });
    }
    let posed = serde_json::json!({
        "scenario": input.scenario, "tissues": input.tissues, "poisson_ratio": input.poisson_ratio,
        "noise_mm": input.noise_mm, "estimate": options, "prior": prior,
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
    let (options, prior) = (&work.settings.estimate, &work.settings.prior);
    let stage = estimate_stage(work, made, input)?;
    work.run(made, &NAME, &stage, || {
        work.tell(|p| p.begin("estimate", 1));
        let mesh = input.mesh.0;
        let mut unknowns = Vec::new();
        for tissue in input.tissues {
            unknowns.push((Unknown::ShearModulus(tissue.clone()), log_prior(tissue, prior)?));
        }
        unknowns.extend(options.unknown_loads(&input.scenario.loads));
        let patient = matches!(input.reference, Reference::Surfaces(_));
        let mut scenario = input.scenario.clone();
        if patient {
            scenario.solver.element = options.element;
        }
        let (observation, independent_share, noise_mm) = observation(input, options);
        let believed = &options.displacement;
        let instrument = input.shift.filter(|_| options.observed == Observed::Displacement).map(|shift| {
            move |known: &[[f64; 3]]| {
                work.tell(|p| p.doing("registering the estimate"));
                let shown = shift.registration().sees(mesh, known, &shift.seen)?;
                Ok(believed.observed(mesh, |x| moved_by(&shown, x)))
            }
        });
        let problem = Problem {
            mesh,
            template: &scenario,
            unknowns,
            poisson_ratio: input.poisson_ratio,
            observation,
            independent_share,
            model_log_sd: if patient { options.model_log_sd } else { 0.0 },
            start: Vec::new(),
            instrument: instrument.as_ref().map(|show| (show as &Instrument<'_>, believed.re_registrations)),
        };
        let settings = EstimateSettings { noise_mm, ..options.descent.clone() };
        let found = solve_problem(problem, &settings)?;
        work.tell(|p| p.end());
        produced(input, found)
    })
}

/// What is observed, the share of it that is independent, and the standard deviation of one observation in mm.
fn observation(input: &EstimateInput<'_>, options: &EstimateOptions) -> (Observation, f64, f64) {
    let mesh = input.mesh.0;
    match (input.reference, input.shift) {
        (Reference::Nodes(u), _) => {
            (Observation::Nodes(u.iter().enumerate().map(|(n, u)| (n as u32, *u)).collect()), 1.0, input.noise_mm)
        }
        (Reference::Surfaces(_), Some(shift)) if options.observed == Observed::Displacement => {
            let believed = &options.displacement;
            let nodes = believed.observed(mesh, |x| moved_by(&shift.seen, x));
            (Observation::Nodes(nodes), believed.independent_share(mesh), believed.noise_mm)
        }
        (Reference::Surfaces(surfaces), _) => {
            // A node of a surface mesh of edge h stands for sqrt(3)/2 h^2 of it.
            let area_mm2 = 0.75f64.sqrt() * mesh.median_edge_mm().powi(2);
            let share = (area_mm2 / options.correlation_mm.powi(2)).min(1.0);
            (Observation::Surfaces(surfaces.clone()), share, input.noise_mm)
        }
    }
}

fn produced(input: &EstimateInput<'_>, found: Estimate) -> Result<Produced, WorkflowError> {
    let mesh = input.mesh.0;
    let Estimate { outcome, state, displacement_sd_mm, displacement_95_mm } = found;
    let errors = input.reference.errors(mesh, &state.displacement_mm);
    let tissue = |(n, t): (usize, &Tissue)| {
        let (mode, prior) = (outcome.posterior.mode[n], &outcome.prior[n]);
        let level = prior.sd.map_or(0.0, |sd| (mode.ln() - prior.mean) / sd);
        (t.name.clone(), neo_hookean(level, mode, input.poisson_ratio))
    };
    let sample =
        Sample { id: ESTIMATE.to_owned(), tissues: input.tissues.iter().enumerate().map(tissue).collect(), task: None };
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
    let points = [
        Field::vector("displacement", &state.displacement_mm),
        Field::vector("reaction_n", &state.reaction_n),
        Field::scalar("rmse_mm", errors.node_error_mm),
        Field::scalar("rmse_observed", observed),
        Field::vector("displacement_mean", &state.displacement_mm),
        Field::scalar("displacement_sd", displacement_sd_mm),
        Field::scalar("displacement_95", displacement_95_mm),
    ];
    let cells = [
        Field::scalar("jacobian", state.jacobian),
        Field::scalar("strain_energy_density_pa", state.strain_energy_density_pa),
    ];
    let json = serde_json::to_string_pretty(&outcome).expect("figures are plain data") + "\n";
    Ok(Produced {
        files: vec![(file, vtu::encode(mesh, &points, &cells)?), (ESTIMATE_JSON.to_owned(), json.into_bytes())],
        warnings: outcome.limits.iter().map(|limit| format!("estimate: {limit}")).collect(),
        facts: facts(&EstimateFacts { estimate: outcome, record }),
    })
}

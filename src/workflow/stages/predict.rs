//! Stage `predict`: how a planned patient's brain will move, and how sure that is.

use super::fields::carried;
use super::plan::PlannedHead;
use super::predicted_draws::{mode_fields, over_threshold_cc};
use super::registration::pose;
use super::samples::with_held_tissues;
use super::shift::{grid_of, mask_of, spaced};
use crate::artefact::Produced;
use crate::experiment::field::{Moved, ShiftField, Surroundings, in_tetrahedra, shift_field};
use crate::experiment::outcome::MeshOutcome;
use crate::experiment::predict::{
    Check, DrawnState, DrawsSolved, FluidOfHead, Forecast, ForecastError, Found, Head, HeadDraws, HeadPrediction,
    Locator, Modes, PREDICTED, Planned, Posed, PredictSettings, Prediction, Spread, SupportWeight, TargetPlace,
    TargetPrediction, UnknownOutcome, assumptions, compared_heads, draws_to_csv, ellipsoid_95, farthest, forecast,
    spread, variance_shares,
};
use crate::experiment::resection::{ResectionSettings, Supports};
use crate::fem::Scenario;
use crate::geometry::{Frame, Mni, Position, Pre, RigidTransform};
use crate::image::nifti::{encode_displacement, encode_mask, encode_numbers};
use crate::image::{LabelMap, Mask};
use crate::layout::{
    NATIVE_RESECTED, PRE_NATIVE_BRAIN, PREDICTED_DRAWS, PREDICTED_STATE, PREDICTION_JSON, SHIFT, SHIFT_BACK,
    SHIFT_MASK, SHIFT_PROBABILITY, SHIFT_REACH, SHIFT_REACH_50, SHIFT_SD,
};
use crate::mesh::TetMesh;
use crate::mesh::format::{Field, vtu};
use crate::workflow::case::Case;
use crate::workflow::error::{PredictError, WorkflowError};
use crate::workflow::settings::Settings;
use crate::workflow::stage_name::StageName;
use crate::workflow::targets::Targets;
use crate::workflow::warning::Warning;
use crate::workflow::work::{Made, Work, facts};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Raised when the stage's code changes its result.
const VERSION: u32 = 18;
const NAME: StageName = StageName::Predict;
/// Nodes that shares of the variance are summed over.
const SHARED_NODES: usize = 100;

/// What a prediction needs of its case.
pub(crate) struct PredictInput<'a> {
    /// The undeformed mesh, its file's bytes, and its figures.
    pub mesh: (&'a TetMesh, &'a [u8], &'a MeshOutcome),
    /// What is to be taken.
    pub plan: &'a Planned,
    /// The points that are asked for, all in the head.
    pub targets: Option<&'a Targets>,
}

/// Makes (or skips) the prediction.
pub(crate) fn predict(work: &Work<'_>, made: &mut Made, input: &PredictInput<'_>) -> Result<Prediction, WorkflowError> {
    let settings = work.settings;
    let posed = serde_json::json!({
        "predict": settings.predict, "resection": settings.resection, "prior": settings.prior,
        "element": settings.estimate.element, "fields": settings.fields,
    });
    let stage = work.stage(made, &NAME, VERSION, &posed).input("mesh", input.mesh.1).frame(Pre::NAME);
    let stage = input.targets.iter().fold(stage, |stage, targets| stage.input("targets", &targets.bytes));
    work.run(made, &NAME, &stage, || {
        let patient = Patient::read(work, input)?;
        let mut produced = Produced::default();
        produced.warn(settings.predict.few_draws().map(|draws| Warning::FewDraws { draws }));
        let weights = settings.predict.weights(&settings.resection);
        let weighed = |(s, weight): &(Supports, f64)| SupportWeight { supports: s.name().to_owned(), weight: *weight };
        let mut prediction = Prediction {
            plan: input.plan.clone(),
            threshold_mm: settings.predict.threshold_mm,
            draws: settings.predict.draws,
            supports: weights.iter().map(weighed).collect(),
            held_shear_modulus_pa: with_held_tissues(work, input.mesh.2, Scenario::default())?.1,
            ..Prediction::default()
        };
        let heads = &settings.predict.heads;
        let bodies: Vec<Vec<Posed>> = heads.iter().map(|head| patient.posed(work, head)).collect::<Result<_, _>>()?;
        let mut drawn_heads = Vec::new();
        let forecasts = forecasts(work, &bodies, patient.input.mesh.0.nodes_mm().len());
        for (number, ((head, bodies), forecasts)) in heads.iter().zip(&bodies).zip(forecasts).enumerate() {
            let found = Lying::of(work, &patient, head, (bodies, forecasts), &mut produced)?;
            let state = if number == 0 { PREDICTED.to_owned() } else { format!("{PREDICTED}-{}", head.name(number)) };
            prediction.checks.extend(found.checks.iter().cloned());
            prediction.heads.push(found.in_numbers(&patient, head, &state));
            let field = patient.field(&found.spread);
            let draws = patient.files(&state, &found, &field, &mut produced)?;
            drawn_heads.push(HeadDraws { head: head.to_string(), supports: found.supports, draws });
            if number == 0 {
                carried(work, &field, &mut produced)?;
            }
        }
        prediction.least = compared_heads(&drawn_heads);
        // The drawn body with the most unknowns has them all.
        let drawn = |posed: &&Posed| prediction.heads.iter().any(|head| head.is_of(&posed.supports));
        let most = bodies[0].iter().filter(drawn).max_by_key(|posed| posed.uncertainty.list.len());
        prediction.unknowns = most.iter().flat_map(|b| &b.uncertainty.list).map(UnknownOutcome::of).collect();
        prediction.assumptions = assumptions(&settings.predict, (&settings.resection, &settings.prior), &prediction);
        let json = serde_json::to_string_pretty(&prediction).expect("figures are plain data") + "\n";
        produced.files.push((PREDICTION_JSON.to_owned(), json.into_bytes()));
        produced.facts = facts(&prediction);
        Ok(produced)
    })
}

/// Every body of every head solved, heads side by side; the first one's are checked.
fn forecasts(work: &Work<'_>, bodies: &[Vec<Posed>], nodes: usize) -> Vec<Vec<Result<Forecast, ForecastError>>> {
    let settings = &work.settings.predict;
    let checks = |head: usize| if head == 0 { settings.checks } else { 0 };
    let steps = |(head, posed): (usize, &Vec<Posed>)| {
        posed.iter().map(|p| p.steps((settings.draws, checks(head)))).sum::<usize>()
    };
    work.tell(|p| p.begin("prediction", bodies.iter().enumerate().map(steps).sum()));
    let of = |head: usize, step: &(dyn Fn() + Sync)| -> Vec<_> {
        bodies[head].iter().map(|posed| forecast(posed, nodes, (settings.draws, checks(head)), step)).collect()
    };
    let (tell, told) = std::sync::mpsc::channel();
    let found = std::thread::scope(|scope| {
        let solving = scope.spawn(move || {
            let step = || tell.send(()).unwrap_or_default();
            (0..bodies.len()).into_par_iter().map(|head| of(head, &step)).collect()
        });
        for () in told {
            work.tell(|p| p.step());
        }
        solving.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    work.tell(|p| p.end());
    found
}

/// A target in both frames.
struct Target {
    name: Option<String>,
    at_mm: [f64; 3],
    place: TargetPlace,
    found: Found,
}

/// What every head shares.
struct Patient<'a> {
    input: &'a PredictInput<'a>,
    head: PlannedHead,
    mni_from_pre: RigidTransform<Pre, Mni>,
    around: Surroundings,
    planned: Mask<Pre>,
    targets: Vec<Target>,
    settings: &'a Settings,
}

impl<'a> Patient<'a> {
    fn read(work: &'a Work<'_>, input: &'a PredictInput<'a>) -> Result<Self, WorkflowError> {
        let case = &work.case;
        let mni_from_pre = pose(case)?;
        let (around, planned) = surroundings(case, work.settings.fields.spacing_mm)?;
        let head = PlannedHead::read(case)?;
        let (targets, settings) = (Vec::new(), work.settings);
        let mut patient = Self { input, head, mni_from_pre, around, planned, targets, settings };
        patient.targets = input.targets.map_or_else(Vec::new, |targets| patient.targets_of(targets));
        Ok(patient)
    }

    /// Finds every target in the mesh.
    fn targets_of(&self, targets: &Targets) -> Vec<Target> {
        let of = |(x, name): (&[f64; 3], &Option<String>)| {
            let p: Position<Pre> = Position::new(x[0], x[1], x[2]);
            let found = Locator(self.input.mesh.0).find(self.mni_from_pre.apply(p).mm.into());
            let place = place_in(&self.planned, p, found.outside_mm);
            Target { name: name.clone(), at_mm: *x, place, found }
        };
        targets.points_mm.iter().zip(&targets.names).map(of).collect()
    }

    /// The body as each way of supporting it poses it, for one head.
    fn posed(&self, work: &Work<'_>, head: &Head) -> Result<Vec<Posed>, WorkflowError> {
        let settings = work.settings;
        let gravity = head.gravity_m_per_s2(&self.mni_from_pre);
        let one = |(supports, weight)| -> Result<Posed, WorkflowError> {
            let (own, scenario) = planned_body(settings, gravity, supports, &self.head.before)?;
            let (mut scenario, _) = with_held_tissues(work, self.input.mesh.2, scenario)?;
            let mesh = own.supported_mesh(self.input.mesh.0.clone(), &scenario)?;
            scenario.solver.element = settings.estimate.element;
            let uncertainty = settings.predict.uncertainty(&own, &settings.prior, &self.head.before)?;
            let (supports, poisson_ratio) = (supports.name().to_owned(), own.poisson_ratio);
            Ok(Posed { supports, weight, mesh, scenario, poisson_ratio, uncertainty })
        };
        settings.predict.weights(&settings.resection).into_iter().map(one).collect()
    }

    /// The mean shift as a field of the scan.
    fn field(&self, spread: &Spread) -> ShiftField {
        let mesh = self.input.mesh.0;
        let state = Moved {
            tets: mesh.tets(),
            nodes_mm: mesh.nodes_mm(),
            displacement_mm: &spread.mean_mm,
            sd_mm: &spread.sd_mm,
            reach95_mm: &spread.reach95_mm,
        };
        shift_field(&state, None, &self.mni_from_pre.inverse(), &self.around, &self.settings.fields)
    }

    /// Fields of one state in the scan's frame, and the state on the mesh; returns the draws as they are kept.
    fn files(
        &self,
        state: &str,
        found: &Lying,
        field: &ShiftField,
        produced: &mut Produced,
    ) -> Result<Vec<DrawnState>, WorkflowError> {
        let (mesh, spread) = (self.input.mesh.0, &found.spread);
        let pre_from_mni = self.mni_from_pre.inverse();
        let nodes: Vec<[f64; 3]> =
            mesh.nodes_mm().iter().map(|x| pre_from_mni.apply(Position::new(x[0], x[1], x[2])).mm.into()).collect();
        let both: Vec<[f64; 2]> = spread.reach50_mm.iter().zip(&spread.over).map(|(r, p)| [*r, *p]).collect();
        let known = in_tetrahedra(mesh.tets(), &nodes, &both, &field.forward.grid);
        let part = |c: usize| -> Vec<f32> {
            // A thousandth of a mm, or of a probability, is more than is known, and packs well.
            let rounded = |v: &[f32; 2]| (v[c] * 1024.0).round() / 1024.0;
            let values = known.values.iter().zip(&field.believed);
            values.map(|(v, believed)| if *believed { rounded(v) } else { 0.0 }).collect()
        };
        let mut write = |name: String, bytes: Vec<u8>| produced.files.push((name, bytes));
        write(SHIFT.of(state), encode_displacement(&field.whole, |v| field.forward_at(v)));
        write(SHIFT_BACK.of(state), encode_displacement(&field.whole, |v| field.inverse_at(v)));
        let numbers = |part: &[f32]| encode_numbers(&field.whole, |v| field.value_at(part, v));
        write(SHIFT_SD.of(state), numbers(&field.sd_mm));
        write(SHIFT_REACH_50.of(state), numbers(&part(0)));
        write(SHIFT_REACH.of(state), numbers(&field.reach95_mm));
        write(SHIFT_PROBABILITY.of(state), numbers(&part(1)));
        write(SHIFT_MASK.of(state), encode_mask(&field.on_whole(&field.believed)));
        let modes = found.modes(mesh, self.settings.predict.threshold_mm);
        let mut points = vec![
            Field::vector("displacement", &spread.mean_mm),
            Field::scalar("displacement_sd", spread.sd_mm.clone()),
            Field::scalar("displacement_50", spread.reach50_mm.clone()),
            Field::scalar("displacement_95", spread.reach95_mm.clone()),
            Field::scalar("over_threshold", spread.over.clone()),
        ];
        points.extend(mode_fields(&modes));
        write(PREDICTED_STATE.of(state), vtu::encode(mesh, &points, &[])?);
        write(PREDICTED_DRAWS.of(state), draws_to_csv(&modes.draws).into_bytes());
        if field.changed > 0 {
            produced.warn([Warning::Folds { state: state.to_owned(), voxels: field.changed }]);
        }
        Ok(modes.draws)
    }
}

/// Loads and supports of a planned patient for gravity in the MNI frame, with what all draws are around: fluid stands where its level is
/// known, or where so much of it has drained. Materials are still to come.
pub(crate) fn planned_body(
    settings: &Settings,
    gravity_m_per_s2: [f64; 3],
    supports: Supports,
    labels: &LabelMap<Mni>,
) -> Result<(ResectionSettings, Scenario), WorkflowError> {
    let own = settings.predict.resection(&settings.resection, gravity_m_per_s2, supports);
    let mut scenario = own.supported(&own.scenario(&nalgebra::UnitQuaternion::identity()), labels)?;
    let csf = settings.resection.csf.as_ref();
    if let Some((level, _)) = settings.predict.known_fluid(csf, labels, gravity_m_per_s2) {
        scenario.loads.csf = Some(level);
    }
    Ok((own, scenario))
}

/// What is around the mesh on the grid of the fields, and the plan on the scan's own: a coarse grid loses what is thin, and moves
/// the margin by half of its spacing.
fn surroundings(case: &Case, spacing_mm: f64) -> Result<(Surroundings, Mask<Pre>), WorkflowError> {
    let own = grid_of::<Pre>(case, PRE_NATIVE_BRAIN)?;
    let grid = spaced(own, spacing_mm);
    let around = Surroundings {
        brain: mask_of(case, PRE_NATIVE_BRAIN, &grid)?,
        resected: mask_of(case, NATIVE_RESECTED, &grid)?,
    };
    Ok((around, mask_of(case, NATIVE_RESECTED, &own)?))
}

/// Where a target lies, so far from the mesh.
fn place_in(planned: &Mask<Pre>, target: Position<Pre>, outside_mm: f64) -> TargetPlace {
    match planned.nearest(target) {
        Some(true) => TargetPlace::Removed,
        _ if outside_mm > 0.0 => TargetPlace::Fluid,
        _ => TargetPlace::Tissue,
    }
}

/// One head, with the draws of every way of supporting the brain.
struct Lying {
    draws: Vec<(f64, Vec<[f64; 3]>)>,
    /// How the brain was supported in each, and its number among those of these supports.
    named: Vec<(String, usize)>,
    spread: Spread,
    checks: Vec<Check>,
    shares: crate::experiment::predict::Shares,
    fluid: Option<FluidOfHead>,
    states: usize,
    draws_solved: DrawsSolved,
    supports: Vec<SupportWeight>,
}

impl Lying {
    /// One head of what was found; supports without an equilibrium are left out, unless nothing is left.
    fn of(
        work: &Work<'_>,
        patient: &Patient<'_>,
        head: &Head,
        (bodies, forecasts): (&[Posed], Vec<Result<Forecast, ForecastError>>),
        produced: &mut Produced,
    ) -> Result<Self, WorkflowError> {
        let settings = &work.settings.predict;
        let nodes = patient.input.mesh.0.nodes_mm().len();
        let (mut found, mut refused): (Vec<(&Posed, Forecast)>, Vec<String>) = (Vec::new(), Vec::new());
        for (posed, forecast) in bodies.iter().zip(forecasts) {
            match forecast {
                Ok(forecast) => found.push((posed, forecast)),
                Err(error) => refused.push(error.to_string()),
            }
        }
        if found.is_empty() {
            return Err(PredictError::NoEquilibrium { reason: refused.join("; ") }.into());
        }
        let left_out = |reason| Warning::ModelLeftOut { model: head.to_string(), reason };
        produced.warn(refused.into_iter().map(left_out));
        let unbalanced = |(posed, forecast): &(&Posed, Forecast)| Warning::UnbalancedDraws {
            head: head.to_string(),
            supports: posed.supports.clone(),
            unbalanced: forecast.unbalanced,
            draws: forecast.draws_mm.len(),
        };
        produced.warn(found.iter().filter(|(_, forecast)| forecast.unbalanced > 0).map(unbalanced));
        let all: f64 = found.iter().map(|(posed, _)| posed.weight).sum();
        let every = (nodes / SHARED_NODES).max(1);
        let some: Vec<usize> = (0..nodes).step_by(every).collect();
        let thinned: Vec<_> = found
            .iter()
            .map(|(posed, f)| (posed.weight / all, f.response.thinned(&some), &posed.uncertainty))
            .collect();
        let models: Vec<_> =
            thinned.iter().map(|(weight, response, unknowns)| (*weight, response, *unknowns)).collect();
        let shares = variance_shares(&models);
        let states = found.iter().map(|(_, f)| f.states).sum();
        let draws_solved = DrawsSolved {
            solved: found.iter().map(|(_, f)| f.solved).sum(),
            of: found.iter().map(|(_, f)| f.draws_mm.len()).sum(),
        };
        let used = |(posed, _): &(&Posed, Forecast)| SupportWeight {
            supports: posed.supports.clone(),
            weight: posed.weight / all,
        };
        let supports = found.iter().map(used).collect();
        let (mut draws, mut named, mut told) = (Vec::new(), Vec::new(), Vec::new());
        for (posed, forecast) in found {
            let weight = posed.weight / all / forecast.draws_mm.len() as f64;
            named.extend((0..forecast.draws_mm.len()).map(|number| (posed.supports.clone(), number)));
            draws.extend(forecast.draws_mm.into_iter().map(|u| (weight, u)));
            told.extend(forecast.check);
        }
        let spread = spread(&draws, nodes, settings.threshold_mm);
        let fluid = fluid_of_head(settings, head, &patient.head.before, &patient.mni_from_pre)?;
        Ok(Self { draws, named, spread, checks: told, shares, fluid, states, draws_solved, supports })
    }

    /// The draws as they are kept.
    fn modes(&self, mesh: &TetMesh, threshold_mm: f64) -> Modes {
        let volume = |(_, u): &(f64, Vec<[f64; 3]>)| over_threshold_cc(mesh, u, threshold_mm);
        let volumes: Vec<f64> = self.draws.par_iter().map(volume).collect();
        let named: Vec<(String, usize, f64)> =
            self.named.iter().zip(volumes).map(|((supports, n), cc)| (supports.clone(), *n, cc)).collect();
        Modes::of(&self.draws, &self.spread.mean_mm, &named)
    }

    fn in_numbers(&self, patient: &Patient<'_>, head: &Head, state: &str) -> HeadPrediction {
        let mesh = patient.input.mesh.0;
        let pre_from_mni = patient.mni_from_pre.inverse();
        let sizes: Vec<f64> = self.spread.mean_mm.iter().map(|u| Vector3::from(*u).norm()).collect();
        let largest = (0..sizes.len()).max_by(|&a, &b| sizes[a].total_cmp(&sizes[b]).then(b.cmp(&a))).unwrap_or(0);
        let at = mesh.nodes_mm()[largest];
        let over = (0..mesh.tets().len()).map(|t| {
            let mean = mesh.tets()[t].iter().map(|&n| self.spread.over[n as usize]).sum::<f64>() / 4.0;
            mean * mesh.volume_mm3(t) / 1000.0
        });
        let down = pre_from_mni.rotation * Vector3::from(head.gravity_m_per_s2(&patient.mni_from_pre)).normalize();
        let median = |values: &[f64]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted[sorted.len() / 2]
        };
        HeadPrediction {
            head: head.to_string(),
            state: state.to_owned(),
            down: [down.x, down.y, down.z].map(rounded),
            largest_mm: rounded(sizes[largest]),
            largest_at_mm: <[f64; 3]>::from(pre_from_mni.apply(Position::new(at[0], at[1], at[2])).mm).map(rounded),
            median_mm: rounded(median(&sizes)),
            sd_median_mm: rounded(median(&self.spread.sd_mm)),
            reach95_largest_mm: rounded(self.spread.reach95_mm.iter().copied().fold(0.0, f64::max)),
            farthest_95_mm: Some(rounded(farthest(&self.draws, 0.95))),
            over_threshold_cc: rounded(over.sum()),
            shares: self.shares,
            fluid: self.fluid.clone(),
            states_solved: self.states,
            draws_solved: Some(self.draws_solved),
            supports: self.supports.clone(),
            targets: (0..patient.targets.len()).map(|n| self.target(patient, n)).collect(),
        }
    }

    fn target(&self, patient: &Patient<'_>, number: usize) -> TargetPrediction {
        let Target { name, at_mm, place, found } = &patient.targets[number];
        let mut told = TargetPrediction {
            target: number + 1,
            name: name.clone(),
            place: *place,
            at_mm: *at_mm,
            ..TargetPrediction::default()
        };
        if *place == TargetPlace::Removed {
            told.expected_mm = *at_mm;
            return told;
        }
        let turn = patient.mni_from_pre.inverse().rotation;
        let draws: Vec<(f64, [f64; 3])> =
            self.draws.iter().map(|(weight, u)| (*weight, (turn * Vector3::from(found.at(u))).into())).collect();
        let ellipsoid = ellipsoid_95(&draws);
        let threshold_mm = patient.settings.predict.threshold_mm;
        let over = draws.iter().filter(|(_, u)| Vector3::from(*u).norm() > threshold_mm).map(|(w, _)| w).sum::<f64>();
        told.expected_mm = [0, 1, 2].map(|a| rounded(at_mm[a] + ellipsoid.mean_mm[a]));
        told.shift_mm = rounded(Vector3::from(ellipsoid.mean_mm).norm());
        told.sd_mm = rounded(ellipsoid.sd_mm);
        told.half_axes_mm = ellipsoid.half_axes_mm.map(rounded);
        told.axes = ellipsoid.axes.map(|axis| axis.map(rounded));
        told.over_threshold = rounded(over.min(1.0));
        told
    }
}

/// Where the fluid stands with one head, in the scanner's frame, where that is known.
pub(crate) fn fluid_of_head(
    settings: &PredictSettings,
    head: &Head,
    labels: &LabelMap<Mni>,
    mni_from_pre: &RigidTransform<Pre, Mni>,
) -> Result<Option<FluidOfHead>, WorkflowError> {
    let found =
        settings.fluid_of_head(head, labels, head.gravity_m_per_s2(mni_from_pre)).map_err(PredictError::Level)?;
    let at = |top: Position<Mni>| <[f64; 3]>::from(mni_from_pre.inverse().apply(top).mm).map(rounded);
    Ok(found.map(|(fluid, top)| FluidOfHead { top_at_mm: at(top), ..fluid }))
}

/// Micrometres: more than any use needs.
fn rounded(x: f64) -> f64 {
    (x * 1e3).round() / 1e3 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::label;
    use crate::experiment::predict::KnownLevel;
    use crate::image::Grid;

    #[test]
    fn a_planned_body_has_the_weight_and_the_fluid_that_its_draws_are_around() {
        let grid = Grid::<Mni>::axis_aligned([10, 40, 10], [1.0; 3], [0.0; 3]);
        let label = |n: usize| if grid.voxel(n)[1] < 30 { label::GREY_MATTER } else { label::CSF };
        let labels = LabelMap::from_data(grid, (0..grid.len()).map(label).collect());
        let loads = |predict: PredictSettings| {
            let settings = Settings { predict, ..Settings::default() };
            planned_body(&settings, [0.0, -9.81, 0.0], Supports::Fixed, &labels).unwrap().1.loads
        };
        let plain = loads(PredictSettings::default());
        assert!(plain.csf.is_none() && plain.density_kg_per_m3 < 1000.0);
        let drained = loads(PredictSettings { drained: Some(0.3), ..PredictSettings::default() });
        assert!(drained.csf.is_some() && drained.density_kg_per_m3 > 1000.0);
        let level = |below_top_mm| {
            let fluid_level = Some(KnownLevel { below_top_mm, sd_mm: 0.0 });
            let loads = loads(PredictSettings { fluid_level, ..PredictSettings::default() });
            assert_eq!(loads.density_kg_per_m3, drained.density_kg_per_m3);
            loads.csf.unwrap().level_mm
        };
        assert!((level(5.0) - level(12.0) - 7.0).abs() < 1e-9);
    }

    #[test]
    fn what_a_plan_takes_of_the_targets_is_the_same_however_coarse_the_fields_are() {
        let folder = tempfile::tempdir().unwrap();
        // A cut of 3 mm through a block of 40.
        let grid = Grid::<Pre>::axis_aligned([40; 3], [1.0; 3], [0.0; 3]);
        let cut = Mask::from_fn(grid, |n| (22..25).contains(&grid.voxel(n)[0]));
        for (file, mask) in [(PRE_NATIVE_BRAIN, Mask::filled(grid, true)), (NATIVE_RESECTED, cut)] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, encode_mask(&mask)).unwrap();
        }
        for spacing_mm in [0.0, 2.0, 10.0] {
            let (around, planned) = surroundings(&Case::at(folder.path()), spacing_mm).unwrap();
            assert_eq!(around.resected.grid.spacing_mm()[0].round(), if spacing_mm > 0.0 { spacing_mm } else { 1.0 });
            let at = |x: f64, outside_mm| place_in(&planned, Position::new(x, 20.0, 20.0), outside_mm);
            let places = [21.0, 22.0, 24.4, 24.6].map(|x| at(x, 0.0));
            let (tissue, removed) = (TargetPlace::Tissue, TargetPlace::Removed);
            assert_eq!(places, [tissue, removed, removed, tissue], "{spacing_mm}");
            assert_eq!((at(23.0, 1.0), at(30.0, 1.0)), (removed, TargetPlace::Fluid), "{spacing_mm}");
        }
    }
}

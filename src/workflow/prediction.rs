//! The job before an operation: one scan and a plan to the expected brain shift.

use super::case::Case;
use super::error::{CaseError, PredictError, WorkflowError};
use super::facts::MeshFacts;
use super::outcome::{finish, keep_settings};
use super::plan::{Goal, plan};
use super::planned_scan::{PlanInputs, PlannedScan};
use super::progress::Progress;
use super::put_back::Before;
use super::refusal;
use super::settings::Settings;
use super::stage_name::{StageName, Subject};
use super::stages::{self, PlannedHead, PredictInput};
use super::targets::Targets;
use super::work::{Made, Place, Work};
use crate::artefact::{Manifest, sha256_hex};
use crate::experiment::outcome::{ExperimentKind, ExperimentOutcome};
use crate::experiment::predict::{PlanComparison, Prediction, PredictionEvaluation, twice};
use crate::experiment::resection::ResectionSettings;
use crate::layout::{EVALUATION_JSON, PLAN_CASE, PLANS_JSON, PLANS_PAGE, PREDICTION_JSON, REST_MESH};
use crate::mesh::format::vtu;
use crate::report::refusal::{as_scanned, posed};

/// How the brain of a pre-operative scan will move when the planned tissue is taken, with its spread. Registration of the
/// scan, labels and mesh are made as for a pair.
///
/// # Errors
/// [`WorkflowError`] of the first stage that cannot be done.
pub fn predict(
    inputs: &PlanInputs,
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<(Case, Prediction), WorkflowError> {
    if place.folder.join(PLANS_JSON).exists() || place.folder.join(PLAN_CASE.of("1")).is_dir() {
        return Err(PredictError::SeveralPlans { folder: place.folder.clone() }.into());
    }
    let work = Work::new(place, Subject::Plan, settings, progress);
    can_be_done(&work)?;
    inputs.check_apart_from(&work.case, &[&inputs.resection])?;
    let scan = PlannedScan::read(inputs, &work)?;
    let targets = targets_of(inputs)?;
    let found = predict_scan(&work, &scan, targets.as_ref())?;
    drop_other_comparison(&found.0)?;
    Ok(found)
}

/// Refuses what no prediction can be made with.
pub(super) fn can_be_done(work: &Work<'_>) -> Result<(), WorkflowError> {
    let settings = work.settings;
    settings.check()?;
    work.is_of_equilibria("a prediction")?;
    settings.predict.check_loads(&settings.resection).map_err(PredictError::Loads)?;
    settings.predict.check_taught(&settings.resection, &settings.prior).map_err(PredictError::Taught)?;
    if settings.predict.poisson_log_sd.is_some() && settings.resection.poisson_ratio == 0.0 {
        return Err(PredictError::RatioAtEnd.into());
    }
    let refused = |source| WorkflowError::Engine { labels: "the mesh".to_owned(), source };
    work.place.programs.engines().check(settings.mesh.engine).map_err(refused)?;
    let own = &settings.resection;
    let usual = ResectionSettings::default();
    if (own.gravity_m_per_s2, own.gravity_frame) != (usual.gravity_m_per_s2, usual.gravity_frame) {
        work.tell(|p| p.taken_for("gravity of [resection] is not used: how the head lies is `heads` of [predict]"));
    }
    Ok(())
}

/// The points that are asked for, where a file was given.
pub(super) fn targets_of(inputs: &PlanInputs) -> Result<Option<Targets>, WorkflowError> {
    inputs.targets.as_deref().map(Targets::read).transpose()
}

/// One plan in its folder; where it is refused the folder is of the settings that it had.
pub(super) fn predict_scan(
    work: &Work<'_>,
    scan: &PlannedScan,
    targets: Option<&Targets>,
) -> Result<(Case, Prediction), WorkflowError> {
    work.hold(true)?;
    check_scan(work, &scan.sum)?;
    let before = Before::of(&work.case);
    let (made, prediction, outcome) = every_stage(work, scan, targets).inspect_err(|error| {
        show_refused(work, scan, error);
        before.put_back(error);
    })?;
    let steps = plan(work.settings, Subject::Plan, Goal::Predict)?;
    let manifests: Vec<&Manifest> = steps.iter().filter_map(|step| made.get(&step.stage)).collect();
    let warnings = manifests.iter().flat_map(|m| m.warnings.iter().cloned()).collect();
    finish(work, &ExperimentOutcome { warnings, ..outcome }, &manifests)?;
    Ok((work.case.clone(), prediction))
}

/// A picture of a scan that no head was found in, beside the folder, which is left as it was.
fn show_refused(work: &Work<'_>, scan: &PlannedScan, error: &WorkflowError) {
    let (row, how) = match error {
        WorkflowError::Registration { .. } => (as_scanned(&scan.pre), "as it was given"),
        WorkflowError::Pair(_) => match stages::mni_from_pre(&work.case) {
            Ok(mni_from_pre) => (posed(&scan.pre, &mni_from_pre), "in the pose that was found"),
            Err(_) => return,
        },
        _ => return,
    };
    work.tell(|p| refusal::show(&[row], &work.place.folder, &format!("the scan {how}"), p));
}

/// Every stage of one plan, with its outcome but for the warnings.
fn every_stage(
    work: &Work<'_>,
    scan: &PlannedScan,
    targets: Option<&Targets>,
) -> Result<(Made, Prediction, ExperimentOutcome), WorkflowError> {
    let settings = work.settings;
    keep_settings(work)?;
    let mut made = Made::default();
    let posed = stages::pose(work, &mut made, scan)?;
    let heads = twice(&settings.predict.heads, &stages::mni_from_pre(&work.case)?);
    if let Some((first, second)) = heads {
        return Err(PredictError::OneHead { first, second }.into());
    }
    let planned = stages::plan(work, &mut made, scan, targets)?;
    let head = PlannedHead::read(&work.case)?;
    // A level that the brain has not is refused before anything is meshed for it.
    let mni_from_pre = stages::mni_from_pre(&work.case)?;
    for way in &settings.predict.heads {
        stages::fluid_of_head(&settings.predict, way, &head.before, &mni_from_pre)?;
    }
    let meshed: MeshFacts = stages::mesh(work, &mut made, &head.labels, Some(&head.template_from_patient), None)?;
    work.case.drop_stale();
    let bytes = work.case.read(REST_MESH)?;
    let mesh = vtu::decode(&bytes, REST_MESH)?.mesh;
    let input = PredictInput { mesh: (&mesh, &bytes, &meshed.mesh), plan: &planned.plan, targets };
    let prediction = stages::predict(work, &mut made, &input)?;
    drop_other_evaluation(&work.case)?;
    let outcome = ExperimentOutcome {
        kind: ExperimentKind::Prediction,
        reference: "nothing: the operation is still to come".to_owned(),
        volumes: Some(planned.volumes),
        scans: Some(planned.scans),
        registrations: vec![posed.fit],
        sets: meshed.sets,
        mesh: Some(meshed.mesh),
        held_shear_modulus_pa: prediction.held_shear_modulus_pa.clone(),
        ..ExperimentOutcome::default()
    };
    Ok((made, prediction, outcome))
}

/// Takes away what was found of an earlier prediction in this folder.
fn drop_other_evaluation(case: &Case) -> Result<(), WorkflowError> {
    let Ok(text) = case.read_text(EVALUATION_JSON) else { return Ok(()) };
    let sum = sha256_hex(&case.read(PREDICTION_JSON)?);
    let of_this = serde_json::from_str(&text).is_ok_and(|found: PredictionEvaluation| found.prediction_sha256 == sum);
    if !of_this {
        std::fs::remove_file(case.path(EVALUATION_JSON)).ok();
    }
    Ok(())
}

/// Takes away a comparison of plans beside this folder that names it, where that was made of another prediction than it holds now.
fn drop_other_comparison(case: &Case) -> Result<(), WorkflowError> {
    // `plan-1` and `.` have no folder around them by their words.
    let Ok(folder) = case.folder().canonicalize() else { return Ok(()) };
    let (Some(around), Some(name)) = (folder.parent(), folder.file_name().and_then(|name| name.to_str())) else {
        return Ok(());
    };
    let Ok(text) = std::fs::read_to_string(around.join(PLANS_JSON)) else { return Ok(()) };
    // What is no comparison of hgm's is somebody else's file; of an earlier version's the sum is empty.
    let Ok(comparison) = serde_json::from_str::<PlanComparison>(&text) else { return Ok(()) };
    let sum = sha256_hex(&case.read(PREDICTION_JSON)?);
    if comparison.plans.iter().any(|plan| plan.plan == name && plan.prediction_sha256 != sum) {
        for file in [PLANS_JSON, PLANS_PAGE] {
            std::fs::remove_file(around.join(file)).ok();
        }
    }
    Ok(())
}

/// Another scan is another patient's, unless it is meant.
fn check_scan(work: &Work<'_>, sum: &String) -> Result<(), WorkflowError> {
    let recorded = Manifest::of_stage(work.case.folder(), &StageName::Pose.to_string());
    if !work.place.force && recorded.is_some_and(|recorded| recorded.inputs.get("pre") != Some(sum)) {
        return Err(CaseError::OtherScan { folder: work.case.folder().to_path_buf(), which: "pre-operative" }.into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_evaluation_stays_with_its_prediction_and_goes_with_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let case = Case::at(folder.path());
        for file in [PREDICTION_JSON, EVALUATION_JSON, ".stages/pose.manifest.json"] {
            std::fs::create_dir_all(case.path(file).parent().unwrap()).unwrap();
            std::fs::write(case.path(file), "{}").unwrap();
        }
        let sum = sha256_hex(&case.read(PREDICTION_JSON).unwrap());
        let evaluation = PredictionEvaluation { prediction_sha256: sum, ..PredictionEvaluation::default() };
        std::fs::write(case.path(EVALUATION_JSON), serde_json::to_string(&evaluation).unwrap()).unwrap();
        drop_other_evaluation(&case).unwrap();
        assert!(case.path(EVALUATION_JSON).exists());
        std::fs::write(case.path(PREDICTION_JSON), "{ }").unwrap();
        drop_other_evaluation(&case).unwrap();
        assert!(!case.path(EVALUATION_JSON).exists());
    }

    #[test]
    fn a_comparison_goes_with_the_prediction_of_a_plan_that_it_was_made_of() {
        use crate::experiment::predict::PlanFigures;

        let folder = tempfile::tempdir().unwrap();
        let case = Case::at(&folder.path().join("plan-1"));
        for file in [PREDICTION_JSON, ".stages/pose.manifest.json"] {
            std::fs::create_dir_all(case.path(file).parent().unwrap()).unwrap();
            std::fs::write(case.path(file), "{}").unwrap();
        }
        let (json, page) = (folder.path().join(PLANS_JSON), folder.path().join(PLANS_PAGE));
        let compare = |plan: &str, sum: &str| {
            let figures =
                PlanFigures { plan: plan.to_owned(), prediction_sha256: sum.to_owned(), ..PlanFigures::default() };
            let comparison = PlanComparison { plans: vec![figures], ..PlanComparison::default() };
            std::fs::write(&json, serde_json::to_string(&comparison).unwrap()).unwrap();
            std::fs::write(&page, "page").unwrap();
            drop_other_comparison(&case).unwrap();
            assert_eq!(json.exists(), page.exists());
            json.exists()
        };
        // The same prediction again, and one that was made anew; a comparison of others, and one of an earlier version.
        let sum = sha256_hex(b"{}");
        assert!(compare("plan-1", &sum));
        assert!(!compare("plan-1", "another"));
        assert!(compare("plan-2", "another"));
        assert!(!compare("plan-1", ""));
        // A file of that name that is not hgm's.
        std::fs::write(&json, r#"{"plans": ["mine"]}"#).unwrap();
        drop_other_comparison(&case).unwrap();
        assert!(json.exists());
    }
}

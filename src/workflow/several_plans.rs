//! Several plans of one patient: a case for each, and which lets the brain move least.

use super::case::Case;
use super::error::{PredictError, WorkflowError};
use super::planned_resection::PlannedResection;
use super::planned_scan::{PlanInputs, PlannedScan};
use super::prediction::{can_be_done, predict_scan, targets_of};
use super::progress::Progress;
use super::settings::Settings;
use super::stage_name::Subject;
use super::stages::{Predicted, grid_of, mask_of, read_draws};
use super::warning::Warning;
use super::work::{Place, Work, facts};
use crate::artefact::{sha256_hex, write_whole};
use crate::experiment::predict::{LeftByAll, PlanComparison, PlanDraws, PlanFigures, Prediction, compared_plans};
use crate::geometry::Mni;
use crate::image::Mask;
use crate::layout::{PLAN_CASE, PLANS_JSON, PLANS_PAGE, PREDICTION_JSON, RESECTED};
use crate::report::page::plans::plans_page;
use std::path::Path;

/// As [`super::predict`] for several plans of one scan (`inputs` holds the first, `others` the rest): a case for each in the
/// folders `plan-1`, `plan-2` ... of the place, and their comparison beside them.
///
/// # Errors
/// [`WorkflowError`]; a plan that cannot be read leaves nothing behind.
pub fn predict_plans(
    inputs: &PlanInputs,
    others: &[PlannedResection],
    place: &Place,
    settings: &Settings,
    progress: &mut dyn Progress,
) -> Result<(Vec<Case>, PlanComparison), WorkflowError> {
    if Case::at(&place.folder).subject().is_some() {
        return Err(PredictError::OnePlan { folder: place.folder.clone() }.into());
    }
    let plans: Vec<&PlannedResection> = std::iter::once(&inputs.resection).chain(others).collect();
    if let Some(n) = (1..plans.len()).find(|&n| plans[..n].contains(&plans[n])) {
        return Err(PredictError::Twice { plan: plans[n].to_string() }.into());
    }
    let folder_of = |n: usize| place.folder.join(PLAN_CASE.of(&n.to_string()));
    (1..=plans.len()).try_for_each(|n| inputs.check_apart_from(&Case::at(&folder_of(n)), &plans))?;
    let targets = targets_of(inputs)?;
    let scans = {
        let work = Work::new(place, Subject::Plan, settings, progress);
        can_be_done(&work)?;
        let first = PlannedScan::read(inputs, &work)?;
        let rest = others.iter().map(|plan| first.with_plan(plan, inputs, &work)).collect::<Result<Vec<_>, _>>()?;
        std::iter::once(first).chain(rest).collect::<Vec<PlannedScan>>()
    };
    let mut done: Vec<(String, Case, Prediction)> = Vec::new();
    for (n, scan) in scans.iter().enumerate() {
        let name = PLAN_CASE.of(&(n + 1).to_string());
        let own = Place { folder: place.folder.join(&name), ..place.clone() };
        let work = Work::new(&own, Subject::Plan, settings, progress);
        work.tell(|p| p.noted(&format!("{name}: {}", scan.plan)));
        let (case, prediction) = predict_scan(&work, scan, targets.as_ref()).inspect_err(|_| {
            // Where nothing was in it before.
            std::fs::remove_dir(&place.folder).ok();
        })?;
        // A comparison of before says nothing of what is made now.
        for file in [PLANS_JSON, PLANS_PAGE] {
            std::fs::remove_file(place.folder.join(file)).ok();
        }
        done.push((name, case, prediction));
    }
    for plan in earlier_plans(&place.folder, plans.len()) {
        progress.odd(&plan, &Warning::EarlierPlan.to_string());
    }
    let comparison = compared(&plans, &done, settings.predict.threshold_mm)?;
    let json = format!("{:#}\n", facts(&comparison));
    write_whole(&place.folder.join(PLANS_JSON), json.as_bytes())?;
    write_whole(&place.folder.join(PLANS_PAGE), plans_page(&comparison).as_bytes())?;
    Ok((done.into_iter().map(|(_, case, _)| case).collect(), comparison))
}

/// Cases of plans beyond so many: an earlier run had more.
fn earlier_plans(folder: &Path, plans: usize) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let number = |name: String| PLAN_CASE.member(&name)?.parse::<usize>().ok();
    let is_case = |n: &usize| Case::at(&folder.join(PLAN_CASE.of(&n.to_string()))).subject() == Some(Subject::Plan);
    let mut beyond: Vec<usize> = names.filter_map(number).filter(|n| *n > plans).filter(is_case).collect();
    beyond.sort_unstable();
    beyond.iter().map(|n| PLAN_CASE.of(&n.to_string())).collect()
}

fn compared(
    plans: &[&PlannedResection],
    done: &[(String, Case, Prediction)],
    threshold_mm: f64,
) -> Result<PlanComparison, WorkflowError> {
    let mut figures = Vec::new();
    for (plan, (name, case, prediction)) in plans.iter().zip(done) {
        figures.push(PlanFigures {
            plan: name.clone(),
            given: plan.kind(),
            resected_cc: prediction.plan.resected_cc,
            refusals: refusals(case)?,
            prediction_sha256: sha256_hex(&case.read_made(PREDICTION_JSON)?),
        });
    }
    let mut comparison = PlanComparison { threshold_mm, plans: figures, ..PlanComparison::default() };
    let taken = done.iter().map(|(_, case, _)| taken_by(case)).collect::<Result<Vec<_>, _>>()?;
    let mut left: Option<LeftByAll> = None;
    let heads = done.first().map_or(0, |(_, _, prediction)| prediction.heads.len());
    for number in 0..heads {
        let read =
            |(_, case, prediction): &(String, Case, Prediction)| read_draws(case, &prediction.heads[number].state);
        let drawn = done.iter().map(read).collect::<Result<Vec<Predicted>, _>>()?;
        // A plan's mesh is the same however the head lies.
        let left =
            left.get_or_insert_with(|| LeftByAll::of(&drawn.iter().map(|d| &d.mesh).collect::<Vec<_>>(), &taken));
        let mut of_head = Vec::new();
        for (n, (drawn, (name, _, prediction))) in drawn.into_iter().zip(done).enumerate() {
            of_head.push(PlanDraws {
                plan: name.clone(),
                largest_mm: prediction.heads[number].largest_mm,
                of_all_cc: left.over_threshold_cc(n, &drawn.modes, threshold_mm),
                draws: drawn.modes.draws,
                refused: !comparison.plans[n].refusals.is_empty(),
            });
        }
        comparison.heads.push(compared_plans(&done[0].2.heads[number].head, &of_head));
    }
    comparison.left_by_all_cc = left.map_or(0.0, |left| (left.cc * 1e3).round() / 1e3);
    Ok(comparison)
}

/// What a plan takes, in the frame of its mesh.
fn taken_by(case: &Case) -> Result<Mask<Mni>, WorkflowError> {
    mask_of(case, RESECTED, &grid_of(case, RESECTED)?)
}

/// What a quality gate has against a case, a sentence each.
fn refusals(case: &Case) -> Result<Vec<String>, WorkflowError> {
    match case.quality_gate() {
        Ok(()) => Ok(Vec::new()),
        Err(WorkflowError::QualityGate(sentences)) => Ok(sentences),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::{Produced, Stage};
    use crate::workflow::stage_name::StageName;

    #[test]
    fn cases_of_plans_that_an_earlier_run_had_are_named_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["plan-1", "plan-2", "plan-3", "plan-11", "plan-x", "plans-4"] {
            let pose = Stage::new(&StageName::Pose.to_string(), 1, &folder.path().join(name), &());
            pose.run(false, || Ok::<_, WorkflowError>(Produced::default())).unwrap();
        }
        // A folder of the user's own.
        std::fs::create_dir(folder.path().join("plan-5")).unwrap();
        assert_eq!(earlier_plans(folder.path(), 2), ["plan-3", "plan-11"]);
        assert!(earlier_plans(folder.path(), 11).is_empty());
    }
}

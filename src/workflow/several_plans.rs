//! Several plans of one patient: a case for each, and which lets the brain move least.

use super::case::Case;
use super::error::{PredictError, WorkflowError};
use super::planned_resection::PlannedResection;
use super::planned_scan::{PlanInputs, PlannedScan};
use super::prediction::{can_be_done, predict_scan, targets_of};
use super::progress::Progress;
use super::settings::Settings;
use super::stage_name::Subject;
use super::stages::read_table;
use super::work::{Place, Work, facts};
use crate::artefact::write_whole;
use crate::experiment::predict::{PlanComparison, PlanDraws, PlanFigures, Prediction, compared_plans};
use crate::layout::{PLAN_CASE, PLANS_JSON, PLANS_PAGE};
use crate::report::page::plans::plans_page;

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
    let comparison = compared(&plans, &done, settings.predict.threshold_mm)?;
    let json = format!("{:#}\n", facts(&comparison));
    write_whole(&place.folder.join(PLANS_JSON), json.as_bytes())?;
    write_whole(&place.folder.join(PLANS_PAGE), plans_page(&comparison).as_bytes())?;
    Ok((done.into_iter().map(|(_, case, _)| case).collect(), comparison))
}

fn compared(
    plans: &[&PlannedResection],
    done: &[(String, Case, Prediction)],
    threshold_mm: f64,
) -> Result<PlanComparison, WorkflowError> {
    let figures = plans.iter().zip(done).map(|(plan, (name, _, prediction))| PlanFigures {
        plan: name.clone(),
        given: plan.kind(),
        resected_cc: prediction.plan.resected_cc,
    });
    let mut comparison = PlanComparison { threshold_mm, plans: figures.collect(), heads: Vec::new() };
    let heads = done.first().map_or(0, |(_, _, prediction)| prediction.heads.len());
    for number in 0..heads {
        let mut of_head = Vec::new();
        for (name, case, prediction) in done {
            let head = &prediction.heads[number];
            let draws = read_table(case, &head.state)?;
            of_head.push(PlanDraws { plan: name.clone(), largest_mm: head.largest_mm, draws });
        }
        comparison.heads.push(compared_plans(&done[0].2.heads[number].head, &of_head));
    }
    Ok(comparison)
}

//! After the stages: the numbers gathered, the settings, the provenance and the page.

use super::case::Case;
use super::error::WorkflowError;
use super::facts::EstimateFacts;
use super::fresh::{GATHERED, Provenance, StageRecord};
use super::work::Work;
use crate::artefact::{Manifest, sha256_hex, write_whole};
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::verdict::{Claim, Finding, Verdict};
use crate::layout;
use crate::report::case::report_files;

/// Writes outcome, samples table, settings and provenance, then the page.
pub(crate) fn finish(
    work: &Work<'_>,
    outcome: &ExperimentOutcome,
    manifests: &[&Manifest],
) -> Result<(), WorkflowError> {
    let outcome = &outcome.clone().with_verdict();
    write_whole(&work.case.path(layout::OUTCOME), outcome.to_json(layout::OUTCOME)?.as_bytes())?;
    write_whole(&work.case.path(layout::SAMPLES_TABLE), samples_table(outcome).as_bytes())?;
    keep_settings(work)?;
    if outcome.answer.is_none() {
        // Of an earlier state of the folder.
        std::fs::remove_file(work.case.path(layout::REFUSED_PICTURE)).ok();
    }
    write_whole(&work.case.path(layout::PROVENANCE), provenance(&work.case, manifests)?.as_bytes())?;
    write_page(&work.case)
}

/// The page with the files for other viewers; those of an earlier page that this one has not are taken away.
pub(crate) fn write_page(case: &Case) -> Result<(), WorkflowError> {
    let files = report_files(case.folder())?;
    for family in [layout::BEST_SURFACE, layout::BEST_ERRORS] {
        for entry in std::fs::read_dir(case.path(family.folder())).into_iter().flatten().flatten() {
            let name = format!("{}/{}", family.folder(), entry.file_name().to_string_lossy());
            if family.member(&name).is_some() && !files.iter().any(|(file, _)| *file == name) {
                std::fs::remove_file(entry.path()).ok();
            }
        }
    }
    if !files.iter().any(|(file, _)| file == layout::SAMPLES_SERIES) {
        std::fs::remove_file(case.path(layout::SAMPLES_SERIES)).ok();
    }
    for (file, bytes) in files {
        write_whole(&case.path(&file), &bytes)?;
    }
    Ok(())
}

/// `settings.toml`: every setting, whole.
pub(crate) fn keep_settings(work: &Work<'_>) -> Result<(), WorkflowError> {
    work.remember();
    Ok(write_whole(&work.case.path(layout::SETTINGS), work.settings.to_toml().as_bytes())?)
}

/// `provenance.json`: program, stages, checksums of inputs and outputs, and of what was gathered from them.
fn provenance(case: &Case, manifests: &[&Manifest]) -> Result<String, WorkflowError> {
    let sum = |file: &str| Ok((file.to_owned(), sha256_hex(&case.read(file)?)));
    let provenance = Provenance {
        program: concat!("hgm ", env!("CARGO_PKG_VERSION")).to_owned(),
        gathered: GATHERED.into_iter().map(sum).collect::<Result<_, WorkflowError>>()?,
        stages: manifests.iter().map(|manifest| StageRecord::of(manifest)).collect(),
    };
    Ok(format!("{:#}", super::work::facts(&provenance)))
}

/// `sim/samples.csv`: a line per sample.
fn samples_table(outcome: &ExperimentOutcome) -> String {
    let sets = outcome.rmse_sets();
    let mut head = vec!["sample".to_owned()];
    head.extend(outcome.tissues.iter().flat_map(|t| [format!("{t}_sd_level"), format!("{t}_shear_modulus_pa")]));
    head.extend(sets.iter().map(|set| format!("rmse_{set}_mm")));
    head.extend(sets.iter().map(|set| format!("surface_distance_{set}_mm")));
    head.extend(["converged", "newton_iterations", "displacement_max_mm"].map(str::to_owned));
    let mut lines = vec![head.join(",")];
    let cell = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
    for sample in &outcome.samples {
        let mut line = vec![sample.id.clone()];
        for tissue in &outcome.tissues {
            line.push(cell(sample.sd_levels.get(tissue).copied()));
            line.push(cell(sample.shear_modulus_pa.get(tissue).copied()));
        }
        line.extend(sets.iter().map(|set| cell(sample.rmse_mm.get(set).copied())));
        line.extend(sets.iter().map(|set| cell(sample.surface_distance_mm.get(set).copied())));
        line.extend([sample.converged.to_string(), sample.newton_iterations.to_string()]);
        line.push(cell(sample.displacement_max_mm));
        lines.push(line.join(","));
    }
    lines.join("\n") + "\n"
}

/// What the bodies that a verdict is about were loaded and held by.
fn loads_of(facts: &EstimateFacts) -> Option<String> {
    let Verdict { finding, moduli, .. } = &facts.estimate.verdict;
    let bounded = moduli.iter().any(|(_, claim)| matches!(claim, Claim::Above { .. }));
    let said = facts.loads.join("; or ");
    match (facts.loads.len(), finding) {
        (0, _) => None,
        (2.., Finding::CannotTell) => Some(format!("{said} (the moduli are averages over these)")),
        (2.., Finding::NoShift) if bounded => Some(format!("{said} (the bounds hold for each of these)")),
        _ => Some(said),
    }
}

/// The outcome with the estimate as one more sample, its moduli as far as they are claimed, and the loads of its own bodies; it is
/// the best one where no sweep has chosen another.
pub(crate) fn with_estimate(outcome: &mut ExperimentOutcome, facts: &EstimateFacts) {
    let name = &facts.record.id;
    outcome.samples.retain(|s| s.id != *name);
    if let Some(own) = loads_of(facts).filter(|own| outcome.loads != [own.as_str()]) {
        let of_samples = outcome.loads.iter().filter(|_| !outcome.samples.is_empty());
        outcome.loads = match of_samples.map(|said| format!("for the samples {said}")).collect::<Vec<_>>() {
            none if none.is_empty() => vec![own],
            said => said.into_iter().chain([format!("for the estimate {own}")]).collect(),
        };
    }
    if outcome.samples.is_empty() {
        outcome.tissues = facts.record.shear_modulus_pa.keys().cloned().collect();
    }
    let claimed = |of: &String| {
        let claim = facts.estimate.verdict.moduli.iter().find(|(tissue, _)| tissue == of);
        matches!(claim, Some((_, Claim::Interval { .. } | Claim::Range { .. })))
    };
    let mut record = facts.record.clone();
    record.shear_modulus_pa.retain(|tissue, _| claimed(tissue));
    // Samples are drawn from the prior of an average person, an estimate from nothing: its level would be of another prior.
    record.sd_levels.clear();
    if facts.estimate.verdict.finding == Finding::NoShift {
        // Its state is rest, which no law has led to.
        record.laws.clear();
    }
    outcome.samples.push(record);
    if outcome.best_sample.is_none() {
        outcome.best_sample = Some(name.clone());
    }
    outcome.estimate = Some(facts.estimate.clone());
    outcome.comparison.clone_from(&facts.comparison);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::{LawOutcome, SampleOutcome};
    use serde_json::json;

    /// An estimate of two tissues that claims a modulus of the first alone.
    fn half_claimed() -> EstimateFacts {
        let estimate = json!({
            "posterior": {
                "names": ["grey", "white"], "mode": [975.0, 717.0], "log_sd": [0.1, 9.0],
                "interval_95": [[774.0, 1230.0], [0.1, 1e7]], "log_covariance": [[0.01, 0.0], [0.0, 81.0]],
                "identifiability": {
                    "verdicts": ["identified", "withheld"], "sensitivity_correlation": [[1.0, 0.0], [0.0, 1.0]],
                    "condition": 1.0, "valley": [1.0, 0.0], "valley_log_sd": 0.1
                }
            },
            "prior": [], "observations": 12, "independent_observations": 12.0, "noise_mm": 0.3, "residual_rms_mm": 0.4,
            "convergence": "step-below-tolerance", "solves": 9, "tangent_solves": 18, "limits": ["told once"],
            "verdict": {
                "finding": "identified", "explained_share": 0.9, "reasons": [], "sentence": "",
                "moduli": [
                    ["grey_matter", {"kind": "interval", "mode_pa": 975.0, "interval_95_pa": [774.0, 1230.0]}],
                    ["white_matter", {"kind": "withheld"}]
                ]
            }
        });
        let of_both = |grey: f64, white: f64| [("grey_matter".to_owned(), grey), ("white_matter".to_owned(), white)];
        let record = SampleOutcome {
            id: "estimate".to_owned(),
            shear_modulus_pa: of_both(975.0, 717.0).into(),
            sd_levels: of_both(-0.3, -0.2).into(),
            laws: [("grey_matter".to_owned(), LawOutcome::default())].into(),
            converged: true,
            ..SampleOutcome::default()
        };
        EstimateFacts {
            estimate: serde_json::from_value(estimate).unwrap(),
            record,
            comparison: None,
            loads: Vec::new(),
        }
    }

    #[test]
    fn samples_show_of_an_estimate_what_it_claims() {
        let mut outcome = ExperimentOutcome::default();
        with_estimate(&mut outcome, &half_claimed());
        assert_eq!(outcome.samples[0].shear_modulus_pa, [("grey_matter".to_owned(), 975.0)].into());
        let table = samples_table(&outcome);
        assert!(table.ends_with("\nestimate,,975,,,true,0,\n"), "{table}");
        // The stage's own warnings say them.
        assert_eq!(outcome.warnings, [""; 0]);
        assert_eq!(outcome.samples[0].laws.len(), 1);
    }

    #[test]
    fn what_has_not_moved_was_led_there_by_no_law() {
        let mut facts = half_claimed();
        facts.estimate.verdict.finding = Finding::NoShift;
        let mut outcome = ExperimentOutcome::default();
        with_estimate(&mut outcome, &facts);
        assert!(outcome.samples[0].laws.is_empty());
    }

    #[test]
    fn an_estimates_loads_are_those_of_the_bodies_it_is_about_and_samples_keep_theirs() {
        let of = |finding, samples: usize, loads: &[&str]| {
            let mut facts = half_claimed();
            facts.estimate.verdict.finding = finding;
            facts.loads = loads.iter().map(|said| (*said).to_owned()).collect();
            let samples = vec![SampleOutcome { id: "sample-00".to_owned(), ..SampleOutcome::default() }; samples];
            let mut outcome =
                ExperimentOutcome { samples, loads: vec!["a".to_owned()], ..ExperimentOutcome::default() };
            with_estimate(&mut outcome, &facts);
            outcome.loads
        };
        assert_eq!(of(Finding::Identified, 0, &["b"]), ["b"]);
        assert_eq!(of(Finding::CannotTell, 0, &["b", "a"]), ["b; or a (the moduli are averages over these)"]);
        assert_eq!(of(Finding::NoShift, 0, &["b", "a"]), ["b; or a"], "no bound, of which to say for what it holds");
        assert_eq!(of(Finding::Identified, 1, &["b"]), ["for the samples a", "for the estimate b"]);
        assert_eq!(of(Finding::Identified, 1, &["a"]), ["a"]);
        // A phantom's, and what earlier versions have kept.
        assert_eq!(of(Finding::Identified, 1, &[]), ["a"]);
    }
}

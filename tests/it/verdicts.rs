//! One verdict: eight ways a case can end, each read on the page, on the terminal, in the JSON and in the group's table and page.

use hgm::cli::Failure;
use hgm::experiment::estimate::Average;
use hgm::experiment::outcome::{Answer, ExperimentKind, ExperimentOutcome, NoiseFloor, SampleOutcome};
use hgm::experiment::verdict::Finding;
use hgm::report::cohort::{Cohort, Member, Status};
use hgm::report::in_words::summary;
use hgm::report::page::{CasePage, title_of};
use hgm::resect::{PairError, ResectError};
use hgm::workflow::WorkflowError;
use serde_json::json;
use std::collections::BTreeMap;

/// Samples of these moduli (Pa) and errors at the margin (mm); one without an error has no equilibrium.
fn swept(rest_mm: f64, samples: &[(f64, Option<f64>)]) -> ExperimentOutcome {
    let sample = |(n, (modulus, rmse)): (usize, &(f64, Option<f64>))| SampleOutcome {
        id: format!("sample-{n:02}"),
        shear_modulus_pa: BTreeMap::from([("brain".to_owned(), *modulus)]),
        rmse_mm: rmse.iter().map(|mm| ("margin".to_owned(), *mm)).collect(),
        converged: rmse.is_some(),
        ..SampleOutcome::default()
    };
    let samples: Vec<SampleOutcome> = samples.iter().enumerate().map(sample).collect();
    let converged = samples.iter().filter(|s| s.converged);
    let best = converged.min_by(|a, b| a.rmse_mm["margin"].total_cmp(&b.rmse_mm["margin"])).map(|s| s.id.clone());
    ExperimentOutcome {
        reference: "the surfaces of the post-operative scan".to_owned(),
        tissues: vec!["brain".to_owned()],
        samples,
        best_sample: best,
        rest_rmse_mm: BTreeMap::from([("margin".to_owned(), rest_mm)]),
        noise_floor: Some(NoiseFloor { at_rest_mm: Some(0.4), ..NoiseFloor::default() }),
        ..ExperimentOutcome::default()
    }
}

/// A phantom of 500 Pa, its errors over all nodes.
fn phantom() -> ExperimentOutcome {
    let mut outcome = swept(5.0, &[(300.0, Some(1.9)), (520.0, Some(0.2)), (900.0, Some(2.3))]);
    outcome.kind = ExperimentKind::Phantom;
    outcome.noise_floor = None;
    outcome.reference_shear_modulus_pa = BTreeMap::from([("brain".to_owned(), 500.0)]);
    for rmse in outcome.samples.iter_mut().map(|s| &mut s.rmse_mm).chain([&mut outcome.rest_rmse_mm]) {
        *rmse = rmse.values().map(|mm| ("all".to_owned(), *mm)).collect();
    }
    outcome
}

/// An estimate ten times stiffer than anything that is known, as its file would hold it.
fn in_conflict() -> ExperimentOutcome {
    let name = "shear_modulus_pa of brain";
    let verdict = json!({
        "finding": "conflict", "explained_share": 0.9, "moduli": [["brain", {"kind": "withheld"}]],
        "reasons": [{"kind": "far-from-prior", "name": name, "sd": 4.6}],
        "sentence": "Conflict: the shift contradicts what is known: the shear modulus of brain comes out 4.6 standard deviations \
                     from what is known of it. The load or the supports are not as assumed; no stiffness is claimed.",
    });
    let estimate = json!({
        "posterior": {
            "names": [name], "mode": [41526.2], "log_sd": [0.2], "interval_95": [[28000.4, 61500.7]], "log_covariance": [[0.04]],
            "identifiability": {
                "verdicts": ["withheld"], "sensitivity_correlation": [[1.0]], "condition": 1.0, "valley": [1.0],
                "valley_log_sd": 0.2
            }
        },
        "prior": [{"name": name, "mean": 6.5, "sd": 0.4}],
        "observations": 1200, "independent_observations": 12.1, "noise_mm": 0.3, "residual_rms_mm": 0.41,
        "convergence": "step-below-tolerance", "solves": 9, "tangent_solves": 18, "limits": [], "verdict": verdict,
    });
    let mut outcome = swept(3.0, &[(41526.2, Some(1.1))]);
    "estimate".clone_into(&mut outcome.samples[0].id);
    outcome.best_sample = Some("estimate".to_owned());
    outcome.estimate = Some(serde_json::from_value(estimate).unwrap());
    outcome
}

fn eight() -> Vec<(&'static str, ExperimentOutcome, Finding)> {
    let spread = [(300.0, Some(1.2)), (500.0, Some(1.0)), (900.0, Some(1.3)), (2000.0, Some(2.4))];
    let none = ExperimentOutcome { answer: Some(Answer::NoOperation), ..ExperimentOutcome::default() };
    vec![
        ("better", swept(3.0, &spread), Finding::Better),
        ("not distinguishable", swept(1.2, &spread), Finding::NotDistinguishable),
        ("worse", swept(0.5, &spread), Finding::Worse),
        ("no cavity", none, Finding::NoOperation),
        ("prepared only", ExperimentOutcome::default(), Finding::Nothing),
        ("phantom", phantom(), Finding::Recovered),
        ("in conflict", in_conflict(), Finding::Conflict),
        ("without equilibrium", swept(3.0, &[(300.0, None), (500.0, None)]), Finding::NoEquilibrium),
    ]
}

/// What the terminal says: of scans that gave an answer it is the message the job ends with.
fn on_terminal(outcome: &ExperimentOutcome) -> String {
    if outcome.answer.is_none() {
        return summary(outcome);
    }
    let none = ResectError::NoOperation { largest_cc: 0.2, smallest_cc: 1.0, doubt: None, unseen_percent: 0.0 };
    Failure::from(WorkflowError::Pair(PairError::from(none))).parts().1.to_string()
}

fn page(outcome: &ExperimentOutcome) -> String {
    let outcome = outcome.clone();
    CasePage {
        subject: "sub-01".to_owned(),
        title: title_of(Some(&outcome)).to_owned(),
        outcome: Some(outcome),
        ..CasePage::default()
    }
    .to_html()
}

#[test]
fn page_terminal_json_and_group_say_the_same_verdict_of_eight_outcomes() {
    let mut members = Vec::new();
    for (name, outcome, finding) in eight() {
        let outcome = outcome.with_verdict();
        let (verdict, said) = (&outcome.verdict, outcome.verdict.sentence.clone());
        assert_eq!(verdict.finding, finding, "{name}: {said}");
        let page = page(&outcome);
        // In front of all else, and in the text for a paper.
        assert_eq!(page.matches(&format!(">{said}<")).count(), 1, "{name}: the page's first sentence is not: {said}");
        let methods = page.split("id=\"methods-text\"").nth(1).unwrap().split("</blockquote>").next().unwrap();
        assert!(methods.contains(&said), "{name}: the methods say: {methods}");
        let terminal = on_terminal(&outcome);
        assert!(terminal.starts_with(&said), "{name}: the terminal says: {terminal}");
        let json: serde_json::Value = serde_json::from_str(&outcome.to_json("outcome.json").unwrap()).unwrap();
        assert_eq!(json["verdict"]["sentence"], said, "{name}");
        assert_eq!(json["verdict"]["finding"], json!(finding), "{name}");
        // No other verdict anywhere: neither its sentence nor, where nothing is claimed, a modulus above all sections.
        for (other, elsewhere, _) in eight() {
            let sentence = elsewhere.with_verdict().verdict.sentence;
            assert!(
                sentence == said || !page.contains(&sentence) && !terminal.contains(&sentence),
                "{name} says {other}"
            );
        }
        let first = page.split("id=\"glance\"").nth(1).unwrap().split("<section").next().unwrap();
        let shown = first.contains("> Pa<");
        assert_eq!(shown, finding.has_stiffness(), "{name}: {first}");
        members.push(Member {
            participant_id: format!("sub-{:02}", members.len()),
            status: if outcome.answer.is_some() { Status::NoOperation } else { Status::Done },
            message: None,
            has_page: true,
            outcome: Some(outcome),
            settings_sha256: None,
        });
    }
    let cohort = Cohort::new(&members);
    let (group, table, document) = (cohort.to_html(), cohort.to_tsv(), serde_json::to_value(&cohort).unwrap());
    let column = table.lines().next().unwrap().split('\t').position(|name| name == "verdict").unwrap();
    for member in &members {
        let (name, verdict) = (&member.participant_id, &member.outcome.as_ref().unwrap().verdict);
        let line = table.lines().find(|line| line.starts_with(name)).unwrap();
        assert_eq!(line.split('\t').nth(column), Some(verdict.finding.short()), "{name}");
        let row = group.split(&format!("data-subject=\"{name}\"")).nth(1).unwrap().split("</tr>").next().unwrap();
        assert!(
            row.contains(&format!(">{}<", verdict.finding.short())) && row.contains(&verdict.sentence),
            "{name}: {row}"
        );
        let rows = document["subjects"].as_array().unwrap();
        let row = rows.iter().find(|row| row["participant_id"] == **name).unwrap();
        assert_eq!((&row["verdict"], &row["sentence"]), (&json!(verdict.finding.short()), &json!(verdict.sentence)));
    }
}

#[test]
fn the_methods_tell_only_what_was_done() {
    let methods = |outcome: ExperimentOutcome| {
        let page = page(&outcome.with_verdict());
        page.split("id=\"methods-text\"").nth(1).unwrap().split("</blockquote>").next().unwrap().to_owned()
    };
    for (name, outcome, finding) in eight() {
        let text = methods(outcome);
        let (swept, estimated) = (text.contains("were sampled at"), text.contains("were estimated by least squares"));
        let expected = match finding {
            Finding::NoOperation | Finding::Nothing => (false, false),
            Finding::Conflict => (false, true),
            _ => (true, false),
        };
        assert_eq!((swept, estimated), expected, "{name}: {text}");
        assert_eq!(text.contains("known shear moduli"), finding == Finding::Recovered, "{name}: {text}");
        // No sentence that ends before it has said anything ("Compared with: .").
        assert!(!text.contains(": .") && !text.contains("with  "), "{name}: {text}");
    }
}

#[test]
fn the_methods_name_the_model_that_an_estimate_started_from() {
    let mut outcome = in_conflict();
    let methods = |outcome: &ExperimentOutcome| page(outcome).contains("study-level model");
    assert!(!methods(&outcome));
    outcome.estimate.as_mut().unwrap().prior[0].average = Some(Average { mean: 6.5, sd: 0.4 });
    assert!(methods(&outcome));
}

//! Commands for another program in the same process, and how one that does not end well is told.

use anyhow::{Context, anyhow};
use hgm::cli::{Called, Failure, call};
use hgm::resect::{PairError, ResectError};
use hgm::workflow::{Silent, WorkflowError};
use std::ffi::OsString;
use std::sync::{Arc, Mutex};

fn called(words: &[&str]) -> Called {
    let words: Vec<OsString> = words.iter().map(OsString::from).collect();
    call(&words, None, Arc::new(Mutex::new(Silent)))
}

#[test]
fn a_called_command_returns_what_it_would_print_and_says_what_it_would_say() {
    let layout = called(&["layout"]);
    assert!(layout.ended.is_ok());
    let told: serde_json::Value = serde_json::from_str(&layout.result.unwrap()).unwrap();
    assert!(told["files"].as_array().unwrap().len() > 50);

    let none = called(&["report", "no-such-folder"]);
    let failure = none.ended.unwrap_err();
    assert_eq!((failure.code(), none.result), (3, None));
    assert!(failure.message().contains("no-such-folder"), "{}", failure.message());

    let usage = called(&["simulate", "mesh.vtu"]).ended.unwrap_err();
    assert_eq!(usage.code(), 3);
    assert!(usage.message().contains("<SCENARIO>"), "{}", usage.message());
}

#[test]
fn no_operation_and_two_people_are_answers_with_a_name_and_exit_code_4() {
    let pair = |error: PairError| Failure::from(WorkflowError::Pair(error));
    let none = ResectError::NoOperation { largest_cc: 0.2, smallest_cc: 1.0, doubt: None, unseen_percent: 0.0 };
    for (failure, name) in
        [(pair(PairError::NotOnePerson { folds: 0.4 }), "not-one-person"), (pair(none.into()), "no-operation")]
    {
        assert_eq!((failure.code(), failure.answer()), (4, Some(name)));
    }
}

#[test]
fn a_cause_is_said_once() {
    let error = Err::<(), _>(anyhow!("no space left")).context("x.bin: cannot be written (no space left)");
    let failure = Failure::Failed(error.context("report").unwrap_err());
    assert_eq!(failure.message(), "report: x.bin: cannot be written (no space left)");
}

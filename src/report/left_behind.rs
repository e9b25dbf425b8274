//! What another job has left in a case folder: files of stages that the outcome was made without.

use crate::artefact::Manifest;
use crate::layout;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;

/// What is read of `provenance.json`: the stages that the outcome was made from.
#[derive(Deserialize)]
struct MadeFrom {
    stages: Vec<MadeStage>,
}

#[derive(Deserialize)]
struct MadeStage {
    stage: String,
    key: String,
}

/// Files below a case folder that are no part of what its outcome was made from: those of a stage that it was made without, and those
/// that a stage has made anew since. None where there is no outcome yet: then nothing can be of another one.
pub(super) fn left_behind(folder: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(folder.join(layout::PROVENANCE)).ok();
    let Some(from) = text.and_then(|text| serde_json::from_str::<MadeFrom>(&text).ok()) else {
        return BTreeSet::new();
    };
    let made_with =
        |manifest: &Manifest| from.stages.iter().any(|made| made.stage == manifest.stage && made.key == manifest.key);
    let (own, others): (Vec<Manifest>, Vec<Manifest>) = Manifest::all_of(folder).into_iter().partition(made_with);
    let is_own = |file: &String| own.iter().any(|manifest| manifest.outputs.contains_key(file));
    others.into_iter().flat_map(|manifest| manifest.outputs.into_keys()).filter(|file| !is_own(file)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::artefact::{Produced, Stage, write_whole};
    use serde_json::json;
    use std::convert::Infallible;

    #[test]
    fn what_the_outcome_was_made_without_or_of_another_state_of_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let run = |stage: &str, file: &str, settings: i32| {
            let files = vec![(file.to_owned(), b"x".to_vec())];
            let made = || Ok::<_, Infallible>(Produced { files, ..Produced::default() });
            Stage::new(stage, 1, folder.path(), &settings).run(false, made).unwrap();
            Manifest::of_stage(folder.path(), stage).unwrap()
        };
        let sample = layout::SAMPLE_STATE.of("sample-00");
        let of_outcome = [run("mesh", layout::REST_MESH, 1), run("sim-sample-00", &sample, 1)];
        run("estimate", layout::ESTIMATE_JSON, 1);
        assert!(left_behind(folder.path()).is_empty(), "no job has come to an outcome");
        let stages = of_outcome.map(|made| json!({ "stage": made.stage, "key": made.key }));
        let provenance = json!({ "program": "hgm", "stages": stages });
        write_whole(&folder.path().join(layout::PROVENANCE), provenance.to_string().as_bytes()).unwrap();
        assert_eq!(left_behind(folder.path()), BTreeSet::from([layout::ESTIMATE_JSON.to_owned()]));
        run("sim-sample-00", &sample, 2);
        assert_eq!(left_behind(folder.path()), BTreeSet::from([layout::ESTIMATE_JSON.to_owned(), sample]));
    }
}

//! No stale answer: what is in a folder is checked against the stages it was made from, and what an earlier state has left
//! behind is taken away.

use super::case::Case;
use super::error::{CaseError, WorkflowError};
use super::facts::EstimateFacts;
use super::stage_name::{StageName, Subject};
use crate::artefact::{Manifest, Reason, sha256_hex};
use crate::layout;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// `provenance.json`: what outcome and page were made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Provenance {
    /// `hgm x.y.z`.
    pub program: String,
    /// SHA-256 of the outcome and of the settings it was gathered with.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub gathered: BTreeMap<String, String>,
    /// The stages.
    pub stages: Vec<StageRecord>,
}

/// A stage as it was when the outcome was gathered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StageRecord {
    stage: String,
    key: String,
    inputs: BTreeMap<String, String>,
    outputs: serde_json::Value,
}

impl StageRecord {
    /// What is kept of a manifest.
    pub fn of(manifest: &Manifest) -> Self {
        Self {
            stage: manifest.stage.clone(),
            key: manifest.key.clone(),
            inputs: manifest.inputs.clone(),
            outputs: super::work::facts(&manifest.outputs),
        }
    }
}

/// Files whose checksum stands beside the stages.
pub(crate) const GATHERED: [&str; 2] = [layout::OUTCOME, layout::SETTINGS];

impl Case {
    /// Refuses an outcome that is not of what is in the folder now.
    ///
    /// # Errors
    /// [`CaseError::Stale`] with what has changed since it was gathered.
    pub fn check_outcome(&self) -> Result<(), WorkflowError> {
        self.present_provenance().map(|_| ())
    }

    /// What the outcome was made from, where that is what is in the folder now.
    fn present_provenance(&self) -> Result<Provenance, WorkflowError> {
        let stale = |reason: Reason| Err(self.stale(layout::OUTCOME, reason));
        let damaged = |_| CaseError::Damaged {
            folder: self.folder().to_path_buf(),
            file: layout::PROVENANCE.to_owned(),
            subject: self.subject(),
        };
        let text = self.read_text(layout::PROVENANCE)?;
        let provenance: Provenance = serde_json::from_str(&text).map_err(damaged)?;
        for (file, sum) in &provenance.gathered {
            if sha256_hex(&self.read(file)?) != *sum {
                return stale(Reason::OutputChanged { file: file.clone() });
            }
        }
        for record in &provenance.stages {
            match Manifest::of_stage(self.folder(), &record.stage) {
                None => return stale(Reason::Input { role: format!("stage {}", record.stage) }),
                Some(now) if StageRecord::of(&now) != *record => {
                    return stale(Reason::Input { role: format!("stage {}", record.stage) });
                }
                Some(_) => {}
            }
        }
        Ok(provenance)
    }

    fn stale(&self, what: &str, reason: Reason) -> WorkflowError {
        CaseError::Stale { folder: self.folder().to_path_buf(), what: what.to_owned(), reasons: vec![reason] }.into()
    }

    /// Refuses a file of a stage that the outcome was made without: another job has left it in the folder.
    ///
    /// # Errors
    /// As [`Case::check_outcome`]; [`CaseError::Stale`] of such a file.
    pub(crate) fn check_made_with(&self, file: &str) -> Result<(), WorkflowError> {
        match self.made_with(file)? {
            Some(false) => Err(self.left_behind(file)),
            Some(true) | None => Ok(()),
        }
    }

    /// Whether the outcome was made with the stage that made a file; `None` of a file that no stage has made.
    fn made_with(&self, file: &str) -> Result<Option<bool>, WorkflowError> {
        let provenance = self.present_provenance()?;
        let mut makers = self.recorded();
        makers.retain(|manifest| manifest.outputs.contains_key(file));
        let with = |maker: &Manifest| provenance.stages.iter().any(|record| record.stage == maker.stage);
        Ok((!makers.is_empty()).then(|| makers.iter().any(with)))
    }

    fn left_behind(&self, file: &str) -> WorkflowError {
        self.stale(file, Reason::Input { role: layout::OUTCOME.to_owned() })
    }

    /// Refuses a state that the outcome was made without, and a name that is no state's.
    ///
    /// # Errors
    /// As [`Case::outcome`]; [`CaseError::Stale`] of a state that another job has left in the folder;
    /// [`CaseError::NoState`] where there is none of this name.
    pub(crate) fn check_state(&self, state: &str) -> Result<(), WorkflowError> {
        let outcome = self.outcome()?;
        let file = layout::SAMPLE_STATE.of(state);
        let told = outcome.samples.iter().filter(|sample| sample.file.is_some()).map(|sample| &sample.id);
        if told.clone().any(|id| id == state) {
            return Ok(());
        }
        if !self.path(&file).exists() || state.contains(['/', '\\']) {
            let made = self.recorded().into_iter().flat_map(|stage| stage.outputs.into_keys());
            let present = |file: &String| matches!(self.made_with(file), Ok(Some(true)));
            let made = made.filter(present).filter_map(|file| layout::SAMPLE_STATE.member(&file).map(str::to_owned));
            let states: BTreeSet<String> = made.chain(told.cloned()).collect();
            let (folder, state) = (self.folder().to_path_buf(), state.to_owned());
            return Err(CaseError::NoState { folder, state, states: states.into_iter().collect() }.into());
        }
        // A phantom's reference and a prediction's states are no samples: they are known by their stage.
        if self.made_with(&file)? == Some(true) { Ok(()) } else { Err(self.left_behind(&file)) }
    }

    /// The bytes of a file, as its stage wrote it, where the outcome was made with it.
    ///
    /// # Errors
    /// As [`Case::check_outcome`]; [`CaseError::Stale`] of a file that was changed or that another job has left.
    pub fn present_file(&self, file: &str) -> Result<Vec<u8>, WorkflowError> {
        self.check_made_with(file)?;
        if file == layout::ESTIMATE_JSON && self.present_estimate()?.is_none() {
            self.read(file)?;
            return Err(self.left_behind(file));
        }
        self.read_made(file)
    }

    /// The same to be looked at: where no job has come to an outcome, nothing in the folder can be of another one.
    ///
    /// # Errors
    /// As [`Case::present_file`].
    pub fn check_file(&self, file: &str) -> Result<(), WorkflowError> {
        if self.path(layout::PROVENANCE).exists() {
            self.check_made_with(file)?;
        }
        self.read_made(file).map(|_| ())
    }

    /// The state of the model that the outcome was made with: the estimate's, else the best sample's. A state that another job has
    /// left in the folder is none of it.
    ///
    /// # Errors
    /// As [`Case::outcome`].
    pub(crate) fn model(&self) -> Result<Option<String>, WorkflowError> {
        let outcome = self.outcome()?;
        Ok(outcome.judged().filter(|state| state.file.is_some()).map(|state| state.id.clone()))
    }

    /// The estimate that the outcome was made with; none where it was made without one, whatever lies in the folder.
    ///
    /// # Errors
    /// As [`Case::outcome`] and [`Case::estimate`], where an estimate lies in the folder.
    pub(crate) fn present_estimate(&self) -> Result<Option<EstimateFacts>, WorkflowError> {
        if !self.path(layout::ESTIMATE_JSON).exists() {
            return Ok(None);
        }
        self.outcome()?.estimate.map(|_| self.estimate()).transpose()
    }

    /// The stages that have finished here, each after those it was made from.
    pub(crate) fn recorded(&self) -> Vec<Manifest> {
        let mut waiting = Manifest::all_of(self.folder());
        let mut ordered: Vec<Manifest> = Vec::new();
        while !waiting.is_empty() {
            let ready =
                |m: &Manifest| !waiting.iter().any(|other| m.inputs.contains_key(&format!("stage {}", other.stage)));
            let next = waiting.iter().position(ready).unwrap_or(0);
            ordered.push(waiting.remove(next));
        }
        ordered
    }

    /// Takes away the files of every stage that was made from another state of the stages before it.
    pub(crate) fn drop_stale(&self) {
        let mut present: BTreeMap<String, Manifest> = BTreeMap::new();
        for manifest in self.recorded() {
            let holds = |(role, sum): (&String, &String)| match role.strip_prefix("stage ") {
                Some(earlier) => present.get(earlier).is_some_and(|earlier| earlier.made_sha256() == *sum),
                None if role == "mesh" => {
                    let mesh = present.get("mesh").and_then(|mesh| mesh.outputs.get(layout::REST_MESH));
                    mesh.is_some_and(|mesh| mesh.sha256 == *sum)
                }
                None => true,
            };
            if manifest.inputs.iter().all(holds) {
                present.insert(manifest.stage.clone(), manifest);
            } else {
                manifest.remove(self.folder());
            }
        }
    }

    /// Takes away the samples that are not of this list: a sweep of other settings has left them.
    pub(crate) fn drop_samples_but(&self, ids: &BTreeSet<&str>) {
        for manifest in self.recorded() {
            if let Some(StageName::Sample(id)) = StageName::parse(&manifest.stage)
                && !ids.contains(id.as_str())
            {
                manifest.remove(self.folder());
            }
        }
    }

    /// Refuses a folder that was made from something else.
    pub(crate) fn check_subject(&self, subject: Subject) -> Result<(), WorkflowError> {
        let folder = self.folder().to_path_buf();
        match (self.subject(), subject) {
            (Some(Subject::Phantom { .. }), Subject::Patient) => Err(CaseError::Phantom { folder }.into()),
            (Some(Subject::Patient), Subject::Phantom { .. }) => Err(CaseError::Patient { folder }.into()),
            (Some(Subject::Plan), Subject::Patient | Subject::Phantom { .. }) => {
                Err(CaseError::Planned { folder }.into())
            }
            (Some(_), Subject::Plan) if self.subject() != Some(Subject::Plan) => {
                Err(CaseError::NotPlanned { folder }.into())
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::artefact::{Produced, Stage, write_whole};
    use crate::experiment::outcome::ExperimentOutcome;
    use crate::workflow::{default_state, named_state};
    use serde_json::json;

    /// A patient's folder with an outcome of these samples and the settings of today; an estimate lies beside them.
    pub fn answered(folder: &std::path::Path, samples: &[&str]) -> Case {
        let case = Case::at(folder);
        let sample = |id: &&str| {
            json!({
                "id": id, "sd_levels": {}, "shear_modulus_pa": {}, "rmse_mm": {}, "converged": true, "newton_iterations": 1,
                "relative_residuals": [], "file": layout::SAMPLE_STATE.of(id),
            })
        };
        let outcome = ExperimentOutcome {
            samples: samples.iter().map(|id| serde_json::from_value(sample(id)).unwrap()).collect(),
            best_sample: samples.first().map(|id| (*id).to_owned()),
            ..ExperimentOutcome::default()
        };
        let write = |file: &str, text: &str| write_whole(&case.path(file), text.as_bytes()).unwrap();
        write(layout::OUTCOME, &outcome.to_json(layout::OUTCOME).unwrap());
        write(layout::SETTINGS, "");
        for file in [".stages/registration.manifest.json", layout::ESTIMATE_JSON, layout::ESTIMATE_STATE] {
            write(file, "{}");
        }
        let sum = |file: &str| (file.to_owned(), sha256_hex(&case.read(file).unwrap()));
        let provenance = Provenance { program: String::new(), gathered: GATHERED.map(sum).into(), stages: Vec::new() };
        write(layout::PROVENANCE, &serde_json::to_string(&provenance).unwrap());
        case
    }

    #[test]
    fn an_estimate_that_the_outcome_was_made_without_is_nobodys_state() {
        let folder = tempfile::tempdir().unwrap();
        let case = answered(folder.path(), &["sample-03"]);
        assert_eq!(case.model().unwrap().as_deref(), Some("sample-03"));
        assert!(case.present_estimate().unwrap().is_none());
        // Nor where it is named.
        for refused in [named_state(&case, Some("estimate")).unwrap_err(), case.field_in("estimate", "u").unwrap_err()]
        {
            assert!(refused.to_string().contains("sim/estimate.vtu is not of the present state"), "{refused}");
        }
        assert_eq!(named_state(&case, Some("sample-03")).unwrap(), "sample-03");
        for wrong in ["sample-30", "../sim/estimate"] {
            let refused = named_state(&case, Some(wrong)).unwrap_err().to_string();
            assert!(
                refused.contains(&format!("no state `{wrong}` in this case; it has sample-03, observed")),
                "{refused}"
            );
        }
        // Nor where there is no other: that file is there, and not of the outcome.
        let refused = default_state(&answered(&folder.path().join("prepared"), &[])).unwrap_err();
        assert!(matches!(refused, WorkflowError::Case(CaseError::Stale { .. })), "{refused}");
    }

    #[test]
    fn a_file_of_a_stage_that_the_outcome_was_made_without_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let case = answered(folder.path(), &["sample-03"]);
        let files = vec![(layout::SHIFT_JSON.to_owned(), b"{}".to_vec())];
        let made = || Ok::<_, std::convert::Infallible>(Produced { files, ..Produced::default() });
        Stage::new("fields", 1, folder.path(), &()).run(false, made).unwrap();
        let refusals = [
            case.present_file(layout::SHIFT_JSON).unwrap_err(),
            case.check_file(layout::SHIFT_JSON).unwrap_err(),
            named_state(&case, Some("fused")).unwrap_err(),
        ];
        for refused in refusals {
            assert!(refused.to_string().contains(layout::SHIFT_JSON), "{refused}");
        }
        // The images' own displacement is of no model.
        assert_eq!(named_state(&case, Some("observed")).unwrap(), "observed");
        // Before any outcome a file may be looked at, and is no number of one.
        std::fs::remove_file(case.path(layout::PROVENANCE)).unwrap();
        assert!(case.check_file(layout::SHIFT_JSON).is_ok() && case.present_file(layout::SHIFT_JSON).is_err());
    }

    #[test]
    fn a_state_is_refused_where_the_outcome_is_of_other_settings() {
        let folder = tempfile::tempdir().unwrap();
        let case = answered(folder.path(), &["sample-03"]);
        write_whole(&case.path(layout::SETTINGS), b"seed = 1").unwrap();
        let named = ["sample-03", "observed", "fused"].map(|state| named_state(&case, Some(state)).unwrap_err());
        let read =
            [case.present_file(layout::ESTIMATE_JSON), case.check_file(layout::ESTIMATE_JSON).map(|()| Vec::new())];
        let refused = [case.model().unwrap_err(), case.present_estimate().unwrap_err()];
        for refused in refused.into_iter().chain(named).chain(read.map(Result::unwrap_err)) {
            assert!(matches!(refused, WorkflowError::Case(CaseError::Stale { .. })), "{refused}");
        }
        // Nothing was estimated here, and so nothing is of other settings.
        std::fs::remove_file(case.path(layout::ESTIMATE_JSON)).unwrap();
        assert!(case.present_estimate().unwrap().is_none());
    }
}

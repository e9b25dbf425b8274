//! What holds a patient's brain, for the keys of the stages that are made with it.
//!
//! A scenario names the sets that slide and hold, and not how they were chosen: the opening of the skull, the cut through the
//! brainstem and the sulci that are closed stand in the settings alone.

use crate::experiment::resection::{ResectionSettings, Supports};
use crate::workflow::stage_name::Subject;
use crate::workflow::work::Work;
use serde_json::{Value, json};

/// Of what tries several ways of holding it: supports that are tried stand in no scenario.
pub(super) fn held_by(work: &Work<'_>) -> Value {
    let ResectionSettings { supports, falx, skull, .. } = &work.settings.resection;
    match work.subject {
        Subject::Patient => json!({ "supports": supports, "falx": falx, "skull": skull }),
        Subject::Phantom { .. } | Subject::Plan => Value::Null,
    }
}

/// The same of a sample, which is held in one way. Where nothing slides the scenario says all of it; where it does, nobody asks how
/// well the room before the skull is known.
pub(super) fn sample_held_by(work: &Work<'_>) -> Value {
    if work.settings.resection.supports != Supports::Sliding {
        return Value::Null;
    }
    let mut held = held_by(work);
    if let Some(skull) = held.get_mut("skull").and_then(Value::as_object_mut) {
        skull.remove("gap_log_sd");
    }
    held
}

#[cfg(test)]
mod tests {
    use crate::experiment::sample::{Sample, Tissue};
    use crate::fem::Scenario;
    use crate::workflow::stages::sample_stage;
    use crate::workflow::work::{Made, Work};
    use crate::workflow::{Place, Settings, Silent, Subject};
    use std::collections::BTreeMap;

    /// The key of a sample of one and the same scenario under these settings.
    fn key(settings: &str) -> String {
        let settings = Settings::resolve([&Settings::layer(settings, "settings.toml").unwrap()]).unwrap();
        let (place, mut silent) = (Place::from("case"), Silent);
        let work = Work::new(&place, Subject::Patient, &settings, &mut silent);
        let sample = Sample { id: "sample-00".to_owned(), tissues: BTreeMap::new(), task: None };
        sample_stage(&work, &Made::default(), &Scenario::default(), &Tissue::whole_brain(), &sample).key()
    }

    #[test]
    fn a_sample_that_slides_is_made_again_when_the_skull_is_another() {
        let sliding = |skull: &str| key(&format!("[resection]\nsupports = \"sliding\"\n[resection.skull]\n{skull}"));
        let as_it_was = sliding("");
        for skull in ["opening_mm = 20.0", "brainstem_cut_mm = 6.0", "closing_mm = 2.0", "from = \"scan\""] {
            assert_ne!(sliding(skull), as_it_was, "{skull}");
        }
        assert_eq!(sliding("gap_log_sd = 0.2"), as_it_was, "only an estimate asks how well the room is known");
    }

    #[test]
    fn a_sample_that_is_fixed_stays_whatever_the_skull() {
        for supports in ["fixed", "evidence"] {
            let fixed =
                |skull: &str| key(&format!("[resection]\nsupports = \"{supports}\"\n[resection.skull]\n{skull}"));
            assert_eq!(fixed("opening_mm = 20.0"), fixed(""));
        }
    }
}

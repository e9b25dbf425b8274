//! The commands that fill a cohort's folders, for workflow managers: each after the one before it.

use serde::Serialize;

/// A command of a cohort; words in braces stand for the subject's files and the part of a sweep.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CohortCommand {
    name: &'static str,
    words: &'static [&'static str],
}

/// In the order in which they are run.
pub const COHORT: [CohortCommand; 6] = [
    CohortCommand {
        name: "predict",
        words: &["bids", "{bids_dir}", "{out}", "participant", "--predict", "--participant-label", "{participant_id}"],
    },
    CohortCommand { name: "prep", words: &["prep", "{pre}", "{post}", "-o", "{case}"] },
    CohortCommand { name: "sweep", words: &["sweep", "{case}", "--shard", "{shard}"] },
    CohortCommand { name: "reduce", words: &["reduce", "{case}"] },
    CohortCommand {
        name: "report",
        words: &["bids", "{bids_dir}", "{out}", "participant", "--participant-label", "{participant_id}"],
    },
    CohortCommand { name: "group", words: &["bids", "{bids_dir}", "{out}", "group"] },
];

//! What a cohort says of people, beside the table of its subjects.

use crate::experiment::population::{PopulationFile, Shrunken, Taught};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The population that a cohort's estimates are of.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CohortPopulation {
    /// Subjects who teach: their stiffness is identified, if with a widened interval.
    pub patients: usize,
    /// Estimated subjects who do not, by the reason.
    pub left_out: BTreeMap<String, usize>,
    /// What they teach.
    pub parameters: Vec<Taught>,
    /// The subjects who teach, each with what the others say.
    pub subjects: Vec<Pupil>,
}

/// A subject with what the others say.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Pupil {
    /// `sub-01`.
    pub participant_id: String,
    /// Its parameters.
    pub shrunken: Vec<Shrunken>,
}

impl CohortPopulation {
    /// In words, for a terminal and the page.
    pub fn sentences(&self) -> Vec<String> {
        let left: Vec<String> = self.left_out.iter().map(|(why, count)| format!("{count} {why}")).collect();
        let out: usize = self.left_out.values().sum();
        let mut said = vec![match out {
            0 => format!("all {} estimated patients teach", self.patients),
            _ if self.patients == 0 => {
                format!("none of {out} estimated patients teaches: no population; left out: {}", left.join(", "))
            }
            _ => format!(
                "{} of {} estimated patients teach; left out: {}",
                self.patients,
                self.patients + out,
                left.join(", ")
            ),
        }];
        said.extend(self.parameters.iter().map(in_words));
        said
    }
}

/// What a population's file says, a line for each parameter.
pub fn file_in_words(file: &PopulationFile) -> String {
    file.parameters.iter().map(|taught| in_words(taught) + "\n").collect()
}

/// One parameter of a population in words.
pub fn in_words(taught: &Taught) -> String {
    let mut text = format!(
        "{}: {:.0} ({:.0} to {:.0}), people spread by a factor of {:.2} ({:.2} to {:.2}), next patient {:.0} to {:.0}, from {} patients",
        taught.name,
        taught.median,
        taught.median_95[0],
        taught.median_95[1],
        taught.log_spread.exp(),
        taught.log_spread_95[0].exp(),
        taught.log_spread_95[1].exp(),
        taught.next_95[0],
        taught.next_95[1],
        taught.patients
    );
    if !taught.moves_prior {
        let _ =
            write!(text, ": the literature's prior stands (one study's worth, or more patients are silent than teach)");
    }
    text
}

//! The group level: every subject's numbers in one table and one page.

use super::out_folder::may_hold_derivatives;
use super::{Dataset, POPULATION, learn, member};
use crate::artefact::write_whole;
use crate::report::cohort::{Cohort, Member};
use crate::report::cohort_tasks;
use crate::workflow::error::{CohortError, WorkflowError};
use std::path::{Path, PathBuf};

/// What a cohort's files say.
#[derive(Debug)]
pub struct Group {
    /// Every subject's numbers.
    pub cohort: Cohort,
    /// What the population says of people, where somebody was estimated, and its file.
    pub population: Vec<String>,
    /// The page of all subjects.
    pub page: PathBuf,
}

/// Table, page and population of the subjects below `out`; `cases` is below which the case folders lie.
///
/// # Errors
/// A folder of scans, no subject that has been run, one whose files are damaged, a population that cannot be inferred; the disk's.
///
/// # Panics
/// Never: a cohort is plain data.
pub fn group(dataset: &Dataset, out: &Path, cases: &Path) -> Result<Group, WorkflowError> {
    may_hold_derivatives(dataset, out)?;
    let members = dataset.subjects.iter().map(|name| member(out, cases, name)).collect::<Result<Vec<Member>, _>>()?;
    if members.iter().all(|m| m.outcome.is_none()) {
        return Err(CohortError::NobodyRun { out: out.to_path_buf() }.into());
    }
    let learnt = learn(&members, cases)?;
    let mut cohort = Cohort::new(&members);
    let mut said = Vec::new();
    let file = out.join(POPULATION);
    if learnt.as_ref().is_none_or(|(population, _)| population.is_none()) {
        // One of an earlier state of the cohort would be taken for this one's.
        std::fs::remove_file(&file).ok();
    }
    if let Some((population, told)) = learnt {
        said = told.sentences();
        if let Some(population) = population {
            write_whole(&file, population.to_toml().as_bytes())?;
            said.push(file.display().to_string());
        }
        cohort.population = Some(told);
    }
    let json = serde_json::to_string_pretty(&cohort).expect("a cohort is plain data") + "\n";
    for (file, text) in [("group.json", json), ("group.tsv", cohort.to_tsv()), ("group.html", cohort.to_html())] {
        write_whole(&out.join(file), text.as_bytes())?;
    }
    let tasks = out.join("group.tasks.tsv");
    if cohort.tasks.is_empty() {
        std::fs::remove_file(&tasks).ok();
    } else {
        write_whole(&tasks, cohort_tasks::to_tsv(&cohort.tasks).as_bytes())?;
    }
    Ok(Group { cohort, population: said, page: out.join("group.html") })
}

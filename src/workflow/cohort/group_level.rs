//! The group level: every subject's numbers in one table and one page.

use super::out_folder::may_hold_derivatives;
use super::{Dataset, POPULATION, learn, member};
use crate::artefact::write_whole;
use crate::experiment::population::PopulationFile;
use crate::report::cohort::{Cohort, CohortPopulation, Member};
use crate::report::cohort_tasks;
use crate::workflow::error::{CohortError, WorkflowError};
use std::path::{Path, PathBuf};

/// What a cohort's files say.
#[derive(Debug)]
pub struct Group {
    /// Every subject's numbers.
    pub cohort: Cohort,
    /// What the population says of people, where somebody was estimated, then its file and the page of all subjects, where they are
    /// written.
    pub said: Vec<String>,
}

/// Table, page and population of the subjects below `out`; `cases` is below which the case folders lie. A dry run reads, and writes
/// nothing.
///
/// # Errors
/// A folder of scans, no subject that has been run, one whose files are damaged, a population that cannot be inferred; the disk's.
///
/// # Panics
/// Never: a cohort is plain data.
pub fn group(dataset: &Dataset, out: &Path, cases: &Path, dry_run: bool) -> Result<Group, WorkflowError> {
    may_hold_derivatives(dataset, out)?;
    let members = dataset.subjects.iter().map(|name| member(out, cases, name)).collect::<Result<Vec<Member>, _>>()?;
    if members.iter().all(|m| m.outcome.is_none()) {
        return Err(CohortError::NobodyRun { out: out.to_path_buf() }.into());
    }
    let mut cohort = Cohort::new(&members);
    let (population, told) = learn(&members, cases)?.unzip();
    let mut said = told.as_ref().map(CohortPopulation::sentences).unwrap_or_default();
    cohort.population = told;
    if !dry_run {
        said.extend(
            written(&cohort, population.flatten().as_ref(), out)?.iter().map(|file| file.display().to_string()),
        );
    }
    Ok(Group { cohort, said })
}

/// Writes the files of a cohort and takes away those that it has no more; population, where there is one, and page are told.
fn written(cohort: &Cohort, population: Option<&PopulationFile>, out: &Path) -> Result<Vec<PathBuf>, WorkflowError> {
    let (file, page) = (out.join(POPULATION), out.join("group.html"));
    match population {
        Some(population) => write_whole(&file, population.to_toml().as_bytes())?,
        // One of an earlier state of the cohort would be taken for this one's.
        None => std::fs::remove_file(&file).unwrap_or_default(),
    }
    let json = serde_json::to_string_pretty(cohort).expect("a cohort is plain data") + "\n";
    for (file, text) in [("group.json", json), ("group.tsv", cohort.to_tsv()), ("group.html", cohort.to_html())] {
        write_whole(&out.join(file), text.as_bytes())?;
    }
    let tasks = out.join("group.tasks.tsv");
    if cohort.tasks.is_empty() {
        std::fs::remove_file(&tasks).ok();
    } else {
        write_whole(&tasks, cohort_tasks::to_tsv(&cohort.tasks).as_bytes())?;
    }
    Ok(population.map(|_| file).into_iter().chain([page]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workflow::cohort::case_folder;
    use crate::workflow::fresh::tests::answered;

    #[test]
    fn a_dry_run_of_a_group_tells_its_table_and_writes_nothing() {
        let all = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(all.path().join("study/sub-01")).unwrap();
        let dataset = Dataset::open(&all.path().join("study"), &[]).unwrap();
        let out = all.path().join("out");
        answered(&case_folder(&out, "sub-01"), &["sample-03"]);
        // Of an earlier state of the cohort.
        std::fs::write(out.join(POPULATION), "").unwrap();
        let files = || std::fs::read_dir(&out).unwrap().count();
        let dry = group(&dataset, &out, &out, true).unwrap();
        assert_eq!((dry.cohort.subjects.len(), files()), (1, 2));
        let found = group(&dataset, &out, &out, false).unwrap();
        assert_eq!((found.cohort, files()), (dry.cohort, 4));
        assert!(found.said.last().unwrap().ends_with("group.html") && !out.join(POPULATION).exists());
    }
}

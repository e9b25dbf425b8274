//! The group level: every subject's numbers in one table and one page.

use super::options::Args;
use crate::artefact::write_whole;
use crate::cli::{Failure, Session};
use crate::report::cohort::{Cohort, Member};
use crate::report::cohort_tasks;
use crate::workflow::cohort::{Dataset, POPULATION, learn, member};
use anyhow::anyhow;

pub fn run(args: &Args, dataset: &Dataset, session: &Session) -> Result<(), Failure> {
    let members: Vec<Member> =
        dataset.subjects.iter().map(|name| member(&args.out, args.cases(), name)).collect::<Result<_, _>>()?;
    if members.iter().all(|m| m.outcome.is_none()) {
        return Err(Failure::Rejected(anyhow!(
            "{}: no subject has been run here; run `hgm bids BIDS_DIR OUT participant` first",
            args.out.display()
        )));
    }
    let learnt = learn(&members, args.cases())?;
    let mut cohort = Cohort::new(&members);
    let mut said = String::new();
    let population_file = args.out.join(POPULATION);
    if learnt.as_ref().is_none_or(|(file, _)| file.is_none()) {
        // One of an earlier state of the cohort would be taken for this one's.
        std::fs::remove_file(&population_file).ok();
    }
    if let Some((file, population)) = learnt {
        said = population.sentences().join("\n") + "\n";
        if let Some(file) = file {
            write_whole(&population_file, file.to_toml().as_bytes())?;
            said += &format!("{}\n", population_file.display());
        }
        cohort.population = Some(population);
    }
    let json = serde_json::to_string_pretty(&cohort)? + "\n";
    let page = args.out.join("group.html");
    for (file, text) in [("group.json", json), ("group.tsv", cohort.to_tsv()), ("group.html", cohort.to_html())] {
        write_whole(&args.out.join(file), text.as_bytes())?;
    }
    let tasks = args.out.join("group.tasks.tsv");
    if cohort.tasks.is_empty() {
        std::fs::remove_file(&tasks).ok();
    } else {
        write_whole(&tasks, cohort_tasks::to_tsv(&cohort.tasks).as_bytes())?;
    }
    session.emit(&cohort, &format!("{}\n{said}{}", cohort.to_tsv(), page.display()))
}

//! The group level: every subject's numbers in one table and one page.

use super::dataset::Dataset;
use super::participant::Log;
use super::{Args, case_folder, log_file};
use crate::artefact::{sha256_hex, write_whole};
use crate::cli::{Failure, Reject, Session};
use crate::experiment::outcome::ExperimentOutcome;
use crate::report::cohort::{Cohort, Member, Status};
use anyhow::anyhow;

/// The settings of a case, for telling whether subjects were run alike.
const SETTINGS: &str = "settings.toml";
const OUTCOME: &str = "sim/outcome.json";

pub fn run(args: &Args, dataset: &Dataset, session: &Session) -> Result<(), Failure> {
    let members: Vec<Member> = dataset.subjects.iter().map(|name| member(args, name)).collect::<Result<_, _>>()?;
    if members.iter().all(|m| m.outcome.is_none()) {
        return Err(Failure::Rejected(anyhow!(
            "{}: no subject has been run here; run `hgm bids BIDS_DIR OUT participant` first",
            args.out.display()
        )));
    }
    let cohort = Cohort::new(&members);
    let json = serde_json::to_string_pretty(&cohort)? + "\n";
    let page = args.out.join("group.html");
    for (file, text) in [("group.json", json), ("group.tsv", cohort.to_tsv()), ("group.html", cohort.to_html())] {
        write_whole(&args.out.join(file), text.as_bytes())?;
    }
    session.emit(&cohort, &format!("{}\n{}", cohort.to_tsv(), page.display()))
}

fn member(args: &Args, subject: &str) -> Result<Member, Failure> {
    let case = case_folder(&args.out, subject);
    let read = |file: &str| std::fs::read_to_string(case.join(file)).ok();
    let outcome = read(OUTCOME).map(|text| ExperimentOutcome::from_json(&text, &format!("{subject}/hgm/{OUTCOME}")));
    let log = log_file(&args.out, subject);
    let log: Option<Log> = match std::fs::read(&log) {
        Err(_) => None,
        Ok(bytes) => {
            let shown = || anyhow!("{}: not a log of hgm; delete it and run this subject again", log.display());
            Some(serde_json::from_slice(&bytes).map_err(|_| shown()).reject()?)
        }
    };
    let status = match (&log, &outcome) {
        (Some(log), _) if log.exit_code == 4 => Status::QualityGate,
        (Some(_), _) => Status::Failed,
        (None, Some(_)) => Status::Done,
        (None, None) => Status::Missing,
    };
    Ok(Member {
        participant_id: subject.to_owned(),
        status,
        message: log.map(|log| format!("{}: {}", log.kind, log.message)),
        outcome: outcome.transpose().reject()?,
        settings_sha256: read(SETTINGS).map(|text| sha256_hex(text.as_bytes())),
    })
}

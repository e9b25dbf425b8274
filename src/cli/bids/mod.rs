//! `hgm bids`: a BIDS App, from a data set of T1 pairs to derivatives and a table of all subjects.

mod options;
mod participant;

pub use options::Args;

use super::{Failure, Session};
use crate::workflow::Layer;
use crate::workflow::cohort::{Dataset, group};
use options::Level;

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let dataset = Dataset::open(&args.bids_dir, &args.participant_label)?;
    match args.level {
        Level::Participant if args.dry_run => participant::plan(args, &dataset, session),
        Level::Participant => participant::run(args, &dataset, session),
        Level::Group => {
            let unused = of_participants(args);
            if !unused.is_empty() {
                tracing::warn!(
                    "without effect at the group level, which reads what the participant level has made: {}; say them there",
                    unused.join(", ")
                );
            }
            let found = group(&dataset, &args.out, args.cases(), args.dry_run)?;
            session.emit(&found.cohort, &format!("{}\n{}", found.cohort.to_tsv(), found.said.join("\n")))
        }
    }
}

/// What was given that is the participant level's alone.
fn of_participants(args: &Args) -> Vec<&'static str> {
    let mut flags = Layer::default();
    args.mesh.over(&mut flags);
    args.analysis.over(&mut flags);
    let given = [
        (args.predict, "--predict, --plans and --plan"),
        (args.analysis.estimate, "--estimate"),
        (args.analysis.population.population.is_some(), "--population"),
        (!args.entity.is_empty(), "--entity"),
        (args.stop_on_first_crash, "--stop-on-first-crash"),
        (args.mem_gb.is_some(), "--mem-gb"),
        (!flags.0.is_empty(), "options of mesh, material and how the patient lay"),
    ];
    given.into_iter().filter(|(given, _)| *given).map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn told(more: &[&str]) -> Vec<&'static str> {
        let words = [&["bids", "study", "out", "group"], more].concat();
        of_participants(&Line::try_parse_from(words).unwrap().args)
    }

    #[test]
    fn what_the_group_level_has_no_use_for_is_told() {
        assert!(told(&["--participant-label", "01", "-w", "work", "--nprocs", "2", "--dry-run"]).is_empty());
        assert_eq!(told(&["--entity", "run-2", "--estimate"]), ["--estimate", "--entity"]);
        assert_eq!(told(&["--cells", "5000"]), ["options of mesh, material and how the patient lay"]);
        assert_eq!(told(&["--tissues", "2"]), ["options of mesh, material and how the patient lay"]);
        assert_eq!(told(&["--predict", "--stop-on-first-crash"]).len(), 2);
    }
}

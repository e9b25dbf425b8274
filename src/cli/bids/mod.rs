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
            let mut flags = Layer::default();
            args.mesh.over(&mut flags);
            args.analysis.over(&mut flags);
            let of_subjects =
                args.predict || args.analysis.estimate || args.stop_on_first_crash || !args.entity.is_empty();
            if of_subjects || !flags.0.is_empty() {
                tracing::warn!(
                    "options of a subject's work are without effect at the group level: say them to `participant`"
                );
            }
            let found = group(&dataset, &args.out, args.cases(), args.dry_run)?;
            session.emit(&found.cohort, &format!("{}\n{}", found.cohort.to_tsv(), found.said.join("\n")))
        }
    }
}

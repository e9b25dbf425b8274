//! `hgm bids`: a BIDS App, from a data set of T1 pairs to derivatives and a table of all subjects.

mod options;
mod participant;

pub use options::Args;

use super::{Failure, Session};
use crate::workflow::cohort::{Dataset, group};
use options::Level;

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let dataset = Dataset::open(&args.bids_dir, &args.participant_label)?;
    match args.level {
        Level::Participant if args.dry_run => participant::plan(args, &dataset, session),
        Level::Participant => participant::run(args, &dataset, session),
        Level::Group => {
            let found = group(&dataset, &args.out, args.cases(), args.dry_run)?;
            session.emit(&found.cohort, &format!("{}\n{}", found.cohort.to_tsv(), found.said.join("\n")))
        }
    }
}

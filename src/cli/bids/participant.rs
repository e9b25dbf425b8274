//! The participant level: each subject through the same code as `hgm run`, then its files under BIDS names.

use super::options::Args;
use crate::cli::{Failure, Session, run};
use crate::workflow::cohort::{
    Dataset, Log, Participants, SubjectError, Work, participants, planned, planned_table, some_can_be_done, table,
    unwell,
};
use crate::workflow::{Layer, Place, Settings};
use anyhow::anyhow;
use serde_json::json;
use std::path::Path;

impl Args {
    fn asked<'a>(&'a self, dataset: &'a Dataset, plans: &'a Path, cases: &'a Place) -> Participants<'a> {
        let (entities, stop_on_first_crash) = (&self.entity, self.stop_on_first_crash);
        let work =
            if self.predict { Work::Plan { plans, chosen: &self.plan } } else { Work::Pair(self.analysis.goal()) };
        Participants { dataset, entities, work, out: &self.out, cases, stop_on_first_crash }
    }
}

pub fn plan(args: &Args, dataset: &Dataset, session: &Session) -> Result<(), Failure> {
    // A settings file that a run would refuse is refused before it.
    settings(args, session)?;
    let place = session.place(args.cases());
    let plans = args.plans();
    let planned = planned(&args.asked(dataset, &plans, &place), &|error| Failure::from(error).message())?;
    session.emit(&json!({ "subjects": planned }), &planned_table(&planned))?;
    Ok(some_can_be_done(&planned, dataset)?)
}

pub fn run(args: &Args, dataset: &Dataset, session: &Session) -> Result<(), Failure> {
    let (settings, place) = (settings(args, session)?, session.place(args.cases()));
    let mut words = |subject: &str, error: SubjectError| {
        let failure = match error {
            SubjectError::Job(error) => Failure::from(error),
            defect @ SubjectError::Defect => Failure::from(defect),
        };
        let (kind, message) = (failure.parts().0.to_owned(), failure.message());
        eprintln!("hgm: {kind}: {subject}: {message}");
        Log { kind, message, exit_code: failure.code() }
    };
    let plans = args.plans();
    let asked = args.asked(dataset, &plans, &place);
    let done = participants(&asked, &settings, &mut *session.listener(), &mut words)?;
    session.emit(&json!({ "subjects": done }), &table(&done))?;
    unwell(&done, &asked).map_or(Ok(()), |(worst, summary)| Err(Failure::of(worst, anyhow!(summary))))
}

/// Those of `hgm run` or `hgm predict`, with the memory that the mesh engines may take.
fn settings(args: &Args, session: &Session) -> Result<Settings, Failure> {
    let mut settings = if args.predict {
        let mut flags = Layer::default();
        args.mesh.over(&mut flags);
        args.analysis.prior.over(&mut flags);
        args.analysis.population.over(&mut flags)?;
        session.settings(flags)?
    } else {
        run::settings(&args.analysis, &args.mesh, session)?
    };
    if let Some(gb) = args.mem_gb {
        settings.mesh.limits.memory_mb = 1000 * gb;
    }
    Ok(settings)
}

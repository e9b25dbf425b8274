//! `hgm estimate`: the moduli that explain what was observed, with error bars.

use super::flags::{PopulationOption, PriorModelOption};
use super::run::in_words;
use super::{Failure, Session};
use crate::workflow::{self, Layer, Subject};
use std::path::PathBuf;

/// Shear moduli by optimisation with solver sensitivities: most probable values, 95 % intervals, what limits them
///
/// Example: hgm estimate case --tissues 2
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm run`, `hgm prep` or `hgm phantom`
    case: PathBuf,
    /// 1: the whole brain one material; 2: grey and white matter apart [default: as the case was made]
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
    #[command(flatten)]
    model: PriorModelOption,
    #[command(flatten)]
    population: PopulationOption,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Layer::default();
    for room in ["resection", "phantom"] {
        flags.set(&format!("{room}.tissues"), args.tissues);
    }
    args.model.over(&mut flags);
    args.population.over(&mut flags)?;
    let settings = session.settings_of(&args.case, flags)?;
    let case = workflow::estimate(&session.place(&args.case), &settings, &mut *session.listener())?;
    let facts = case.estimate()?;
    session.emit(&facts.estimate, &in_words(&case)?)?;
    Ok(if case.subject() == Some(Subject::Patient) { case.quality_gate() } else { Ok(()) }?)
}

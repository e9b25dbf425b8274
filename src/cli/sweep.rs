//! `hgm sweep`: the prior's samples on a prepared case, all of them or a part.

use super::flags::{PriorOptions, TaskOption};
use super::run::in_words;
use super::{Failure, Session};
use crate::workflow::{self, Layer, Shard};
use std::path::PathBuf;

/// Samples of the prior simulated on a prepared case; --shard K/N runs a part, `hgm reduce` joins the parts
///
/// Example: hgm sweep case --tissues 2 --shard 1/4
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder made by `hgm prep` or `hgm run`
    case: PathBuf,
    /// 1: the whole brain one material; 2: grey and white matter apart (81 samples) [default: as the case was made]
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    tissues: Option<u8>,
    #[command(flatten)]
    tasks: TaskOption,
    #[command(flatten)]
    prior: PriorOptions,
    /// Only every N-th sample, beginning with the K-th (from 1); any order, any machine, the same bytes
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut flags = Layer::default();
    flags.set("resection.tissues", args.tissues);
    args.tasks.over(&args.prior, args.tissues, &mut flags);
    args.prior.over(&mut flags);
    let settings = session.settings_of(&args.case, flags)?;
    let case = workflow::sweep(args.shard, &session.place(&args.case), &settings, &mut *session.listener())?;
    if let Some(Shard { number, of }) = args.shard {
        session.emit(
            &serde_json::json!({ "shard": number, "of": of }),
            "shard done; when all are, join them with `hgm reduce`",
        )?;
    } else {
        session.emit(&case.outcome()?, &in_words(&case)?)?;
    }
    Ok(case.quality_gate()?)
}

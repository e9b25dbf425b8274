//! `hgm sweep`: the prior's samples on a prepared case, all of them or a part.

use super::case::{Case, PriorOptions};
use super::patient::{Part, Patient};
use super::run::summary;
use super::{Failure, Session};
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
    prior: PriorOptions,
    /// Only every N-th sample, beginning with the K-th (from 1); any order, any machine, the same bytes
    #[arg(long, value_name = "K/N", value_parser = part)]
    shard: Option<Part>,
}

fn part(text: &str) -> Result<Part, String> {
    let wrong = || format!("`{text}` is not K/N with 1 <= K <= N, such as 2/4");
    let (number, of) = text.split_once('/').ok_or_else(wrong)?;
    let (number, of): (usize, usize) = (number.parse().map_err(|_| wrong())?, of.parse().map_err(|_| wrong())?);
    if (1..=of).contains(&number) { Ok(Part::Shard { number, of }) } else { Err(wrong()) }
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let case = Case::open(&args.case, session);
    let patient = Patient::open(&case, args.tissues, session)?;
    let part = args.shard.unwrap_or(Part::All);
    match patient.sweep(part, &args.prior, session)? {
        Some((outcome, page)) => session.emit(&outcome, &summary(&outcome, &page))?,
        None => session.emit(
            &serde_json::json!({ "shard": format!("{part:?}"), "case": args.case }),
            "shard done; when all are, join them with `hgm reduce`",
        )?,
    }
    patient.quality_gate()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_is_a_part_of_a_whole() {
        assert_eq!(part("2/4"), Ok(Part::Shard { number: 2, of: 4 }));
        for wrong in ["0/4", "5/4", "1", "a/b", "1/", "-1/2"] {
            assert!(part(wrong).unwrap_err().contains(wrong));
        }
    }
}

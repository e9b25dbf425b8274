//! `hgm gp studies`: the literature table.

use crate::cli::{Failure, Session};
use crate::material::literature::{STUDIES_CSV, listed, table};

/// Print the literature table (CSV), whose columns a table of your own takes
///
/// Moduli are in Pa. A study whose id stands here replaces it, another id adds one. With --json each study comes with
/// its full citation.
///
/// Example: hgm gp studies > studies.csv
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    session.emit(&table().iter().map(listed).collect::<Vec<_>>(), STUDIES_CSV)
}

//! `hgm settings`: every setting with default, unit and what it is.

use super::{Failure, Session};
use crate::workflow::{Layer, annotated, every_setting, settings_of_table};
use std::path::PathBuf;

/// Print every table and key of a settings file with value, unit and what it is; edit it and give it back with --config
///
/// Example: hgm settings anat.cavity
/// Example: hgm settings --used case
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only this table and those below it: mesh, anat.cavity ... [default: all]
    table: Option<String>,
    /// The settings that a case was made with; what differs from the default says so
    #[arg(long, value_name = "CASE")]
    used: Option<PathBuf>,
}

pub fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let settings = match &args.used {
        Some(case) => session.settings_of(case, Layer::default())?,
        None => session.settings(Layer::default())?,
    };
    let all = every_setting(&settings);
    let all = match &args.table {
        Some(wanted) => settings_of_table(all, wanted)?,
        None => all,
    };
    session.emit(&serde_json::json!({ "settings": all }), &annotated(&all))
}

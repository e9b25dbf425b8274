//! `hgm settings`: every setting with default, unit and what it is.

use super::flags::Flags;
use super::{Failure, Session};
use crate::workflow::{annotated, every_setting};
use anyhow::anyhow;
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
        Some(case) => session.settings_of(case, Flags::default())?,
        None => session.settings(Flags::default())?,
    };
    let mut all = every_setting(&settings);
    if let Some(wanted) = &args.table {
        let tables: Vec<String> = all.iter().filter_map(|s| s.table.split('.').next()).map(str::to_owned).collect();
        all.retain(|s| s.table == *wanted || s.table.starts_with(&format!("{wanted}.")));
        if all.is_empty() {
            let mut tables = tables;
            tables.dedup();
            return Err(Failure::Rejected(anyhow!(
                "there is no table [{wanted}]; the tables are {}",
                tables.join(", ")
            )));
        }
    }
    session.emit(&serde_json::json!({ "settings": all }), &annotated(&all))
}

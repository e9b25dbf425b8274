//! `hgm schema`: what `--json` prints, as a JSON Schema.

use super::{Failure, Session};
use crate::material::law::LAWS;
use crate::material::meta_model::MetaModel;
use crate::mesh::engine::Engine;

const SCHEMA: &str = include_str!("schema.json");

/// Print the JSON Schema of what every command prints with --json
///
/// Example: hgm schema > hgm.schema.json
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_args: &Args, session: &Session) -> Result<(), Failure> {
    let schema = schema();
    session.emit(&serde_json::from_str::<serde_json::Value>(&schema)?, &schema)
}

/// The schema with the names of what stands in lists: laws, meta-models, engines.
fn schema() -> String {
    let laws: Vec<&str> = LAWS.iter().map(|law| law.card().name).collect();
    let engines: Vec<&str> = Engine::all().map(Engine::name).collect();
    [("laws", laws), ("meta-models", MetaModel::names()), ("engines", engines)].into_iter().fold(
        SCHEMA.to_owned(),
        |schema, (what, names)| {
            let names = names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
            schema.replace(&format!("\"names of {what}\""), &names)
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_list_of_names_is_filled_in() {
        let schema = schema();
        assert!(!schema.contains("names of "));
        let schema: serde_json::Value = serde_json::from_str(&schema).unwrap();
        let named = |place: &str| schema.pointer(place).unwrap()["enum"].as_array().unwrap().len();
        assert_eq!(named("/$defs/law/properties/law"), LAWS.len());
        assert_eq!(named("/$defs/fit/properties/model"), MetaModel::names().len());
        assert_eq!(named("/$defs/mesh/properties/engine"), Engine::all().count());
    }
}

//! What `--json` prints, as a JSON Schema.

use crate::experiment::compare::Comparison;
use crate::experiment::landmarks::Evaluation;
use crate::experiment::outcome::ExperimentOutcome;
use crate::experiment::population::PopulationFile;
use crate::experiment::predict::{PlanComparison, Prediction, PredictionEvaluation};
use crate::material::meta_model::MetaModel;
use crate::report::cohort::Cohort;
use schemars::generate::SchemaSettings;
use serde_json::Value;

/// The commands, and the documents that no type of the library describes.
const COMMANDS: &str = include_str!("schema.json");

/// The commands' documents with the results' own types among the definitions.
///
/// # Errors
/// Commands that are no JSON: none.
pub fn schema() -> serde_json::Result<Value> {
    let mut generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    generator.subschema_for::<ExperimentOutcome>();
    generator.subschema_for::<Cohort>();
    generator.subschema_for::<Evaluation>();
    generator.subschema_for::<Comparison>();
    generator.subschema_for::<Prediction>();
    generator.subschema_for::<PredictionEvaluation>();
    generator.subschema_for::<PlanComparison>();
    generator.subschema_for::<PopulationFile>();
    let mut schema: Value = serde_json::from_str(&with_names(COMMANDS))?;
    for (name, mut definition) in generator.take_definitions(true) {
        if name == "MeshOutcome" {
            // `hgm mesh` prints more beside it, and says itself that there is nothing else.
            definition.as_object_mut().and_then(|mesh| mesh.remove("additionalProperties"));
        }
        schema["$defs"][name] = definition;
    }
    Ok(schema)
}

/// The text with the names of the meta-models where it asks for them.
fn with_names(text: &str) -> String {
    let names: Vec<String> = MetaModel::names().iter().map(|name| format!("\"{name}\"")).collect();
    text.replace("\"names of meta-models\"", &names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reference_leads_to_a_definition_and_units_are_told() {
        let schema = schema().unwrap();
        let text = schema.to_string();
        let names: Vec<&str> = text.split("#/$defs/").skip(1).filter_map(|rest| rest.split('"').next()).collect();
        assert!(names.len() > 10);
        for name in names {
            assert!(schema["$defs"].get(name).is_some(), "{name}");
        }
        let rmse = &schema["$defs"]["SampleOutcome"]["properties"]["rmse_mm"];
        assert!(rmse["description"].as_str().unwrap().contains("mm"), "{rmse}");
    }
}

//! Every setting with its value, its default, its unit and what it is: the settings file that documents itself. The words
//! are the doc comments of the settings' own types.

use super::settings::{Settings, SettingsError};
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde_json::Value;

/// Columns of the text.
const WIDTH: usize = 110;

/// One setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Setting {
    /// Its table: `anat.cavity`.
    pub table: String,
    /// Its name in it.
    pub name: String,
    /// Its value; absent where it is not set.
    pub value: Option<Value>,
    /// What it is where nobody says otherwise; absent where it is not set.
    pub default: Option<Value>,
    /// The unit that its name carries.
    pub unit: Option<&'static str>,
    /// What it is.
    pub description: String,
}

/// Units by the ends of names, the first one that fits.
const UNITS: [(&str, &str); 15] = [
    ("_kg_per_m3", "kg/m3"),
    ("_m_per_s2", "m/s2"),
    ("_area_mm2", "mm2"),
    ("_voxels", "voxels"),
    ("_fraction", "share"),
    ("_percent", "%"),
    ("_log_sd", "standard deviation of the logarithm"),
    ("_deg", "degrees"),
    ("_mm", "mm"),
    ("_pa", "Pa"),
    ("_cc", "cc"),
    ("_mb", "MB"),
    ("_n", "N"),
    ("_s", "s"),
    ("_levels", "standard deviations of the prior"),
];

fn unit(name: &str) -> Option<&'static str> {
    UNITS.iter().find(|(end, _)| name.ends_with(end)).map(|(_, unit)| *unit)
}

/// Every setting, table by table, in the order of `settings.toml`.
pub fn every_setting(settings: &Settings) -> Vec<Setting> {
    let schema = SchemaSettings::draft2020_12().for_deserialize().into_generator().into_root_schema_for::<Settings>();
    let schema = Value::from(schema);
    let json = |settings: &Settings| {
        let table: toml::Table = settings.to_toml().parse().unwrap_or_default();
        serde_json::to_value(table).unwrap_or_default()
    };
    let mut all = Vec::new();
    collect(&schema, &schema, "", [&json(settings), &json(&Settings::default())], &mut all);
    all
}

/// Those of a table and of the tables below it.
///
/// # Errors
/// A table that does not exist.
pub fn settings_of_table(mut all: Vec<Setting>, wanted: &str) -> Result<Vec<Setting>, SettingsError> {
    let mut tables: Vec<String> = all.iter().filter_map(|s| s.table.split('.').next()).map(str::to_owned).collect();
    tables.dedup();
    all.retain(|s| s.table == *wanted || s.table.starts_with(&format!("{wanted}.")) || is_called(s, wanted));
    if all.is_empty() {
        let reason = format!("there is no table [{wanted}]; the tables are {}", tables.join(", "));
        return Err(SettingsError { file: None, line: None, table: None, reason });
    }
    Ok(all)
}

/// Whether a setting is the table of this name.
fn is_called(setting: &Setting, table: &str) -> bool {
    table.strip_prefix(&setting.table).and_then(|end| end.strip_prefix('.')) == Some(&setting.name)
}

/// What a reference in a schema stands for; an optional value's own schema.
fn resolved<'a>(root: &'a Value, schema: &'a Value) -> &'a Value {
    let through = |name: &str| schema[name].as_array().and_then(|all| all.iter().find(|s| s["type"] != "null"));
    if let Some(name) = schema["$ref"].as_str().and_then(|path| path.rsplit('/').next()) {
        return resolved(root, &root["$defs"][name]);
    }
    through("anyOf").or_else(|| through("allOf")).map_or(schema, |inner| resolved(root, inner))
}

fn collect(root: &Value, schema: &Value, table: &str, [now, default]: [&Value; 2], all: &mut Vec<Setting>) {
    let Some(properties) = resolved(root, schema)["properties"].as_object() else { return };
    // Plain values before tables, as TOML wants it. A table that is not set is a value that is not, and has its keys all the same.
    let is_table = |name: &str| {
        let unset = || now[name].is_null() && resolved(root, &properties[name])["properties"].is_object();
        now[name].is_object() || unset()
    };
    for (name, property) in properties.iter().filter(|(name, _)| !now[*name].is_object()) {
        let told = |value: &Value| (!value.is_null()).then(|| value.clone());
        all.push(Setting {
            table: table.to_owned(),
            name: name.clone(),
            value: told(&now[name]),
            default: told(&default[name]),
            unit: unit(name),
            description: description(root, property),
        });
    }
    for (name, property) in properties.iter().filter(|(name, _)| is_table(name)) {
        let below = if table.is_empty() { name.clone() } else { format!("{table}.{name}") };
        let before = all.len();
        collect(root, property, &below, [&now[name], &default[name]], all);
        if all.len() == before {
            // A table whose names are not settings but things: `[tag.plausible_area_mm2]`; or one choice of several.
            for (key, value) in now[name].as_object().into_iter().flatten() {
                all.push(Setting {
                    table: below.clone(),
                    name: key.clone(),
                    value: Some(value.clone()),
                    default: default[name].get(key).cloned(),
                    unit: unit(key).or_else(|| unit(name)),
                    description: description(root, property),
                });
            }
        }
    }
}

/// The doc comment in one line, with the words that it may take.
fn description(root: &Value, property: &Value) -> String {
    let inner = resolved(root, property);
    let text = property["description"].as_str().or_else(|| inner["description"].as_str()).unwrap_or_default();
    let mut words: Vec<&str> = inner["enum"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    words.extend(inner["oneOf"].as_array().into_iter().flatten().filter_map(|choice| choice["const"].as_str()));
    // Links are for the documentation of the library.
    let text = text.replace("[`", "`").replace("`]", "`").split_whitespace().collect::<Vec<_>>().join(" ");
    if words.is_empty() { text } else { format!("{text} One of: {}.", words.join(", ")) }
}

/// The settings as a settings file with a comment for each: it can be edited and given back with `--config`.
pub fn annotated(settings: &[Setting]) -> String {
    let mut text = String::new();
    let mut table = None;
    for setting in settings {
        if table != Some(&setting.table) {
            if !setting.table.is_empty() {
                // A head alone would set what is not set.
                let unset = settings.iter().any(|other| other.value.is_none() && is_called(other, &setting.table));
                let (mark, told) =
                    if unset { ("# ", " # to set any of these, set this head as well") } else { ("", "") };
                text += &format!("{}{mark}[{}]{told}\n", if text.is_empty() { "" } else { "\n" }, setting.table);
            }
            table = Some(&setting.table);
        }
        let unit = setting.unit.map(|unit| format!(" [{unit}]")).unwrap_or_default();
        let default = setting.default.as_ref().map_or_else(|| "not set".to_owned(), toml_value);
        let default = if setting.value == setting.default { String::new() } else { format!(" Default: {default}.") };
        text += &comment(&format!("{}{unit}{default}", setting.description));
        text += &match &setting.value {
            Some(value) => format!("{} = {}\n", setting.name, toml_value(value)),
            None => format!("# {} is not set\n", setting.name),
        };
    }
    text
}

fn toml_value(value: &Value) -> String {
    toml::Value::try_from(value).map_or_else(|_| value.to_string(), |value| value.to_string())
}

fn comment(text: &str) -> String {
    let mut lines = String::new();
    let mut line = String::from("#");
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines += &format!("{line}\n");
            line = String::from("#");
        }
        line += &format!(" {word}");
    }
    if line.len() > 1 { lines + &line + "\n" } else { lines }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_is_a_settings_file_that_sets_every_setting_as_it_is() {
        let own = "[mesh]\nengine = \"gmsh\"\n[mesh.size]\nedge_mm = 3.5\n[resection]\ntissues = 2\n[image]\nprefer = \"sform\"\n";
        let settings = Settings::resolve([&own.parse().unwrap()]).unwrap();
        let text = annotated(&every_setting(&settings));
        let layer = Settings::layer(&text, "printed.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(Settings::resolve([&layer]).unwrap(), settings);
        let unwrapped = text.replace("\n# ", " ");
        assert!(text.contains("engine = \"gmsh\"") && unwrapped.contains("Default: \"lattice\"."), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 130), "{text}");
    }

    #[test]
    fn keys_of_a_table_that_is_not_set_are_told_without_setting_it() {
        let all = every_setting(&Settings::default());
        for (table, name) in [("resection.csf", "drained"), ("predict.fluid_level", "sd_mm")] {
            let told = settings_of_table(all.clone(), table).unwrap();
            assert!(told.iter().any(|s| s.name == name && s.value.is_none()), "{table}: {told:?}");
            let text = annotated(&told);
            assert!(text.contains(&format!("\n# [{table}] #")) && text.contains(" is not set\n\n# ["), "{text}");
        }
        // With its head it is set.
        let text = annotated(&settings_of_table(all.clone(), "predict.fluid_level").unwrap());
        let values =
            [("# [", "["), ("# below_top_mm is not set", "below_top_mm = 9.0"), ("# sd_mm is not set", "sd_mm = 5.0")];
        let own = values.iter().fold(text, |text, (from, to)| text.replace(from, to));
        let set = Settings::layer(&own, "own.toml").and_then(|layer| Settings::resolve([&layer])).unwrap();
        assert_eq!(set.predict.fluid_level.map(|level| level.below_top_mm), Some(9.0), "{own}");
        // A table is there whether or not one of its values is.
        assert!(annotated(&all).contains("\n[image]\n"));
    }

    #[test]
    fn every_key_of_the_file_is_told_with_what_it_is_and_no_more() {
        let settings = Settings::default();
        let all = every_setting(&settings);
        let silent: Vec<String> =
            all.iter().filter(|s| s.description.is_empty()).map(|s| format!("{}.{}", s.table, s.name)).collect();
        assert!(silent.is_empty(), "without a word: {silent:?}");
        let keys = settings.to_toml().lines().filter(|line| line.contains(" = ")).count();
        assert_eq!(all.iter().filter(|s| s.value.is_some()).count(), keys);
        let rim = all.iter().find(|s| s.table == "anat.cavity" && s.name == "rim_mm").unwrap();
        assert_eq!((rim.unit, &rim.value), (Some("mm"), &rim.default));
    }
}

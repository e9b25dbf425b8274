//! The settings file: every table of it is read and checked before anything is computed, also those that the command at
//! hand does not use. One file serves every command.

use super::case::EstimateOptions;
use super::{Failure, Reject};
use crate::experiment::phantom::PhantomSettings;
use crate::experiment::prior::PriorSettings;
use crate::experiment::resection::ResectionSettings;
use crate::experiment::synth::SynthSettings;
use crate::image::nifti::ReadOptions;
use crate::material::gp::FitSettings;
use crate::material::meta_model::MetaModelSettings;
use crate::material::toml_text::line_of;
use crate::mesh::engine::MeshSettings;
use crate::register::RigidSettings;
use crate::register::deformable::DeformableSettings;
use crate::resect::PairSettings;
use crate::segment::SegmentSettings;
use crate::tag::TagSettings;
use anyhow::anyhow;
use serde::de::DeserializeOwned;
use std::fmt::Display;

type Checked = Result<(), String>;

/// A table's name and how it is read.
type Table = (&'static str, fn(&toml::Value) -> Checked);

const TABLES: [Table; 14] = [
    ("anat", |table| of(table, PairSettings::check)),
    ("deformable", |table| of(table, DeformableSettings::check)),
    ("estimate", |table| of(table, EstimateOptions::check)),
    ("gp", |table| of::<FitSettings, String>(table, |_| Ok(()))),
    ("image", |table| of::<ReadOptions, String>(table, |_| Ok(()))),
    ("law", |table| of(table, MetaModelSettings::check)),
    ("mesh", |table| of(table, MeshSettings::check)),
    ("phantom", |table| of(table, PhantomSettings::check)),
    ("prior", |table| of::<PriorSettings, String>(table, |_| Ok(()))),
    ("register", |table| of(table, RigidSettings::check)),
    ("resection", |table| of(table, ResectionSettings::check)),
    ("segment", |table| of(table, SegmentSettings::check)),
    ("synth", |table| of(table, SynthSettings::check)),
    ("tag", |table| of::<TagSettings, String>(table, |_| Ok(()))),
];

/// The tables of a settings file's text.
///
/// # Errors
/// Rejected with file, line or table, setting and remedy.
pub fn tables(text: &str, file: &str) -> Result<toml::Table, Failure> {
    let config: toml::Table = text
        .parse()
        .map_err(|e: toml::de::Error| {
            anyhow!("{file}: line {}: {}; correct it", line_of(&e, text), in_words(e.message()))
        })
        .reject()?;
    for (room, table) in &config {
        let Some((_, read)) = TABLES.iter().find(|(name, _)| name == room) else {
            let known: Vec<&str> = TABLES.iter().map(|(name, _)| *name).collect();
            let known = known.join("], [");
            return Err(Failure::Rejected(anyhow!("{file}: there is no table [{room}]; the tables are [{known}]")));
        };
        read(table).map_err(|why| anyhow!("{file}: table [{room}]: {why}")).reject()?;
    }
    Ok(config)
}

/// One table as its room's settings.
///
/// # Errors
/// What does not fit, in words.
pub fn typed<T: DeserializeOwned>(table: &toml::Value) -> Result<T, String> {
    table
        .clone()
        .try_into()
        .map_err(|e: toml::de::Error| format!("{}; correct it or take it away", in_words(&e.to_string())))
}

fn of<T: DeserializeOwned, E: Display>(table: &toml::Value, check: fn(&T) -> Result<(), E>) -> Checked {
    check(&typed(table)?).map_err(|e| e.to_string())
}

/// What the TOML reader says, in one line and without the names of our types.
pub fn in_words(message: &str) -> String {
    let one_line = message.trim().replace('\n', " ");
    let mut words = Vec::new();
    let mut rest = one_line.split(' ');
    while let Some(word) = rest.next() {
        let bare = word.trim_end_matches([',', ';']);
        let said = match bare {
            "usize" | "u64" | "u32" | "u8" => "a whole number, 0 or more",
            "f64" => "a number",
            "struct" => {
                rest.next();
                "a table"
            }
            "variant" => "value",
            "field" if words.last().is_some_and(|w| w == "unknown" || w == "missing") => "setting",
            _ => bare,
        };
        words.push(format!("{said}{}", &word[bare.len()..]));
    }
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(text: &str) -> String {
        let Err(Failure::Rejected(error)) = tables(text, "my.toml") else { panic!("taken: {text}") };
        error.to_string()
    }

    #[test]
    fn every_slip_is_one_line_with_file_table_and_setting() {
        for (text, words) in [
            ("[register\n", ["my.toml: line 1", "correct"]),
            ("[registr]\n", ["no table [registr]", "[register]"]),
            ("[register]\nsample = 3\n", ["table [register]: unknown setting `sample`", "correct it"]),
            ("[register]\nsamples = \"many\"\n", ["table [register]", "a whole number"]),
            ("register = 10\n", ["table [register]", "a table"]),
            ("[resection]\npoisson_ratio = 0.6\n", ["table [resection]: `poisson_ratio` is 0.6", "below 0.5"]),
            ("[resection]\ntissues = 7\n", ["`tissues` is 7", "1 (the whole brain) or 2"]),
            ("[resection]\nsd_levels = [nan]\n", ["`sd_levels` is [NaN]", "-6 to 6"]),
            ("[phantom]\nbrain_shear_modulus_pa = -1.0\n", ["`brain_shear_modulus_pa` is -1.0", "above 0"]),
            ("[estimate]\nphantom_noise_mm = nan\n", ["`phantom_noise_mm` is NaN", "above 0"]),
            ("[estimate.descent]\niterations = 0\n", ["`iterations` is 0", "1 or more"]),
            ("[law]\nlog_offset_pa = -1.0\n", ["`log_offset_pa` is -1.0", "above 0"]),
            ("[mesh.limits]\ntime_s = -1.0\n", ["`limits.time_s` is -1.0", "0 or more"]),
            ("[anat.segment]\nbias_order = 9\n", ["table [anat]", "bias_order"]),
            ("[synth]\npost_slice_mm = 80.0\n", ["table [synth]", "post_slice_mm"]),
        ] {
            let said = said(text);
            assert!(words.iter().all(|w| said.contains(w)) && !said.contains('\n'), "{text:?}: {said:?}");
        }
    }

    #[test]
    fn a_file_with_tables_of_many_commands_is_taken() {
        let text = "[image]\nprefer = \"sform\"\n[resection]\ntissues = 2\n[mesh.limits]\ntime_s = 10.0\n";
        assert_eq!(tables(text, "my.toml").unwrap().len(), 3);
    }
}

//! Every setting of the program, a table for each room, resolved once: the defaults, over them the case's own, over those
//! a settings file, over that the command line.

use super::estimate_options::{EstimateOptions, Observed};
use crate::experiment::field::FieldSettings;
use crate::experiment::phantom::PhantomSettings;
use crate::experiment::predict::PredictSettings;
use crate::experiment::prior::PriorSettings;
use crate::experiment::resection::ResectionSettings;
use crate::experiment::synth::SynthSettings;
use crate::image::nifti::ReadOptions;
use crate::material::gp::FitSettings;
use crate::material::meta_model::MetaModelSettings;
use crate::mesh::engine::MeshSettings;
use crate::register::RigidSettings;
use crate::register::deformable::DeformableSettings;
use crate::resect::PairSettings;
use crate::segment::SegmentSettings;
use crate::tag::TagSettings;
use schemars::JsonSchema;
use serde::de::IntoDeserializer;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// The settings of every room.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Masks and labels of a pair.
    pub anat: PairSettings,
    /// The template carried onto a single head.
    pub deformable: DeformableSettings,
    /// The most probable moduli.
    pub estimate: EstimateOptions,
    /// Displacement fields.
    pub fields: FieldSettings,
    /// Hyperparameters of the generative model.
    pub gp: FitSettings,
    /// How files that leave a choice open are read.
    pub image: ReadOptions,
    /// Laws fitted to tests and literature.
    pub law: MetaModelSettings,
    /// The mesh.
    pub mesh: MeshSettings,
    /// The synthetic validation.
    pub phantom: PhantomSettings,
    /// Predictions before an operation.
    pub predict: PredictSettings,
    /// The prior of the moduli.
    pub prior: PriorSettings,
    /// Rigid registration.
    pub register: RigidSettings,
    /// A patient's loads, supports and samples.
    pub resection: ResectionSettings,
    /// A single head's labels.
    pub segment: SegmentSettings,
    /// Synthetic patients.
    pub synth: SynthSettings,
    /// Boundary sets.
    pub tag: TagSettings,
}

/// Why settings are refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub struct SettingsError {
    /// The file, where it is a file's fault and not that of the whole.
    pub file: Option<String>,
    /// The line, from 1.
    pub line: Option<usize>,
    /// The table.
    pub table: Option<String>,
    /// What is wrong, and the rule.
    pub reason: String,
}

impl Display for SettingsError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts = [
            self.file.clone(),
            self.line.map(|line| format!("line {line}")),
            self.table.as_ref().map(|table| format!("table [{table}]")),
            Some(self.reason.clone()),
        ];
        f.write_str(&parts.into_iter().flatten().collect::<Vec<_>>().join(": "))
    }
}

type Checked = Result<(), String>;

/// A table's name, how it is read, and its rules on values.
type Room = (&'static str, fn(ValueDeserializer<'_>) -> Result<(), toml::de::Error>, fn(&Settings) -> Checked);

fn read<T: for<'a> Deserialize<'a>>(value: ValueDeserializer<'_>) -> Result<(), toml::de::Error> {
    T::deserialize(value).map(|_| ())
}

fn kept<E: Display>(checked: Result<(), E>) -> Checked {
    checked.map_err(|e| e.to_string())
}

/// Refuses a population of patients who were posed otherwise than this one.
fn suits_prior(settings: &Settings) -> Result<(), String> {
    let own = &settings.resection;
    settings.prior.check(own.density_kg_per_m3, own.poisson_ratio, own.drained())
}

/// Refuses a fluid of unknown level where other settings take the load as known, or do not look at it.
fn suits_fluid(settings: &Settings) -> Result<(), String> {
    let estimate = &settings.estimate;
    if !estimate.fluid.may_be_unknown() {
        return Ok(());
    }
    if settings.prior.population.is_some() {
        let why =
            "a population's moduli are in proportion to one effective density; leave `fluid` or the population out";
        return Err(format!("`fluid` asks for a level that nobody knows, and {why}"));
    }
    if estimate.observed == Observed::Surfaces {
        let why = "`observed = \"surfaces\"` tries one body only; leave one of them out";
        return Err(format!("`fluid` asks for a level that nobody knows, and {why}"));
    }
    Ok(())
}

const ROOMS: [Room; 16] = [
    ("anat", read::<PairSettings>, |s| s.anat.check()),
    ("deformable", read::<DeformableSettings>, |s| kept(s.deformable.check())),
    ("estimate", read::<EstimateOptions>, |s| s.estimate.check().and_then(|()| suits_fluid(s))),
    ("fields", read::<FieldSettings>, |s| kept(s.fields.check())),
    ("gp", read::<FitSettings>, |_| Ok(())),
    ("image", read::<ReadOptions>, |_| Ok(())),
    ("law", read::<MetaModelSettings>, |s| s.law.check()),
    ("mesh", read::<MeshSettings>, |s| kept(s.mesh.check())),
    ("phantom", read::<PhantomSettings>, |s| kept(s.phantom.check())),
    ("predict", read::<PredictSettings>, |s| kept(s.predict.check())),
    ("prior", read::<PriorSettings>, suits_prior),
    ("register", read::<RigidSettings>, |s| kept(s.register.check())),
    ("resection", read::<ResectionSettings>, |s| kept(s.resection.check())),
    ("segment", read::<SegmentSettings>, |s| kept(s.segment.check())),
    ("synth", read::<SynthSettings>, |s| kept(s.synth.check())),
    ("tag", read::<TagSettings>, |_| Ok(())),
];

/// Tables that hold together (one of several choices, one cohort): the one above takes the place of the one below.
const CHOICES: [&str; 2] = ["mesh.size", "prior.population"];

impl Settings {
    /// The layers over the defaults, the last one over all others; values that no room takes are refused.
    ///
    /// # Errors
    /// [`SettingsError`] with table, value and rule.
    pub fn resolve<'a>(layers: impl IntoIterator<Item = &'a toml::Table>) -> Result<Self, SettingsError> {
        // From the defaults of the whole, not of its parts: those of `[anat.sag]` are not those of `[deformable]`.
        // Through texts: readers and writers of values without one would be compiled for every table besides.
        let defaults = Self::default().to_toml();
        let mut whole: toml::Table = defaults.parse().map_err(|e| unreadable(&e, &defaults))?;
        for layer in layers {
            lay_over(&mut whole, layer, "");
        }
        let whole = whole.to_string();
        let settings: Self = toml::from_str(&whole).map_err(|e| unreadable(&e, &whole))?;
        settings.check()?;
        Ok(settings)
    }

    /// One layer from the text of a settings file: every table is read and checked, also those that the job at hand does
    /// not use. One file serves every job.
    ///
    /// # Errors
    /// [`SettingsError`] with file, line, table, setting and rule.
    pub fn layer(text: &str, file: &str) -> Result<toml::Table, SettingsError> {
        let line = |at: usize| Some(1 + text.get(..at).unwrap_or("").matches('\n').count());
        let refuse = |line: Option<usize>, table: Option<&str>, reason: String| SettingsError {
            file: Some(file.to_owned()),
            line,
            table: table.map(str::to_owned),
            reason,
        };
        let broken = |e: toml::de::Error| {
            refuse(e.span().and_then(|s| line(s.start)), None, format!("{}; correct it", in_words(e.message())))
        };
        let parsed = DeTable::parse(text).map_err(broken)?;
        for (name, value) in parsed.into_inner() {
            let Some((room, read, _)) = ROOMS.iter().find(|(room, ..)| *room == name.get_ref().as_ref()) else {
                let known = ROOMS.map(|(room, ..)| room).join("], [");
                let reason = format!("there is no table [{}]; the tables are [{known}]", name.get_ref());
                return Err(refuse(line(name.span().start), None, reason));
            };
            read(spanned(value)).map_err(|e| {
                let reason = format!("{}; correct it or take it away", in_words(e.message()));
                refuse(e.span().and_then(|s| line(s.start)), Some(room), reason)
            })?;
        }
        let layer: toml::Table = text.parse().map_err(broken)?;
        // Values out of range are this file's fault, whatever lies under it.
        Self::resolve([&layer]).map_err(|e| SettingsError { file: Some(file.to_owned()), ..e })?;
        Ok(layer)
    }

    /// Refuses values that no room takes.
    ///
    /// # Errors
    /// [`SettingsError`] with table, value and rule.
    pub fn check(&self) -> Result<(), SettingsError> {
        for (room, _, check) in ROOMS {
            check(self).map_err(|reason| SettingsError {
                file: None,
                line: None,
                table: Some(room.to_owned()),
                reason,
            })?;
        }
        Ok(())
    }

    /// The text of `settings.toml`.
    ///
    /// # Panics
    /// Never: settings are plain data.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("settings are plain data")
    }
}

/// What is wrong with a text that nobody has written: table and setting stand for its line.
fn unreadable(said: &toml::de::Error, text: &str) -> SettingsError {
    let at = said.span().map_or(0, |span| span.start);
    let (before, rest) = text.split_at_checked(at).unwrap_or(("", text));
    let table = before.lines().rev().find_map(|line| line.strip_prefix('[')?.strip_suffix(']'));
    let line = [before.rsplit('\n').next(), rest.lines().next()].into_iter().flatten().collect::<String>();
    let setting = line.split_once(" = ").map_or_else(String::new, |(name, _)| format!("{name}: "));
    let reason = setting + &in_words(said.message());
    SettingsError { file: None, line: None, table: table.map(str::to_owned), reason }
}

fn spanned(value: Spanned<DeValue<'_>>) -> ValueDeserializer<'_> {
    value.into_deserializer()
}

fn lay_over(under: &mut toml::Table, over: &toml::Table, path: &str) {
    for (name, value) in over {
        let dotted = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match (under.get_mut(name), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) if !CHOICES.contains(&dotted.as_str()) => {
                lay_over(below, above, &dotted);
            }
            _ => {
                under.insert(name.clone(), value.clone());
            }
        }
    }
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
    use crate::mesh::engine::MeshSize;

    fn said(text: &str) -> String {
        Settings::layer(text, "my.toml").expect_err(text).to_string()
    }

    #[test]
    fn a_value_of_another_kind_in_no_file_is_refused_with_table_and_setting() {
        let refused =
            |layer: &str| Settings::resolve([&layer.parse::<toml::Table>().unwrap()]).unwrap_err().to_string();
        let kind = refused("[anat.sag]\nmargin_mm = \"wide\"\n");
        assert!(kind.contains("[anat.sag]") && kind.contains("margin_mm: "), "{kind}");
        let unknown = refused("[register]\nsample = 3\n");
        assert!(unknown.contains("[register]") && unknown.contains("sample"), "{unknown}");
    }

    #[test]
    fn every_slip_is_one_line_with_file_table_and_setting() {
        for (text, words) in [
            ("[register\n", ["my.toml: line 1", "correct"]),
            ("[registr]\n", ["line 1: there is no table [registr]", "[register]"]),
            ("[register]\nsample = 3\n", ["line 2: table [register]: unknown setting `sample`", "correct it"]),
            ("[register]\nsamples = \"many\"\n", ["line 2: table [register]", "a whole number"]),
            ("register = 10\n", ["table [register]", "a table"]),
            ("[resection]\npoisson_ratio = 0.6\n", ["table [resection]: `poisson_ratio` is 0.6", "below 0.5"]),
            ("[resection]\ntissues = 7\n", ["`tissues` is 7", "1 (the whole brain) or 2"]),
            ("[resection]\nsd_levels = [nan]\n", ["`sd_levels` is [NaN]", "-6 to 6"]),
            ("[phantom]\nbrain_shear_modulus_pa = -1.0\n", ["`brain_shear_modulus_pa` is -1.0", "above 0"]),
            ("[estimate]\nphantom_noise_mm = nan\n", ["`phantom_noise_mm` is NaN", "above 0"]),
            ("[estimate.descent]\niterations = 0\n", ["`iterations` is 0", "1 or more"]),
            ("[law]\nlog_offset_pa = -1.0\n", ["`log_offset_pa` is -1.0", "above 0"]),
            ("[mesh.limits]\ntime_s = -1.0\n", ["`limits.time_s` is -1.0", "above 0"]),
            ("[mesh.limits]\ntime_s = 0.0\n", ["`limits.time_s` is 0.0", "above 0"]),
            ("[anat.segment]\nbias_order = 9\n", ["table [anat]", "bias_order"]),
            ("[synth]\npost_slice_mm = 80.0\n", ["table [synth]", "post_slice_mm"]),
            ("[predict]\nheads = [\"0,0,0\"]\n", ["table [predict]", "no way to lie"]),
            ("[tag]\n\n[mesh.optimise]\nround = 2\n", ["line 4: table [mesh]", "unknown setting `round`"]),
        ] {
            let said = said(text);
            assert!(words.iter().all(|w| said.contains(w)) && !said.contains('\n'), "{text:?}: {said:?}");
        }
    }

    #[test]
    fn every_number_of_the_segmentation_and_the_cavity_has_a_range_that_its_default_lies_in() {
        let defaults: toml::Table = Settings::default().to_toml().parse().unwrap();
        let anat = defaults["anat"].as_table().unwrap();
        let segment = anat["segment"].as_table().unwrap();
        let tables = [
            ("anat.cavity", anat["cavity"].as_table().unwrap()),
            ("anat.segment", segment),
            ("anat.segment.brain", segment["brain"].as_table().unwrap()),
            ("anat.segment.ventricle", segment["ventricle"].as_table().unwrap()),
        ];
        for (table, numbers) in tables {
            for (name, _) in numbers.iter().filter(|(_, value)| value.is_float()) {
                for bad in ["-1.0", "nan", "inf", "-1e9"] {
                    let said = said(&format!("[{table}]\n{name} = {bad}\n"));
                    assert!(
                        said.contains("table [anat]") && said.contains(&format!("{name}`")),
                        "{table} {name}: {said}"
                    );
                }
            }
        }
        for (text, words) in [
            ("[anat.cavity]\nbias_sigma_mm = 0.0\n", "5 to 200 mm"),
            ("[anat.segment]\niterations = 0\n", "`iterations` is 0"),
            ("[segment]\nsmallest_brain_cc = 3000.0\n", "`largest_brain_cc` is 2200"),
        ] {
            assert!(said(text).contains(words), "{}", said(text));
        }
    }

    #[test]
    fn a_file_with_tables_of_many_commands_is_taken() {
        let text = "[image]\nprefer = \"sform\"\n[resection]\ntissues = 2\n[mesh.limits]\ntime_s = 10.0\n";
        assert_eq!(Settings::layer(text, "my.toml").unwrap().len(), 3);
    }

    #[test]
    fn a_part_of_a_table_leaves_the_rest_of_it_at_its_own_defaults() {
        let layer = "[anat.sag]\nmargin_mm = 3.5\n".parse::<toml::Table>().unwrap();
        let settings = Settings::resolve([&layer]).unwrap();
        let own = PairSettings::default().sag;
        assert_eq!(settings.anat.sag, DeformableSettings { margin_mm: 3.5, ..own });
    }

    #[test]
    fn a_layer_changes_what_it_names_and_nothing_else() {
        let layer = |text: &str| text.parse::<toml::Table>().unwrap();
        let own = layer("[anat.sag]\nmargin_mm = 3.5\n[mesh.size]\ncells = 9000\n[prior]\nlaw = \"ogden\"\n");
        let file = layer("[anat.sag]\naffine = true\n[mesh.size]\nedge_mm = 4.0\n");
        let settings = Settings::resolve([&own, &file]).unwrap();
        assert_eq!((settings.anat.sag.margin_mm, settings.anat.sag.affine), (3.5, true));
        assert_eq!(settings.mesh.size, MeshSize::EdgeMm(4.0));
        assert_eq!(settings.prior.law.name(), "ogden");
        assert_eq!(settings.register, RigidSettings::default());
    }

    #[test]
    fn what_is_written_is_read_back_as_it_was_and_holds_every_room() {
        let own = "[mesh]\nengine = \"gmsh\"\n[register]\nseed = 7\n".parse().unwrap();
        let settings = Settings::resolve([&own]).unwrap();
        let layer = Settings::layer(&settings.to_toml(), "settings.toml").unwrap();
        assert_eq!(layer.len(), ROOMS.len());
        assert_eq!(Settings::resolve([&layer]).unwrap(), settings);
    }
}

//! `population.toml`: what a cohort says of people, and the moments that it says so from.

use super::hierarchy::{Inferred, MEAN_SD, Population, SPREAD_SCALE, TooMany, narrows};
use super::kind::Kind;
use super::learnt::{LearntPrior, PopulationPrior};
use super::moments::Moments;
use crate::experiment::verdict::Finding;
use crate::material::meta_model::MetaModel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use thiserror::Error;

/// Raised when the keys change their meaning.
const FORMAT: u32 = 1;
/// Fewer patients than this are one study's worth, whatever their moduli: of a spread they say next to nothing.
const LEAST_PATIENTS: usize = 5;
/// A mean known no better than this share of the literature's own spread is one more study among the literature's.
const LEAST_KNOWN: f64 = 0.5;
/// A mean known no better than this share of its own prior has a sixteenth and more of its precision from there, whatever the
/// literature knows: the next patient's prior would be in part the hierarchy's.
const LEAST_OF_PATIENTS: f64 = 0.25;

/// Figures that differ by less than this, relative to 1 and themselves, are the same.
const SAME: f64 = 1e-6;

/// A population, as its file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PopulationFile {
    /// Version of the keys.
    pub format: u32,
    /// The program that wrote it.
    pub program: String,
    /// The law that every patient was estimated with.
    #[schemars(with = "String")]
    pub law: MetaModel,
    /// The effective density that every patient was estimated under, kg/m3.
    pub density_kg_per_m3: f64,
    /// The Poisson's ratio that every patient was estimated with; left out by older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poisson_ratio: Option<f64>,
    /// The part of a given fluid that had drained; left out without a fluid, and by older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drained: Option<f64>,
    /// Patients who teach.
    pub patients: usize,
    /// Patients who do not, by the reason.
    #[serde(default)]
    pub left_out: BTreeMap<String, usize>,
    /// What they teach, in the order of the moments.
    pub parameters: Vec<Taught>,
    /// What the scans of each patient say, by value and without names.
    pub moments: Vec<Moments>,
}

/// What a cohort says of one parameter; logarithms are natural, intervals 95 %.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Taught {
    /// As estimates call it.
    pub name: String,
    /// Patients whose scans say something of it: they alone halve what is not known of it before any patient.
    pub patients: usize,
    /// Mean of the logarithm over people.
    pub log_mean: f64,
    /// Its interval.
    pub log_mean_95: [f64; 2],
    /// Standard deviation of the logarithm between people.
    pub log_spread: f64,
    /// Its interval.
    pub log_spread_95: [f64; 2],
    /// The median over people, in the unit of the name.
    pub median: f64,
    /// Its interval.
    pub median_95: [f64; 2],
    /// Mean of the next patient's logarithm.
    pub next_log_mean: f64,
    /// Its standard deviation: of people, and of what is not known of them.
    pub next_log_sd: f64,
    /// Where the next patient will lie, in the unit of the name.
    pub next_95: [f64; 2],
    /// Mean of the logarithm that the literature expects.
    pub literature_log_mean: f64,
    /// Its standard deviation: that of what one more study would report.
    pub literature_log_sd: f64,
    /// Whether the next patient's prior is this one; else the cohort is one study's worth, or most of its patients showed no shift or
    /// contradicted what is known, and the literature's prior stands.
    pub moves_prior: bool,
}

impl Taught {
    /// Every figure that follows from the moments.
    fn figures(&self) -> Vec<(&'static str, f64)> {
        let one = [
            ("log_mean", self.log_mean),
            ("log_spread", self.log_spread),
            ("median", self.median),
            ("next_log_mean", self.next_log_mean),
            ("next_log_sd", self.next_log_sd),
        ];
        let intervals = [
            ("log_mean_95", self.log_mean_95),
            ("log_spread_95", self.log_spread_95),
            ("median_95", self.median_95),
            ("next_95", self.next_95),
        ];
        let ends = intervals.into_iter().flat_map(|(key, ends)| ends.map(|end| (key, end)));
        one.into_iter().chain(ends).collect()
    }
}

/// Whether more patients are left out for what their stiffness came out as than teach. Stiff brains move least, so such a cohort's
/// mean is that of its softer ones.
fn outnumbered(teachers: usize, left_out: &BTreeMap<String, usize>) -> bool {
    let silent = [Finding::NoShift, Finding::Conflict, Finding::ModelsDisagree];
    let silent = silent.map(|finding| left_out.get(finding.short()).copied().unwrap_or(0));
    silent.iter().sum::<usize>() > teachers
}

/// Why a population's file is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{file}: {reason}; make it with `hgm bids BIDS_DIR OUT group`")]
pub struct PopulationFileError {
    /// The file.
    pub file: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Why cohorts cannot be merged.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum MergeError {
    #[error(
        "{file}: its patients were estimated {its}, those of {first} {those}; moduli of both are not alike: merge cohorts of one kind"
    )]
    Otherwise { file: String, first: String, its: String, those: String },
    #[error("{file}: {count} of its patients are in another file, too; merge each cohort once")]
    Twice { file: String, count: usize },
    #[error(
        "{file}: `{name}` has another prior of the literature than in {first}; make both files with the same version of hgm"
    )]
    Literature { file: String, first: String, name: String },
    #[error(transparent)]
    TooMany(#[from] TooMany),
}

/// What the literature expects one more study to report of a parameter: mean and standard deviation of its logarithm. Not of a person,
/// of whom far less is known: a cohort that knows its mean no better than that is one study's worth all the same.
pub type Literature = (f64, f64);

impl PopulationFile {
    /// From what the scans of each patient say of these parameters, each with what the literature expects of it. A patient whose
    /// scans say nothing of any of them does not teach, and is none of its patients.
    ///
    /// # Errors
    /// [`TooMany`].
    pub fn new(
        kind: Kind,
        parameters: &[(String, Literature)],
        mut moments: Vec<Moments>,
        left_out: BTreeMap<String, usize>,
    ) -> Result<Self, TooMany> {
        // The order of the files that they came from says nothing, and sums in one order give the same bytes.
        moments.retain(Moments::tells);
        moments.sort_by(Moments::by_value);
        let names: Vec<String> = parameters.iter().map(|(name, _)| name.clone()).collect();
        let found = Population::infer(&names, &moments)?;
        let heard = !outnumbered(moments.len(), &left_out);
        let taught = |(n, (name, literature)): (usize, &(String, Literature))| {
            let patients = moments.iter().filter(|m| narrows(m, n)).count();
            let [mean, spread, next]: [Inferred; 3] = [found.mean(n), found.spread(n), found.next(n)];
            let known = mean.sd <= (LEAST_KNOWN * literature.1).min(LEAST_OF_PATIENTS * MEAN_SD);
            Taught {
                name: name.clone(),
                patients,
                log_mean: mean.mean,
                log_mean_95: mean.interval_95,
                log_spread: spread.mean,
                log_spread_95: spread.interval_95,
                median: mean.mean.exp(),
                median_95: mean.interval_95.map(f64::exp),
                next_log_mean: next.mean,
                next_log_sd: next.sd,
                next_95: next.interval_95.map(f64::exp),
                literature_log_mean: literature.0,
                literature_log_sd: literature.1,
                moves_prior: heard && patients >= LEAST_PATIENTS && known,
            }
        };
        Ok(Self {
            format: FORMAT,
            program: concat!("hgm ", env!("CARGO_PKG_VERSION")).to_owned(),
            law: kind.law,
            density_kg_per_m3: kind.density_kg_per_m3,
            poisson_ratio: kind.poisson_ratio,
            drained: kind.drained,
            patients: moments.len(),
            left_out,
            parameters: parameters.iter().enumerate().map(taught).collect(),
            moments,
        })
    }

    /// How its patients were estimated.
    pub fn kind(&self) -> Kind {
        let Self { law, density_kg_per_m3, poisson_ratio, drained, .. } = *self;
        Kind { law, density_kg_per_m3, poisson_ratio, drained }
    }

    /// The population behind it, for its own patients.
    ///
    /// # Errors
    /// [`TooMany`].
    pub fn population(&self) -> Result<Population, TooMany> {
        let names: Vec<String> = self.parameters.iter().map(|taught| taught.name.clone()).collect();
        Population::infer(&names, &self.moments)
    }

    /// The prior of the next patient: the parameters that the cohort knows well enough.
    pub fn prior(&self) -> PopulationPrior {
        let learnt =
            |t: &Taught| LearntPrior { name: t.name.clone(), log_mean: t.next_log_mean, log_sd: t.next_log_sd };
        PopulationPrior {
            law: self.law,
            density_kg_per_m3: self.density_kg_per_m3,
            poisson_ratio: self.poisson_ratio,
            drained: self.drained,
            patients: self.patients,
            parameters: self.parameters.iter().filter(|taught| taught.moves_prior).map(learnt).collect(),
        }
    }

    /// The file's text.
    ///
    /// # Panics
    /// Never: the figures are plain data.
    pub fn to_toml(&self) -> String {
        let head = format!(
            "# What a cohort says of people (hgm; Pa, kg/m3, natural logarithms, intervals of 95 %). `--population` of `hgm estimate`,\n\
             # `hgm run --estimate` and `hgm predict` takes it; `hgm population merge` joins it with those of other cohorts.\n\
             # It holds no name, no image and no date. Of each patient who teaches there is one Gaussian over the logarithms of the\n\
             # parameters, in their order: what the scans alone say, the prior of the estimate divided out, by value. `precision` is the\n\
             # inverse of its covariance, `information` that times its mean. All other figures follow from these.\n\
             # A patient's logarithms are normal about the population's mean, independent between parameters. Priors: means normal about\n\
             # ln 1000 (a density's: ln 100) with standard deviation {MEAN_SD}, spreads half normal of scale {SPREAD_SCALE}.\n\
             # `patients` of a parameter are those whose scans alone halve what is not known of it before any patient.\n\
             # `moves_prior = false`: fewer than {LEAST_PATIENTS} such patients, or a mean known no better than {LEAST_KNOWN} of what one more study\n\
             # would report (`literature_log_sd`) or {LEAST_OF_PATIENTS} of its own prior. That is one study's worth, and the literature's prior\n\
             # stands. So it does where more patients had no shift to be seen or contradicted what is known than teach: the mean\n\
             # is of those whose stiffness was identified, who may be the softer ones of all.\n\n"
        );
        head + &toml::to_string(self).expect("figures are plain data")
    }

    /// From a file's text.
    ///
    /// # Errors
    /// [`PopulationFileError`] with the file and what is wrong.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, PopulationFileError> {
        let refused = |reason: String| PopulationFileError { file: file.to_owned(), reason };
        let mut read: Self = toml::from_str(text).map_err(|error| {
            let line = crate::material::toml_text::line_of(&error, text);
            refused(format!("line {line}: {}", error.message().trim().replace('\n', " ")))
        })?;
        read.check().map_err(&refused)?;
        // Older files count patients whose scans say nothing.
        read.moments.retain(Moments::tells);
        read.patients = read.moments.len();
        read.check_figures().map_err(refused)?;
        Ok(read)
    }

    /// A figure that does not follow from the moments was written by hand, or for other patients.
    fn check_figures(&self) -> Result<(), String> {
        let known = |t: &Taught| (t.name.clone(), (t.literature_log_mean, t.literature_log_sd));
        let parameters: Vec<(String, Literature)> = self.parameters.iter().map(known).collect();
        let again = Self::new(self.kind(), &parameters, self.moments.clone(), self.left_out.clone())
            .map_err(|e| e.to_string())?;
        for (read, follows) in self.parameters.iter().zip(&again.parameters) {
            let name = &read.name;
            if (read.patients, read.moves_prior) != (follows.patients, follows.moves_prior) {
                let of = |t: &Taught| format!("`patients` {} and `moves_prior` {}", t.patients, t.moves_prior);
                return Err(format!("`{name}` has {}, its moments and `left_out` give {}", of(read), of(follows)));
            }
            let mut figures = read.figures().into_iter().zip(follows.figures());
            if let Some(((key, is), (_, should))) =
                figures.find(|((_, a), (_, b))| (a - b).abs() > SAME * (1.0 + b.abs()))
            {
                return Err(format!("`{key}` of `{name}` is {is}, and its moments give {should}"));
            }
        }
        Ok(())
    }

    fn check(&self) -> Result<(), String> {
        if self.format != FORMAT {
            return Err(format!("`format` is {}, and this hgm reads {FORMAT}", self.format));
        }
        if self.patients != self.moments.len() {
            return Err(format!("`patients` is {}, and there are {} `moments`", self.patients, self.moments.len()));
        }
        if self.parameters.is_empty() {
            return Err("there are no `parameters`".to_owned());
        }
        if !(self.density_kg_per_m3 > 0.0 && self.density_kg_per_m3.is_finite()) {
            return Err(format!("`density_kg_per_m3` is {}: it must be above 0", self.density_kg_per_m3));
        }
        if let Some(ratio) = self.poisson_ratio.filter(|ratio| !(0.0..0.5).contains(ratio)) {
            return Err(format!("`poisson_ratio` is {ratio}: it must be from 0 to below 0.5"));
        }
        if let Some(part) = self.drained.filter(|part| !(0.0..=1.0).contains(part)) {
            return Err(format!("`drained` is {part}: it must be a part from 0 to 1"));
        }
        for (n, taught) in self.parameters.iter().enumerate() {
            let name = &taught.name;
            if self.parameters[..n].iter().any(|earlier| earlier.name == *name) {
                return Err(format!("`parameters` holds `{name}` twice"));
            }
            let above_zero = [
                ("log_spread", taught.log_spread),
                ("next_log_sd", taught.next_log_sd),
                ("literature_log_sd", taught.literature_log_sd),
            ];
            if let Some((key, value)) = above_zero.into_iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
                return Err(format!("`{key}` of `{name}` is {value}: it must be above 0"));
            }
            let finite = [
                ("log_mean", taught.log_mean),
                ("next_log_mean", taught.next_log_mean),
                ("literature_log_mean", taught.literature_log_mean),
            ];
            if let Some((key, value)) = finite.into_iter().find(|(_, v)| !v.is_finite()) {
                return Err(format!("`{key}` of `{name}` is {value}: it must be a number"));
            }
        }
        let mut moments = self.moments.iter().enumerate();
        moments.try_for_each(|(n, m)| {
            m.check(self.parameters.len()).map_err(|e| format!("`moments` number {}: {e}", n + 1))
        })
    }
}

/// Cohorts as one, each with the name of its file: as if all patients had been in one cohort.
///
/// # Errors
/// [`MergeError`].
pub fn merged(files: &[(String, PopulationFile)]) -> Result<PopulationFile, MergeError> {
    let (first_name, first) = &files[0];
    // Older files tell less: the first that tells all is what the others are held against, and what the whole is.
    let (kind_name, kind) =
        files.iter().find(|(_, f)| f.kind().tells_fluid()).map_or((first_name, first.kind()), |(n, f)| (n, f.kind()));
    let mut parameters: BTreeMap<String, Literature> = BTreeMap::new();
    let mut left_out: BTreeMap<String, usize> = BTreeMap::new();
    for (name, file) in files {
        if !file.kind().is_as(&kind) {
            let (file, first, its) = (name.clone(), kind_name.clone(), file.kind().to_string());
            return Err(MergeError::Otherwise { file, first, its, those: kind.to_string() });
        }
        for taught in &file.parameters {
            let own = (taught.literature_log_mean, taught.literature_log_sd);
            let known = *parameters.entry(taught.name.clone()).or_insert(own);
            if (known.0 - own.0).abs() > 1e-6 || (known.1 - own.1).abs() > 1e-6 {
                let (file, first, name) = (name.clone(), first_name.clone(), taught.name.clone());
                return Err(MergeError::Literature { file, first, name });
            }
        }
        for (reason, count) in &file.left_out {
            *left_out.entry(reason.clone()).or_default() += count;
        }
    }
    let parameters: Vec<(String, Literature)> = parameters.into_iter().collect();
    let mut moments: Vec<Moments> = Vec::new();
    for (name, file) in files {
        let place = |wanted: &String| file.parameters.iter().position(|taught| taught.name == *wanted);
        let places: Vec<Option<usize>> = parameters.iter().map(|(wanted, _)| place(wanted)).collect();
        let own: Vec<Moments> = file.moments.iter().map(|m| m.among(&places)).collect();
        // Two people with the same figures to the last bit are one; all of whom nothing is known look alike.
        let count = own.iter().filter(|m| m.tells() && moments.contains(m)).count();
        if count > 0 {
            return Err(MergeError::Twice { file: name.clone(), count });
        }
        moments.extend(own);
    }
    Ok(PopulationFile::new(kind, &parameters, moments, left_out)?)
}

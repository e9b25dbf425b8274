//! What a cohort's estimates say of people: who teaches, the population, and each patient with what the others say.

use super::case_folder;
use crate::artefact::{check_apart, write_whole};
use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::population::{Kind, Literature, Moments, PopulationFile, PopulationPrior, merged};
use crate::experiment::prior::{PriorError, PriorSettings, law_priors};
use crate::experiment::sample::Tissue;
use crate::experiment::verdict::Finding;
use crate::report::cohort::{CohortPopulation, Member, Pupil, Status};
use crate::workflow::error::WorkflowError;
use crate::workflow::user_file::{read_text, shown};
use crate::workflow::{Case, Settings};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The file of a cohort's population below the derivatives.
pub const POPULATION: &str = "population.toml";
/// Names of the parameters that a population is of begin with one of these; room, pressure and direction are a scan's own.
const OF_PEOPLE: [&str; 2] = ["shear_modulus_pa of ", "effective density_kg_per_m3"];

/// A population, where somebody teaches, and what is told of it.
pub type Learnt = (Option<PopulationFile>, CohortPopulation);

/// Why an estimated patient does not teach; the file counts each by its words.
#[derive(Clone, Debug, Error)]
enum LeftOut {
    #[error("{}", .0.short())]
    Finding(Finding),
    #[error("{}", .0.name())]
    Status(Status),
    #[error("another law, density, Poisson's ratio or fluid than most")]
    OtherKind,
    #[error("moduli under a fluid of unknown level")]
    UnknownFluid,
    #[error("figures that are no Gaussian")]
    NoGaussian,
    #[error("scans that say nothing of what is learnt")]
    Silent,
}

/// One patient whose figures are an answer.
struct Teacher<'a> {
    id: &'a str,
    estimate: &'a EstimateOutcome,
    settings: Settings,
}

impl Teacher<'_> {
    /// What moduli must have in common to be one population's.
    fn kind(&self) -> Kind {
        let own = &self.settings.resection;
        Kind {
            law: self.settings.prior.law,
            density_kg_per_m3: own.density_kg_per_m3,
            poisson_ratio: Some(own.poisson_ratio),
            drained: own.drained(),
        }
    }
}

/// The population of a cohort and what it says of its own patients; nothing where no subject was estimated, and no population
/// where nobody teaches.
///
/// # Errors
/// A case whose settings cannot be read, a prior that does not exist, more parameters than can be inferred together.
pub fn learn(members: &[Member], cases: &Path) -> Result<Option<Learnt>, WorkflowError> {
    let mut left_out: BTreeMap<String, usize> = BTreeMap::new();
    let mut leave = |why: LeftOut| *left_out.entry(why.to_string()).or_default() += 1;
    let mut estimated = 0;
    let mut teachers = Vec::new();
    for member in members {
        let Some(outcome) = &member.outcome else { continue };
        let Some(estimate) = &outcome.estimate else { continue };
        estimated += 1;
        let finding = outcome.verdict.finding;
        match member.status {
            Status::Done if estimate.fluid.is_some() => leave(LeftOut::UnknownFluid),
            Status::Done if matches!(finding, Finding::Identified | Finding::Widened) => {
                let own = Case::at(&case_folder(cases, &member.participant_id)).settings()?;
                teachers.push(Teacher { id: &member.participant_id, estimate, settings: Settings::resolve([&own])? });
            }
            Status::Done => leave(LeftOut::Finding(finding)),
            _ => leave(LeftOut::Status(member.status.clone())),
        }
    }
    let kinds = |t: &Teacher<'_>| teachers.iter().filter(|other| other.kind() == t.kind()).count();
    // The first of the most frequent kinds, in the order of the subjects.
    let most = teachers.iter().map(kinds).max().unwrap_or(0);
    let chosen = teachers.iter().find(|t| kinds(t) == most).map(Teacher::kind);
    teachers.retain(|t| {
        let same = Some(t.kind()) == chosen;
        if !same {
            leave(LeftOut::OtherKind);
        }
        same
    });
    let mut names: Vec<String> = teachers.iter().flat_map(|t| t.estimate.posterior.names.clone()).collect();
    names.retain(|name| OF_PEOPLE.iter().any(|begin| name.starts_with(begin)));
    names.sort();
    names.dedup();
    let mut taught = Vec::new();
    for teacher in teachers {
        match Moments::of_estimate(teacher.estimate, &names) {
            Some(moments) if moments.tells() => taught.push((teacher, moments)),
            Some(_) => leave(LeftOut::Silent),
            None => leave(LeftOut::NoGaussian),
        }
    }
    let (Some((first, _)), Some(chosen)) = (taught.first(), chosen) else {
        let told = CohortPopulation { patients: 0, left_out, parameters: Vec::new(), subjects: Vec::new() };
        return Ok((estimated > 0).then_some((None, told)));
    };
    let parameters = names
        .into_iter()
        .map(|name| literature(&name, &first.settings).map(|known| (name, known)))
        .collect::<Result<Vec<_>, _>>()?;
    let moments: Vec<Moments> = taught.iter().map(|(_, moments)| moments.clone()).collect();
    let file = PopulationFile::new(chosen, &parameters, moments, left_out)?;
    let population = file.population()?;
    let pupil = |(teacher, moments): &(Teacher<'_>, Moments)| Pupil {
        participant_id: teacher.id.to_owned(),
        shrunken: population.shrunken(moments),
    };
    let subjects: Vec<Pupil> = taught.iter().map(pupil).collect();
    let told = CohortPopulation {
        patients: file.patients,
        left_out: file.left_out.clone(),
        parameters: file.parameters.clone(),
        subjects,
    };
    Ok(Some((Some(file), told)))
}

/// What the literature expects one more study to report of a parameter; estimates start from a person, of whom it knows less.
fn literature(name: &str, settings: &Settings) -> Result<Literature, PriorError> {
    let Some(tissue) = name.strip_prefix(OF_PEOPLE[0]) else {
        return Ok((settings.resection.density_kg_per_m3.ln(), settings.estimate.density_log_sd));
    };
    let tissue = Tissue { name: tissue.to_owned(), labels: Vec::new() };
    let prior = PriorSettings { population: None, ..settings.prior.clone() };
    let known = law_priors(&[tissue], &prior)?;
    let modulus = known.into_iter().map(|(_, known)| known).find(|known| known.name == name);
    let study = modulus.map(|known| known.of_average());
    Ok(study.map_or((0.0, 1.0), |known| (known.mean, known.sd.unwrap_or(1.0))))
}

/// A cohort's population from its file.
///
/// # Errors
/// A file that cannot be read or is no population.
pub fn read_population(path: &Path) -> Result<PopulationFile, WorkflowError> {
    Ok(PopulationFile::from_toml(&read_text(path)?, &path.display().to_string())?)
}

/// The prior that a job takes from a population's file.
///
/// # Errors
/// As [`read_population`].
pub fn population_prior(path: &Path) -> Result<PopulationPrior, WorkflowError> {
    Ok(read_population(path)?.prior())
}

/// Several cohorts' files as one, into `output`.
///
/// # Errors
/// A file that is no population; cohorts of different kinds, or one that was given twice; an output that is one of them; the disk's.
pub fn merge_populations(paths: &[PathBuf], output: &Path) -> Result<PopulationFile, WorkflowError> {
    check_apart([output], paths)?;
    let files = paths
        .iter()
        .map(|path| Ok((shown(path), read_population(path)?)))
        .collect::<Result<Vec<_>, WorkflowError>>()?;
    let all = merged(&files)?;
    write_whole(output, all.to_toml().as_bytes())?;
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::estimate::LogPrior;
    use crate::experiment::outcome::ExperimentOutcome;
    use crate::experiment::verdict::Verdict;
    use serde_json::json;

    const BRAIN: &str = "shear_modulus_pa of brain";

    /// A parameter as it was found (mode in its unit, sd of its logarithm), and mean and sd of its logarithm before.
    type Found<'a> = (&'a str, f64, f64, (f64, f64));

    /// A subject whose brain was found to have this modulus, known to a seventh, under the prior of these settings.
    fn member(n: usize, modulus_pa: f64, finding: Finding, settings: &Settings) -> Member {
        subject(n, finding, &[(BRAIN, modulus_pa, 0.15, literature(BRAIN, settings).unwrap())])
    }

    fn subject(n: usize, finding: Finding, found: &[Found<'_>]) -> Member {
        let one = |place: usize, sd: f64| (0..found.len()).map(|k| if k == place { sd * sd } else { 0.0 }).collect();
        let covariance: Vec<Vec<f64>> =
            found.iter().enumerate().map(|(place, (_, _, sd, _))| one(place, *sd)).collect();
        let prior = |(name, _, _, (mean, sd)): &Found<'_>| json!({"name": name, "mean": mean, "sd": sd});
        let estimate: EstimateOutcome = serde_json::from_value(json!({
            "posterior": {
                "names": found.iter().map(|one| one.0).collect::<Vec<_>>(), "mode": found.iter().map(|one| one.1).collect::<Vec<_>>(),
                "log_sd": found.iter().map(|one| one.2).collect::<Vec<_>>(), "interval_95": vec![[1.0, 2.0]; found.len()],
                "log_covariance": covariance,
                "identifiability": {
                    "verdicts": vec!["identified"; found.len()], "sensitivity_correlation": [], "condition": 1.0, "valley": [],
                    "valley_log_sd": 1.0,
                },
            },
            "prior": found.iter().map(prior).collect::<Vec<_>>(), "observations": 1, "independent_observations": 1.0,
            "noise_mm": 0.2, "residual_rms_mm": 0.2, "convergence": "step-below-tolerance", "solves": 1, "tangent_solves": 1,
            "limits": [],
        }))
        .unwrap();
        let verdict = Verdict { finding, ..Verdict::default() };
        let outcome = ExperimentOutcome { estimate: Some(estimate), verdict, ..ExperimentOutcome::default() };
        Member {
            participant_id: format!("sub-{n:02}"),
            status: Status::Done,
            message: None,
            has_page: true,
            outcome: Some(outcome),
            settings_sha256: None,
        }
    }

    #[test]
    fn those_whose_stiffness_is_an_answer_teach_and_the_others_are_counted_by_their_reason() {
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings::default();
        let mut members: Vec<Member> =
            (0..8).map(|n| member(n, 500.0 + 25.0 * n as f64, Finding::Identified, &settings)).collect();
        members.push(member(8, 640.0, Finding::Widened, &settings));
        members.push(member(9, 9000.0, Finding::Conflict, &settings));
        members.push(member(10, 600.0, Finding::NoShift, &settings));
        members.push(Member { status: Status::QualityGate, ..member(11, 600.0, Finding::Identified, &settings) });
        // Others under another density, which a modulus is in proportion to, another Poisson's ratio, and in a fluid.
        let others = [
            "density_kg_per_m3 = 50.0",
            "poisson_ratio = 0.49",
            "density_kg_per_m3 = 1040.0\n[resection.csf]\ndrained = 0.5",
        ];
        for (n, other) in (12..).zip(others) {
            let case = case_folder(folder.path(), &format!("sub-{n}"));
            std::fs::create_dir_all(&case).unwrap();
            std::fs::write(case.join(crate::layout::SETTINGS), format!("[resection]\n{other}\n")).unwrap();
            members.push(member(n, 300.0, Finding::Identified, &settings));
        }
        let (file, told) = learn(&members, folder.path()).unwrap().unwrap();
        let file = file.unwrap();
        assert_eq!((file.patients, file.poisson_ratio, file.drained), (9, Some(0.45), None));
        let left: Vec<(&str, usize)> = told.left_out.iter().map(|(why, n)| (why.as_str(), *n)).collect();
        let expected = [
            "another law, density, Poisson's ratio or fluid than most",
            "contradicts what is known",
            "no shift seen",
            "quality-gate",
        ];
        assert_eq!(left, expected.into_iter().zip([3, 1, 1, 1]).collect::<Vec<_>>());
        assert!(told.sentences()[0].starts_with("9 of 15 estimated patients teach"), "{:?}", told.sentences());
        // Drawn towards the others, the lowest up and the highest of the eight down.
        let of = |n: usize| told.subjects[n].shrunken[0].value;
        assert!(of(0) > 500.0 && of(7) < 675.0 && of(0) < of(7), "{} {}", of(0), of(7));
        let text = file.to_toml();
        assert!(!text.contains("sub-"), "a name travels");
    }

    #[test]
    fn the_literatures_prior_stands_for_a_tissue_that_the_scans_hardly_know_beside_one_that_they_know() {
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings::default();
        let before = law_priors(&Tissue::grey_and_white(), &settings.prior).unwrap();
        let [grey, white] = [0, 1].map(|n| &before[n].1);
        // What scans say by themselves, with what an estimate knows of a person before.
        let found = |prior: &LogPrior, said: f64, own_sd: f64| {
            let sd = prior.sd.unwrap();
            let precision = own_sd.powi(-2) + sd.powi(-2);
            let mean = (said * own_sd.powi(-2) + prior.mean * sd.powi(-2)) / precision;
            (mean.exp(), precision.powf(-0.5), (prior.mean, sd))
        };
        for vague in [0.7, 1.0, 2.4] {
            let patient = |n: usize| {
                let step = n as f64 - 2.0;
                let (mode, sd, known) = found(grey, 6.7 + 0.05 * step, 0.1);
                let (other_mode, other_sd, other_known) = found(white, 6.9 + 0.3 * step, vague);
                let both = [(&*grey.name, mode, sd, known), (&*white.name, other_mode, other_sd, other_known)];
                subject(n, Finding::Identified, &both)
            };
            let members: Vec<Member> = (0..5).map(patient).collect();
            let file = learn(&members, folder.path()).unwrap().unwrap().0.unwrap();
            let moved: Vec<bool> = file.parameters.iter().map(|taught| taught.moves_prior).collect();
            assert_eq!(moved, [true, false], "{vague}: {:?}", file.parameters);
            let prior = PriorSettings { population: Some(file.prior()), ..settings.prior.clone() };
            assert_eq!(prior.learnt(white.clone()), *white);
            assert_ne!(prior.learnt(grey.clone()), *grey);
            // It is held against one more study, not against the person that the estimates start from.
            let study = white.average.unwrap();
            let held = &file.parameters[1];
            assert_eq!((held.literature_log_mean, held.literature_log_sd), (study.mean, study.sd));
            assert!(white.sd.unwrap() > 2.0 * study.sd);
        }
    }

    #[test]
    fn a_cohort_in_which_nobody_teaches_says_so_and_one_without_estimates_says_nothing() {
        let settings = Settings::default();
        let folder = tempfile::tempdir().unwrap();
        let members = [member(0, 500.0, Finding::Unexplained, &settings)];
        let (file, told) = learn(&members, folder.path()).unwrap().unwrap();
        assert!(file.is_none() && told.sentences()[0].starts_with("none of 1 estimated patients teaches"));
        let none = Member { outcome: None, ..members[0].clone() };
        assert!(learn(&[none], folder.path()).unwrap().is_none());
    }
}

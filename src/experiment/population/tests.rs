//! Cohorts drawn from populations that are known.

use super::*;
use crate::experiment::estimate::EstimateOutcome;
use crate::experiment::verdict::Finding;
use crate::material::meta_model::MetaModel;
use crate::material::random::CounterRng;
use nalgebra::{DMatrix, DVector};
use serde_json::json;
use std::collections::BTreeMap;

const GREY: &str = "shear_modulus_pa of grey_matter";
const WHITE: &str = "shear_modulus_pa of white_matter";
/// The literature's prior: mean and standard deviation of ln(modulus).
const LITERATURE: [Literature; 2] = [(7.009, 0.369), (6.424, 0.336)];
/// Of people: the literature is off by most of its spread for grey matter.
const MEANS: [f64; 2] = [6.75, 6.5];
const SPREADS: [f64; 2] = [0.3, 0.2];

fn names() -> Vec<String> {
    [GREY, WHITE].map(str::to_owned).to_vec()
}

fn parameters() -> Vec<(String, Literature)> {
    names().into_iter().zip(LITERATURE).collect()
}

/// The estimate that scans of this say (mean, covariance) lead to under the literature's prior, with a mesh's own error.
fn estimate(said: &DVector<f64>, noise: &DMatrix<f64>, mesh: [f64; 2]) -> EstimateOutcome {
    let prior = DMatrix::from_diagonal(&DVector::from_iterator(2, LITERATURE.iter().map(|l| l.1.powi(2))));
    let middle = DVector::from_iterator(2, LITERATURE.iter().map(|l| l.0));
    let [of_scans, of_prior] = [noise, &prior].map(|c| c.clone().try_inverse().unwrap());
    let covariance = (&of_scans + &of_prior).try_inverse().unwrap();
    let mean = &covariance * (&of_scans * said + &of_prior * middle);
    let covariance = covariance + DMatrix::from_diagonal(&DVector::from_iterator(2, mesh.map(|e| e * e)));
    let rows: Vec<Vec<f64>> = covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    let prior: Vec<_> = [GREY, WHITE]
        .iter()
        .zip(LITERATURE)
        .map(|(name, (mean, sd))| json!({"name": name, "mean": mean, "sd": sd, "scale": "logarithm"}))
        .collect();
    serde_json::from_value(json!({
        "posterior": {
            "names": names(), "mode": mean.iter().map(|m| m.exp()).collect::<Vec<_>>(),
            "log_sd": [rows[0][0].sqrt(), rows[1][1].sqrt()], "interval_95": [[1.0, 2.0], [1.0, 2.0]], "log_covariance": rows,
            "identifiability": {
                "verdicts": ["identified", "identified"], "sensitivity_correlation": [], "condition": 1.0, "valley": [],
                "valley_log_sd": 1.0,
            },
        },
        "prior": prior, "mesh_log_sd": mesh, "observations": 1, "independent_observations": 1.0, "noise_mm": 0.2,
        "residual_rms_mm": 0.2, "convergence": "step-below-tolerance", "solves": 1, "tangent_solves": 1, "limits": [],
    }))
    .unwrap()
}

/// Patients of the population: each one's true logarithms, and the estimate of their scans.
fn cohort(patients: u64, seed: u64) -> Vec<([f64; 2], EstimateOutcome)> {
    let (rng, noise_rng) = (CounterRng::new(seed, 21), CounterRng::new(seed, 22));
    let one = |n: u64| {
        let z: Vec<f64> = (0..4).map(|k| rng.normal(8 * n + k)).collect();
        let truth = [MEANS[0] + SPREADS[0] * z[0], MEANS[1] + SPREADS[1] * z[1]];
        // From scans that say much to scans that say little; what softens one tissue stiffens the other.
        let sd = [0, 1].map(|k| noise_rng.between(2 * n + k, 0.08, 0.35));
        let correlation: f64 = -0.4;
        let noise = DMatrix::from_row_slice(
            2,
            2,
            &[sd[0].powi(2), correlation * sd[0] * sd[1], correlation * sd[0] * sd[1], sd[1].powi(2)],
        );
        let error = noise.clone().cholesky().unwrap().l() * DVector::from_vec(vec![z[2], z[3]]);
        let mesh = [0.05, 0.03];
        let own = [rng.normal(8 * n + 6) * mesh[0], rng.normal(8 * n + 7) * mesh[1]];
        let said = DVector::from_vec(vec![truth[0] + error[0], truth[1] + error[1]]);
        let mut found = estimate(&said, &noise, mesh);
        // The mesh's error moves the mode, after everything.
        for k in 0..2 {
            found.posterior.mode[k] *= own[k].exp();
        }
        (truth, found)
    };
    (0..patients).map(one).collect()
}

fn moments(cohort: &[([f64; 2], EstimateOutcome)]) -> Vec<Moments> {
    cohort.iter().map(|(_, found)| Moments::of_estimate(found, &names()).unwrap()).collect()
}

/// How they were all estimated.
const KIND: Kind =
    Kind { law: MetaModel::NEO_HOOKEAN, density_kg_per_m3: 100.0, poisson_ratio: Some(0.45), drained: None };

fn file(moments: Vec<Moments>) -> PopulationFile {
    PopulationFile::new(KIND, &parameters(), moments, BTreeMap::new()).unwrap()
}

#[test]
fn the_prior_is_divided_out_and_the_mesh_error_belongs_to_what_the_scans_say() {
    let said = DVector::from_vec(vec![6.4, 6.9]);
    let noise = DMatrix::from_row_slice(2, 2, &[0.04, -0.01, -0.01, 0.0225]);
    let mesh = [0.1, 0.2];
    let found = Moments::of_estimate(&estimate(&said, &noise, mesh), &names()).unwrap();
    let expected = noise + DMatrix::from_diagonal(&DVector::from_iterator(2, mesh.map(|e| e * e)));
    let (precision, information) = found.parts();
    let covariance = precision.try_inverse().unwrap();
    assert!((&covariance - expected).amax() < 1e-9);
    assert!((covariance * information - said).amax() < 1e-9);
}

#[test]
fn scans_that_say_nothing_teach_nothing_and_a_parameter_that_was_not_estimated_is_left_unknown() {
    let said = DVector::from_vec(vec![6.4, 6.9]);
    let found = estimate(&said, &(DMatrix::identity(2, 2) * 1e9), [0.0; 2]);
    let nothing = Moments::of_estimate(&found, &names()).unwrap();
    assert!(!nothing.tells_of(0) && !nothing.tells_of(1), "{nothing:?}");
    let brain = "shear_modulus_pa of brain".to_owned();
    let found = estimate(&said, &(DMatrix::identity(2, 2) * 0.01), [0.0; 2]);
    let three = Moments::of_estimate(&found, &[GREY.to_owned(), brain.clone(), WHITE.to_owned()]).unwrap();
    assert!(three.tells_of(0) && !three.tells_of(1) && three.tells_of(2));
    assert_eq!(Moments::of_estimate(&found, &[brain]), None);
}

/// The bars of the cohort: in each of twenty seeded cohorts of forty patients the known means and spreads against their
/// intervals, and shrunken moduli against what each patient's scans say alone.
#[test]
fn known_populations_lie_inside_their_intervals_and_shrunken_moduli_are_nearer_to_the_truth() {
    let (mut inside, mut nearer) = ([0; 4], 0);
    let (mut of_cohorts, mut under_literature) = (0.0, 0.0);
    for seed in 0..20 {
        let cohort = cohort(40, seed);
        let moments = moments(&cohort);
        let found = Population::infer(&names(), &moments).unwrap();
        for n in 0..2 {
            let holds = |i: [f64; 2], x: f64| usize::from(i[0] <= x && x <= i[1]);
            inside[n] += holds(found.mean(n).interval_95, MEANS[n]);
            inside[2 + n] += holds(found.spread(n).interval_95, SPREADS[n]);
        }
        let (mut single, mut shrunken) = (0.0, 0.0);
        for ((truth, own), said) in cohort.iter().zip(&moments) {
            let (precision, information) = said.parts();
            let alone = precision.try_inverse().unwrap() * information;
            for (n, with_others) in found.shrunken(said).iter().enumerate() {
                single += (alone[n] - truth[n]).powi(2);
                shrunken += (with_others.value.ln() - truth[n]).powi(2);
                under_literature += (own.posterior.mode[n].ln() - truth[n]).powi(2);
            }
        }
        nearer += usize::from(shrunken < single);
        of_cohorts += shrunken;
    }
    // Means of grey and white matter, then their spreads.
    assert!(inside.iter().all(|count| *count >= 18), "{inside:?}");
    assert_eq!(nearer, 20);
    // The literature's prior shrinks single estimates, too: over all cohorts people's own mean and spread do so better.
    assert!(of_cohorts < 0.9 * under_literature, "{of_cohorts} {under_literature}");
}

#[test]
fn two_halves_merge_to_the_whole_and_nobody_is_counted_twice() {
    let moments = moments(&cohort(40, 3));
    let whole = file(moments.clone());
    let halves = [moments[..17].to_vec(), moments[17..].to_vec()].map(file);
    let named = |n: usize| (format!("half-{n}.toml"), halves[n].clone());
    let joined = merged(&[named(0), named(1)]).unwrap();
    assert_eq!(joined, whole);
    assert_eq!(merged(&[named(1), named(0)]).unwrap().to_toml(), whole.to_toml());
    assert!(matches!(merged(&[named(0), named(0)]), Err(MergeError::Twice { count: 17, .. })));
    let mut other = halves[1].clone();
    other.density_kg_per_m3 = 50.0;
    assert!(matches!(merged(&[named(0), ("b".to_owned(), other)]), Err(MergeError::Otherwise { .. })));
    let mut other = halves[1].clone();
    other.parameters[0].literature_log_mean += 0.01;
    assert!(matches!(merged(&[named(0), ("b".to_owned(), other)]), Err(MergeError::Literature { .. })));
}

#[test]
fn cohorts_of_one_and_of_two_tissues_merge_and_each_teaches_its_own() {
    let two = moments(&cohort(12, 5));
    let white_alone: Vec<Moments> = moments(&cohort(9, 6)).iter().map(|m| m.among(&[Some(1)])).collect();
    let one = PopulationFile::new(
        KIND,
        &[(WHITE.to_owned(), LITERATURE[1])],
        white_alone,
        BTreeMap::from([("no shift seen".to_owned(), 2)]),
    )
    .unwrap();
    let joined = merged(&[("two".to_owned(), file(two)), ("one".to_owned(), one)]).unwrap();
    let told: Vec<(&str, usize)> = joined.parameters.iter().map(|p| (p.name.as_str(), p.patients)).collect();
    assert_eq!(told, [(GREY, 12), (WHITE, 21)]);
    assert_eq!((joined.patients, joined.left_out["no shift seen"]), (21, 2));
}

#[test]
fn who_says_nothing_does_not_teach_and_is_nobody_twice() {
    let silent = Moments::new(&DMatrix::zeros(2, 2), &DVector::zeros(2));
    assert!(!silent.tells() && !silent.tells_of(0));
    let all = moments(&cohort(20, 3));
    let halves = [&all[..8], &all[8..]].map(<[Moments]>::to_vec);
    let with_silent = halves.clone().map(|half| file([half, vec![silent.clone()]].concat()));
    assert_eq!(with_silent, halves.map(file));
    assert_eq!(with_silent[0].patients, 8);
    // As files of before have them: counted, and in each of two files.
    let older = with_silent.clone().map(|mut half| {
        half.moments.push(silent.clone());
        half.patients += 1;
        half
    });
    for (half, old) in with_silent.iter().zip(&older) {
        assert_eq!(PopulationFile::from_toml(&old.to_toml(), "old.toml").unwrap(), *half);
    }
    let named: Vec<(String, PopulationFile)> = older.into_iter().map(|half| ("old.toml".to_owned(), half)).collect();
    assert_eq!(merged(&named).unwrap(), file(all));
    // Who teaches is somebody all the same.
    assert!(matches!(merged(&[named[0].clone(), named[0].clone()]), Err(MergeError::Twice { count: 8, .. })));
}

#[test]
fn a_small_cohort_is_one_studys_worth_and_a_large_one_moves_the_prior() {
    let all = moments(&cohort(40, 9));
    let small = file(all[..4].to_vec());
    assert!(small.parameters.iter().all(|p| !p.moves_prior) && small.prior().parameters.is_empty());
    let large = file(all);
    let prior = large.prior();
    for (n, taught) in large.parameters.iter().enumerate() {
        assert!(taught.moves_prior);
        // The next patient is spread as people are, by a little more: their mean is not known exactly.
        let learnt = prior.of(&taught.name).unwrap();
        assert!(learnt.log_sd > taught.log_spread && learnt.log_sd < 1.4 * taught.log_spread);
        assert!((learnt.log_mean - MEANS[n]).abs() < 0.2, "{learnt:?}");
    }
}

#[test]
fn a_mean_that_is_in_part_the_hierarchys_own_moves_no_prior_however_little_the_literature_knows() {
    let anything = [(WHITE.to_owned(), (7.5, 5.0))];
    let of = |own_sd: f64| {
        let precision = own_sd.powi(-2);
        let patient = |n: i32| Moments {
            information: vec![(6.9 + 0.1 * f64::from(n - 2)) * precision],
            precision: vec![vec![precision]],
        };
        let file = PopulationFile::new(KIND, &anything, (0..5).map(patient).collect(), BTreeMap::new()).unwrap();
        (file.parameters[0].patients, file.parameters[0].moves_prior)
    };
    // To a factor of eleven they say nothing, to one of three too little, to a tenth enough.
    assert_eq!([2.4, 1.15, 0.1].map(of), [(0, false), (5, false), (5, true)]);
}

#[test]
fn a_cohort_whose_silent_patients_outnumber_its_teachers_moves_no_prior() {
    let all = moments(&cohort(40, 9));
    let beside = |no_shift: usize, conflict: usize| {
        let short = |finding: Finding, count| (finding.short().to_owned(), count);
        let left_out = BTreeMap::from([short(Finding::NoShift, no_shift), short(Finding::Conflict, conflict)]);
        PopulationFile::new(KIND, &parameters(), all.clone(), left_out).unwrap()
    };
    assert!(beside(20, 20).parameters.iter().all(|taught| taught.moves_prior));
    let disagree = BTreeMap::from([(Finding::ModelsDisagree.short().to_owned(), 41)]);
    let disagree = PopulationFile::new(KIND, &parameters(), all.clone(), disagree).unwrap();
    assert!(disagree.parameters.iter().all(|taught| !taught.moves_prior));
    let silent = beside(21, 20);
    assert!(silent.parameters.iter().all(|taught| !taught.moves_prior) && silent.prior().parameters.is_empty());
    assert_eq!(PopulationFile::from_toml(&silent.to_toml(), "p.toml").unwrap(), silent);
}

#[test]
fn a_file_reads_back_and_a_slip_in_it_is_refused_by_name() {
    let written = file(moments(&cohort(6, 1)));
    let text = written.to_toml();
    assert_eq!(PopulationFile::from_toml(&text, "p.toml").unwrap(), written);
    for (from, to, said) in [
        ("format = 1", "format = 9", "`format` is 9"),
        ("patients = 6", "patients = 7", "there are 6 `moments`"),
        ("patients = 6", "patient = 6", "`patient`"),
        ("poisson_ratio = 0.45", "poisson_ratio = 0.5", "`poisson_ratio` is 0.5"),
        ("poisson_ratio = 0.45", "drained = 1.5", "`drained` is 1.5"),
        ("next_log_sd = ", "next_log_sd = -", "`next_log_sd`"),
        ("information = [", "information = [1.0, ", "must have 2 numbers"),
        ("law = \"neo-hookean\"", "law = \"neo\"", "neo"),
        ("next_log_mean = ", "next_log_mean = 1", "its moments give"),
        ("median_95 = [", "median_95 = [1", "`median_95`"),
        ("moves_prior = true", "moves_prior = false", "`moves_prior` false"),
    ] {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from}");
        let refused = PopulationFile::from_toml(&broken, "p.toml").unwrap_err().to_string();
        assert!(refused.starts_with("p.toml: ") && refused.contains(said) && refused.contains("hgm bids"), "{refused}");
    }
}

#[test]
fn the_same_patients_give_the_same_bytes_in_any_order_and_on_one_thread() {
    let mut moments = moments(&cohort(8, 2));
    let text = file(moments.clone()).to_toml();
    moments.reverse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| file(moments)).to_toml(), text);
}

#[test]
fn a_prior_learnt_under_another_law_or_density_is_refused() {
    let prior = file(moments(&cohort(40, 4))).prior();
    assert_eq!(prior.check(&KIND), Ok(()));
    let refused = |job: Kind| prior.check(&job).unwrap_err();
    let ogden = Kind { law: MetaModel::OGDEN, ..KIND };
    assert!(refused(ogden).contains("`law = \"neo-hookean\"` in the table [prior]"));
    assert!(refused(Kind { density_kg_per_m3: 200.0, ..KIND }).contains("200"));
    assert_eq!(PopulationPrior::none().check(&ogden), Ok(()));
}

#[test]
fn a_prior_learnt_with_another_poissons_ratio_or_fluid_is_refused_and_an_older_one_that_does_not_tell_is_taken() {
    let prior = file(moments(&cohort(40, 4))).prior();
    let stiff = Kind { poisson_ratio: Some(0.49), ..KIND };
    let said = prior.check(&stiff).unwrap_err();
    assert!(said.contains("0.45") && said.contains("0.49") && said.contains("`poisson_ratio`"), "{said}");
    let wet = Kind { drained: Some(0.3), ..KIND };
    let said = prior.check(&wet).unwrap_err();
    assert!(said.contains("no fluid") && said.contains("a part of 0.3") && said.contains("[resection.csf]"), "{said}");
    let older = PopulationPrior { poisson_ratio: None, ..prior };
    assert_eq!([KIND, stiff, wet].map(|job| older.check(&job)), [Ok(()), Ok(()), Ok(())]);
}

#[test]
fn cohorts_merge_under_one_poissons_ratio_and_one_fluid_and_an_older_file_takes_those_of_the_others() {
    let all = moments(&cohort(40, 3));
    let whole = file(all.clone());
    let [one, two, three] = [&all[..10], &all[10..20], &all[20..]].map(|some| file(some.to_vec()));
    let older = PopulationFile { poisson_ratio: None, ..one.clone() };
    let text = older.to_toml();
    assert!(!text.contains("poisson") && PopulationFile::from_toml(&text, "older.toml").unwrap() == older);
    let named = |file: &PopulationFile| (file.patients.to_string(), file.clone());
    for files in [[&older, &two, &three], [&three, &two, &older]] {
        assert_eq!(merged(&files.map(named)).unwrap(), whole);
    }
    let others = [(Some(0.49), None, "ratio 0.49"), (Some(0.45), Some(0.3), "a part of 0.3 of the fluid drained")];
    for (poisson_ratio, drained, its) in others {
        let other = PopulationFile { poisson_ratio, drained, ..two.clone() };
        for files in [[&older, &three, &other], [&three, &older, &other]] {
            let refused = merged(&files.map(named)).unwrap_err().to_string();
            assert!(refused.contains(its) && refused.contains("ratio 0.45, no fluid"), "{refused}");
        }
    }
}

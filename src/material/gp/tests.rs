//! Likelihood, posterior and fit against figures computed elsewhere and against the dense oracle.

use super::*;
use crate::material::literature::{Curves, table};
use crate::material::task::{Task, stretches};
use crate::material::training::TrainingData;

fn data() -> TrainingData {
    TrainingData::from_literature(&table(), Curves::Published)
}

#[test]
fn likelihood_at_the_published_hyperparameters_is_the_dense_one_of_long_arithmetic() {
    let at = |noise_floor| {
        let parameters = Hyperparameters { noise_floor, ..Hyperparameters::published() };
        negative_log_likelihood(&parameters, &data())
    };
    // Dense Cholesky factors of all 7,300 observations in 80-bit arithmetic, with these numbers on the diagonal.
    assert!((at(1e-8) - 7097.965193).abs() < 1e-5, "{}", at(1e-8));
    assert!((at(1e-6) - 7184.826443).abs() < 1e-5, "{}", at(1e-6));
}

/// Published hyperparameters with noise enough for a Cholesky factor in double precision.
fn noisy() -> Hyperparameters {
    Hyperparameters { noise_floor: 1e-2, ..Hyperparameters::published() }
}

#[test]
fn the_filter_agrees_with_the_dense_oracle() {
    let data = data();
    let mut second_rank = noisy();
    second_rank.weights.push(std::array::from_fn(|t| 2.0 - 0.5 * t as f64));
    for parameters in [noisy(), second_rank] {
        let dense = dense_negative_log_likelihood(&parameters, &data).unwrap();
        let filter = negative_log_likelihood(&parameters, &data);
        assert!((filter / dense - 1.0).abs() < 1e-9, "rank {}: {filter} against {dense}", parameters.rank());
    }
}

#[test]
fn the_smoother_agrees_with_the_dense_oracle() {
    let data = data();
    // Turned around, between the data, and at rest.
    let mut queries = stretches(0.85, 1.15, 13);
    queries.reverse();
    queries.push(1.0);
    for task in Task::all() {
        let (dense, _) = dense_posterior(&noisy(), &data, task, &queries).unwrap();
        let found = posterior(&noisy(), &data, task, &queries);
        for i in 0..queries.len() {
            assert!((found.mean[i] - dense.mean[i]).abs() < 1e-6, "{task} {i}");
            assert!((found.latent_sd[i] - dense.latent_sd[i]).abs() < 1e-6, "{task} {i}");
            assert!((found.observation_sd[i] - dense.observation_sd[i]).abs() < 1e-6, "{task} {i}");
        }
    }
}

#[test]
fn posterior_at_the_published_hyperparameters_is_that_of_long_arithmetic() {
    // Task, stretch, mean of ln W, latent sd, observation sd without the floor of the noise; 80-bit arithmetic.
    let expected = [
        (0, 0.95, 3.0945525225, 0.0671795935, 0.497230551),
        (0, 1.0, -6.3871317309, 0.0448078144, 0.494704825),
        (1, 0.987, 0.8653774684, 0.0580858718, 0.754694885),
        (2, 0.987, -0.1034519328, 0.0119117118, 0.0119117118),
        (3, 1.05, 8.5171179803, 9.99598097e-05, 9.99598097e-05),
        (4, 0.974, 1.0162822199, 0.0173424176, 0.0173424176),
        (5, 1.0, -7.5826518638, 0.0260258603, 0.0260258603),
        (6, 1.1, 2.5220860310, 0.0763673966, 1.15451945),
        (7, 0.9, 2.2639401674, 0.215285071, 3.10408371),
        (8, 0.974, 0.4822901924, 0.0452234239, 0.367125275),
        (9, 1.0, -9.1807744690, 0.0439511486, 0.332811801),
        (10, 0.896, 2.3836731673, 0.138684827, 0.908011723),
        (10, 1.4, 4.3806055912, 0.201022328, 0.919598708),
        (11, 0.948, 4.8322593746, 0.0574910672, 0.0574910672),
    ];
    let tasks: Vec<Task> = Task::all().collect();
    for (task, stretch, mean, latent, observation) in expected {
        let found = posterior(&Hyperparameters::published(), &data(), tasks[task], &[stretch]);
        assert!((found.mean[0] - mean).abs() < 1e-6, "{task} at {stretch}: {}", found.mean[0]);
        assert!((found.latent_sd[0] - latent).abs() < 1e-6, "{task} at {stretch}: {}", found.latent_sd[0]);
        let observation = f64::hypot(observation, Hyperparameters::published().noise_floor.sqrt());
        assert!((found.observation_sd[0] - observation).abs() < 1e-6, "{task} at {stretch}");
    }
}

#[test]
fn a_seeded_fit_finds_the_greatest_known_likelihood_and_repeats() {
    let fit = fit_hyperparameters(&data(), &FitSettings::default()).unwrap();
    assert!(fit.negative_log_likelihood <= 7083.70, "{}", fit.negative_log_likelihood);
    assert_eq!(negative_log_likelihood(&fit.hyperparameters, &data()), fit.negative_log_likelihood);
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one_thread.install(|| fit_hyperparameters(&data(), &FitSettings::default())).unwrap(), fit);
}

#[test]
fn a_second_rank_explains_the_data_better_than_one() {
    let settings = FitSettings { rank: 2, starts: 3, first_iterations: 80, ..FitSettings::default() };
    let fit = fit_hyperparameters(&data(), &settings).unwrap();
    assert!(fit.negative_log_likelihood < 7083.69, "{}", fit.negative_log_likelihood);
    assert_eq!(fit.hyperparameters.rank(), 2);
}

#[test]
fn a_search_that_ended_too_early_says_so_and_that_the_published_ones_are_better() {
    let (data, short) =
        (data(), FitSettings { starts: 1, first_iterations: 1, iterations: 1, ..FitSettings::default() });
    let published = negative_log_likelihood(&Hyperparameters::published(), &data);
    let fit = fit_hyperparameters(&data, &short).unwrap();
    let told = fit.warnings(&short, &data, published);
    assert!(matches!(told[..], [FitWarning::Unfinished { .. }, FitWarning::WorseThanPublished { .. }]), "{told:?}");
    assert!(told[0].to_string().contains("`iterations` (it is 1)"), "{}", told[0]);
    let flat = HyperparameterFit { gradient_norm: 0.0, negative_log_likelihood: published, ..fit };
    assert_eq!(flat.warnings(&short, &data, published), []);
}

#[test]
fn settings_that_cannot_be_are_refused_by_name() {
    let refused = |settings: FitSettings| fit_hyperparameters(&data(), &settings).unwrap_err().to_string();
    assert!(refused(FitSettings { rank: 0, ..FitSettings::default() }).contains("`rank` is 0"));
    assert!(refused(FitSettings { rank: 13, ..FitSettings::default() }).contains("`rank` is 13"));
    assert!(refused(FitSettings { starts: 0, ..FitSettings::default() }).contains("`starts`"));
    assert!(refused(FitSettings { finalists: 9, ..FitSettings::default() }).contains("`finalists`"));
    assert!(refused(FitSettings { noise_floor: 0.0, ..FitSettings::default() }).contains("`noise_floor`"));
}

/// Hyperparameters and data of no particular shape: few or many replicates, ranks 1 to 3, tasks without their own
/// part.
fn random_case(seed: u64) -> (Hyperparameters, TrainingData) {
    let rng = crate::material::random::CounterRng::new(seed, 77);
    let rank = 1 + (seed % 3) as usize;
    let weight = |r: usize, t: usize| 3.0 * rng.normal((100 * r + t) as u64);
    let part = |base: u64, t: usize| rng.between(base + t as u64, -0.3, 2.0).max(0.0);
    let parameters = Hyperparameters {
        lengthscale: rng.between(1, 0.03, 0.8),
        weights: (0..rank).map(|r| std::array::from_fn(|t| weight(r + 1, t))).collect(),
        kappa: std::array::from_fn(|t| part(1000, t)),
        noise_variance: std::array::from_fn(|t| part(2000, t)),
        noise_floor: 1e-2,
    };
    let observation = |n: u64| {
        // A coarse grid, so that stretches repeat within and across tasks.
        let stretch = 0.6 + 0.01 * (rng.uniform(5000 + n) * 80.0).floor();
        (stretch, (rng.uniform(6000 + n) * 12.0) as usize, 4.0 * rng.normal(7000 + n))
    };
    (parameters, TrainingData::from_observations((0..20 + 30 * (seed % 5)).map(observation).collect()))
}

#[test]
fn filter_and_smoother_agree_with_the_oracle_on_random_data() {
    for seed in 0..40 {
        let (parameters, data) = random_case(seed);
        let dense = dense_negative_log_likelihood(&parameters, &data).unwrap();
        let filter = negative_log_likelihood(&parameters, &data);
        assert!((filter - dense).abs() < 1e-9 * dense.abs().max(1.0), "seed {seed}: {filter} against {dense}");
        let queries = [0.55, 0.7, 1.0, 1.003, 1.5];
        for task in Task::all().step_by(3) {
            let (dense, covariance) = dense_posterior(&parameters, &data, task, &queries).unwrap();
            let joint = joint_posterior(&parameters, &data, task, &queries);
            for i in 0..queries.len() {
                assert!((joint.prior.mean[i] - dense.mean[i]).abs() < 1e-7, "seed {seed}, {task}, {i}");
                for j in 0..queries.len() {
                    assert!((joint.covariance[i][j] - covariance[(i, j)]).abs() < 1e-7, "seed {seed}, {task}, {i} {j}");
                }
            }
        }
    }
}

#[test]
fn one_observation_is_enough_and_none_gives_the_prior() {
    let parameters = Hyperparameters::published();
    let b = parameters.coregionalisation();
    let task = Task::HYPERELASTIC_HEALTHY;
    let none = TrainingData::from_observations(vec![]);
    assert_eq!(negative_log_likelihood_and_gradient(&parameters, &none).0, 0.0);
    let prior = posterior(&parameters, &none, task, &[1.0, 1.2]);
    assert!(prior.mean == [0.0, 0.0] && (prior.latent_sd[0].powi(2) / b[10][10] - 1.0).abs() < 1e-12);
    let one = TrainingData::from_observations(vec![(1.0, 10, 2.0)]);
    let at = posterior(&parameters, &one, task, &[1.0]).mean[0];
    let variance = b[10][10] + parameters.observation_variance(10);
    assert!((at - 2.0 * b[10][10] / variance).abs() < 1e-12);
    let (value, _) = negative_log_likelihood_and_gradient(&parameters, &one);
    let expected = 0.5 * ((2.0 * std::f64::consts::PI * variance).ln() + 4.0 / variance);
    assert!((value - expected).abs() < 1e-12);
}

use super::*;
use crate::material::generative::SampleSettings;
use crate::material::gp::Hyperparameters;
use crate::material::literature::{Curves, table};
use crate::material::meta_model;
use crate::material::task::stretches;
use crate::material::{Region, StudyKind, Task};
use nalgebra::{DMatrix, DVector};

fn literature() -> Studies {
    Studies::from_literature(&table(), Curves::Corrected)
}

/// A few curves on few points, so that a dense covariance can be written down.
fn few() -> Studies {
    let mut studies = literature();
    studies.publications.retain(|(_, curves)| curves.len() <= 3);
    studies.publications.truncate(9);
    for (_, curves) in &mut studies.publications {
        for curve in curves.iter_mut() {
            let thin = |v: &[f64]| v.iter().step_by(13).copied().collect::<Vec<f64>>();
            *curve = StudyCurve::new(curve.id, curve.task, thin(&curve.strains), thin(&curve.log_moduli));
        }
    }
    studies
}

#[test]
fn studies_without_a_citation_are_a_publication_each() {
    let mut models = table();
    models.truncate(3);
    for (model, citation) in models.iter_mut().zip(["", "  ", "Somebody 2026"]) {
        model.citation = citation.to_owned();
    }
    let ids = [models[0].id, models[1].id];
    let studies = Studies::from_literature(&models, Curves::Corrected);
    let names: Vec<String> = studies.publications.into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, [format!("own study {}", ids[0]), format!("own study {}", ids[1]), "Somebody 2026".to_owned()]);
}

/// ln N(y; mean, F_m P F_m^T + F_u R F_u^T + F_v D F_v^T + nugget^2 I), written out.
fn dense_log_likelihood(studies: &Studies, spreads: &Spreads) -> f64 {
    use super::basis::{LEVEL, SIZE};
    use super::spreads::{LEVEL_MEAN, NUGGET, Part};
    let rows: Vec<(usize, usize, Task, f64, f64)> = studies
        .publications
        .iter()
        .enumerate()
        .flat_map(|(p, (_, curves))| curves.iter().enumerate().map(move |(c, curve)| (p, c, curve)))
        .flat_map(|(p, c, curve)| {
            let points = curve.strains.iter().zip(&curve.log_moduli);
            points.map(move |(x, y)| (p, 100 * p + c, curve.task, *x, *y))
        })
        .collect();
    let leading = |p: usize| {
        let curves = &studies.publications[p].1;
        let shaped = curves.iter().any(|c| c.task.kind == StudyKind::Hyperelastic);
        let abnormal = curves.iter().all(|c| c.task.region == Region::Abnormal);
        let kind = if shaped { StudyKind::Hyperelastic } else { StudyKind::Linear };
        Task { kind, region: if abnormal { Region::Abnormal } else { Region::Healthy } }
    };
    let mean_prior: Vec<_> = (0..SIZE).map(|f| (spreads.mean_covariance(f), spreads.task_scales(f))).collect();
    let n = rows.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let ((p, c, t, x, _), (q, d, s, z, _)) = (rows[i], rows[j]);
        let (a, b) = (Basis.at(x), Basis.at(z));
        let publication = spreads.deviations(Part::Publication, leading(p)).0;
        let own = spreads.deviations(Part::Curve, t).0;
        let (t, s) = (t.index(), s.index());
        let term = |f: usize| {
            let (prior, scales) = &mean_prior[f];
            let mut sum = prior[t][s] * scales[t] * scales[s];
            sum += if p == q { publication[f] * publication[f] } else { 0.0 };
            sum += if c == d { own[f] * own[f] } else { 0.0 };
            sum * a[f] * b[f]
        };
        (0..SIZE).map(term).sum::<f64>() + if i == j { NUGGET * NUGGET } else { 0.0 }
    });
    assert_eq!(LEVEL, 0);
    let residual = DVector::from_fn(n, |i, _| rows[i].4 - LEVEL_MEAN);
    let factor = nalgebra::linalg::Cholesky::new(covariance).unwrap();
    let half = factor.l().solve_lower_triangular(&residual).unwrap();
    let half_log: f64 = factor.l().diagonal().iter().map(|x| x.ln()).sum();
    -0.5 * half.dot(&half) - half_log - 0.5 * n as f64 * std::f64::consts::TAU.ln()
}

#[test]
fn the_likelihood_is_that_of_the_dense_oracle() {
    let (studies, spreads) = (few(), Spreads::default());
    let found = Evidence::new(&studies, &spreads).unwrap().log_likelihood;
    let dense = dense_log_likelihood(&studies, &spreads);
    assert!((found - dense).abs() < 1e-5 * dense.abs(), "{found} {dense}");
}

#[test]
fn the_order_of_a_publications_curves_says_nothing_of_how_widely_it_may_differ() {
    let curves: Vec<StudyCurve> = literature().publications.into_iter().flat_map(|(_, curves)| curves).collect();
    let of = |kind: StudyKind| {
        let healthy = |curve: &&StudyCurve| curve.task.kind == kind && curve.task.region != Region::Abnormal;
        curves.iter().find(healthy).unwrap().clone()
    };
    let abnormal = curves.iter().find(|curve| curve.task.region == Region::Abnormal).unwrap().clone();
    let both = vec![of(StudyKind::Linear), of(StudyKind::Hyperelastic), abnormal];
    let mut studies = Studies { publications: vec![("one laboratory".to_owned(), both)] };
    let spreads = Spreads::default();
    let likelihood = |studies: &Studies| Evidence::new(studies, &spreads).unwrap().log_likelihood;
    let found = likelihood(&studies);
    let dense = dense_log_likelihood(&studies, &spreads);
    assert!((found - dense).abs() < 1e-5 * dense.abs(), "{found} {dense}");
    for _ in 0..3 {
        studies.publications[0].1.rotate_left(1);
        let turned = likelihood(&studies);
        assert!((turned - found).abs() < 1e-7 * found.abs(), "{turned} {found}");
    }
}

#[test]
fn the_remainder_is_none_at_rest_and_what_curves_differ_by_there_is_their_level_and_their_step() {
    use super::basis::REMAINDER;
    assert!(Basis.at(0.0)[REMAINDER..].iter().all(|value| *value == 0.0));
    let spreads = Spreads::default();
    let means = Evidence::new(&literature(), &spreads).unwrap().means;
    let variance = |of: Of| predict(&means, &spreads, Task::HYPERELASTIC_GREY, of, &[1.0]).sd[0].powi(2);
    let own = variance(Of::Person) - variance(Of::Mean);
    let Spreads { level_publication, level_curve, step_publication, step_curve, .. } = spreads;
    let squares = |a: f64, b: f64| a * a + b * b;
    // The step is a half to either side.
    let expected = squares(level_publication, level_curve) + 0.25 * squares(step_publication, step_curve);
    assert!((own - expected).abs() < 1e-9 * expected, "{own} {expected}");
}

#[test]
fn the_gradient_is_the_derivative_of_the_likelihood() {
    let studies = literature();
    let logs: [f64; SPREADS] = Spreads::default().to_array().map(f64::ln);
    let found = Evidence::new(&studies, &Spreads::from_logs(&logs)).unwrap().gradient;
    for n in 0..SPREADS {
        let beside = |step: f64| {
            let mut moved = logs;
            moved[n] += step;
            Evidence::new(&studies, &Spreads::from_logs(&moved)).unwrap().log_likelihood
        };
        let difference = (beside(1e-4) - beside(-1e-4)) / 2e-4;
        assert!((found[n] - difference).abs() < 1e-4 * difference.abs().max(1.0), "{n}: {} {difference}", found[n]);
    }
}

#[test]
fn the_fit_ends_where_the_posterior_is_flat_and_is_the_same_again() {
    let studies = few();
    let first = fit(&studies, &Spreads::default(), 3).unwrap();
    assert!(first.gradient_norm < 1e-2, "{}", first.gradient_norm);
    assert!(first.log_sds.iter().all(|sd| *sd > 0.0 && sd.is_finite()), "{:?}", first.log_sds);
    let on_a_slope = StudyLevelFit { gradient_norm: studies.points() as f64, ..first.clone() };
    assert!(on_a_slope.warning(&studies).unwrap().to_string().contains("ended before"));
    let again = fit(&studies, &Spreads::default(), 3).unwrap();
    assert_eq!(first.spreads, again.spreads);
}

#[test]
fn slow_a_publication_is_predicted_better_than_by_the_published_process_and_within_the_band() {
    let studies = literature();
    let all = refit(&studies, &Spreads::default()).unwrap();
    let left = leave_one_publication_out(&studies, &all).unwrap();
    let points: usize = left.iter().map(|l| l.points).sum();
    let density = left.iter().map(|l| l.log_density).sum::<f64>() / points as f64;
    assert!(density > 1.0, "{density}");
    let published = Hyperparameters::published();
    let better = (0..left.len()).filter(|n| left[*n].log_density > published_log_density(&studies, *n, &published));
    assert!(better.count() >= 26);
    let inside = left.iter().filter(|l| l.inside_95 >= 0.9).count() as f64 / left.len() as f64;
    assert!((0.9..=0.99).contains(&inside), "{inside}");
    let half = left.iter().map(|l| l.inside_50).sum::<f64>() / left.len() as f64;
    assert!((0.35..=0.65).contains(&half), "{half}");
}

#[test]
fn draws_have_the_mean_and_spread_that_is_stated() {
    let studies = literature();
    let spreads = Spreads::default();
    let means = Evidence::new(&studies, &spreads).unwrap().means;
    let grid = stretches(0.9, 1.1, 5);
    for of in [Of::Mean, Of::Study, Of::Person] {
        let prior = predict(&means, &spreads, Task::HYPERELASTIC_GREY, of, &grid);
        let draws: Vec<Vec<f64>> = (0..4000).map(|n| prior.draw(7, n)).collect();
        for n in 0..grid.len() {
            let mean = draws.iter().map(|d| d[n]).sum::<f64>() / 4000.0;
            let variance = draws.iter().map(|d| (d[n] - mean).powi(2)).sum::<f64>() / 3999.0;
            let error = prior.sd[n] / 4000f64.sqrt();
            assert!((mean - prior.mean[n]).abs() < 4.5 * error, "{of:?} {n}");
            // The sd of a sample's sd is sd / sqrt(2 n).
            assert!((variance.sqrt() / prior.sd[n] - 1.0).abs() < 4.5 / 8000f64.sqrt(), "{of:?} {n}");
        }
        assert_eq!(prior.draw(7, 5), prior.draw(7, 5));
    }
}

#[test]
fn a_tissue_drawn_with_others_has_the_law_it_has_alone_and_they_go_together() {
    let studies = literature();
    let spreads = Spreads::default();
    let means = Evidence::new(&studies, &spreads).unwrap().means;
    let tasks = [Task::HYPERELASTIC_GREY, Task::HYPERELASTIC_WHITE];
    let joint = predict_jointly(&means, &spreads, &tasks, Of::Person, 3);
    let draws: Vec<Vec<Vec<f64>>> = (0..3000).map(|n| joint.draw(5, n)).collect();
    for (t, task) in tasks.into_iter().enumerate() {
        let alone = predict(&means, &spreads, task, Of::Person, &joint.stretches[t]);
        for n in 0..3 {
            let mean = draws.iter().map(|d| d[t][n]).sum::<f64>() / 3000.0;
            let sd = (draws.iter().map(|d| (d[t][n] - mean).powi(2)).sum::<f64>() / 2999.0).sqrt();
            assert!((mean - alone.mean[n]).abs() < 4.5 * alone.sd[n] / 3000f64.sqrt(), "{task} {n}");
            assert!((sd / alone.sd[n] - 1.0).abs() < 4.5 / 6000f64.sqrt(), "{task} {n}");
        }
    }
    let centred = |t: usize| {
        let mean = draws.iter().map(|d| d[t][0]).sum::<f64>() / 3000.0;
        draws.iter().map(|d| d[t][0] - mean).collect::<Vec<f64>>()
    };
    let (grey, white) = (centred(0), centred(1));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    // One laboratory's level is in both.
    assert!(dot(&grey, &white) / (dot(&grey, &grey) * dot(&white, &white)).sqrt() > 0.3);
}

#[test]
fn every_task_among_all_has_the_spread_it_has_alone() {
    let spreads = Spreads::default();
    let means = Evidence::new(&literature(), &spreads).unwrap().means;
    let tasks: Vec<Task> = Task::all().collect();
    for of in [Of::Laboratory, Of::Person] {
        let joint = predict_jointly(&means, &spreads, &tasks, of, 3);
        let draws: Vec<Vec<Vec<f64>>> = (0..3000).map(|n| joint.draw(5, n)).collect();
        for (t, task) in tasks.iter().enumerate() {
            let alone = predict(&means, &spreads, *task, of, &joint.stretches[t]);
            for n in 0..3 {
                let mean = draws.iter().map(|d| d[t][n]).sum::<f64>() / 3000.0;
                let sd = (draws.iter().map(|d| (d[t][n] - mean).powi(2)).sum::<f64>() / 2999.0).sqrt();
                assert!((mean - alone.mean[n]).abs() < 4.5 * alone.sd[n] / 3000f64.sqrt(), "{of:?} {task} {n}");
                assert!(
                    (sd / alone.sd[n] - 1.0).abs() < 4.5 / 6000f64.sqrt(),
                    "{of:?} {task} {n}: {sd} {}",
                    alone.sd[n]
                );
            }
        }
    }
}

#[test]
fn every_drawn_function_is_fitted_by_a_stable_law_abnormal_tissue_too() {
    let studies = literature();
    let spreads = Spreads::default();
    let means = Evidence::new(&studies, &spreads).unwrap().means;
    let settings = SampleSettings::default();
    for task in Task::all() {
        let [low, high] = task.stretch_window();
        let prior = predict(&means, &spreads, task, Of::Person, &stretches(low, high, 51));
        let materials = drawn_materials(&prior, 100, 1, &settings).unwrap();
        assert!(materials.iter().all(|m| m.fit.stability.everywhere() && m.shear_modulus_pa > 0.0), "{task}");
        let levels = materials_at_levels(&prior, &[-2.0, 0.0, 2.0], &settings).unwrap();
        assert!(levels.windows(2).all(|pair| pair[0].shear_modulus_pa < pair[1].shear_modulus_pa), "{task}");
    }
}

#[test]
fn a_neo_hookean_function_gives_its_own_modulus_back() {
    let grid = stretches(0.9, 1.1, 51);
    let targets = log_energies(&grid, &[1234f64.ln(); 51], 1e-3);
    let settings = SampleSettings::default();
    let found = meta_model::fit(settings.model, &grid, &targets, &settings.meta_model).unwrap();
    assert!((found.shear_modulus_pa - 1234.0).abs() < 1e-3, "{}", found.shear_modulus_pa);
}

fn some_file() -> StudyLevelFile {
    let moduli = ModuliPrior {
        tasks: vec!["mre-grey".to_owned(), "mre-white".to_owned()],
        mean_ln_pa: vec![7.25, 6.5],
        covariance_ln: vec![vec![1.0, 0.25], vec![0.25, 2.0]],
    };
    StudyLevelFile::new(Spreads::default(), [[0.125, 2.0]; SPREADS], moduli)
}

#[test]
fn the_fitted_model_is_read_back_from_its_file() {
    let file = some_file();
    assert_eq!(StudyLevelFile::from_toml(&file.to_toml()), Ok(file));
}

#[test]
fn a_file_that_is_no_model_is_refused_with_what_is_wrong() {
    let text = some_file().to_toml();
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from));
        StudyLevelFile::from_toml(&text.replace(from, to)).unwrap_err()
    };
    assert!(refused("level_curve = 0.4", "level_curve = -0.4").contains("level_curve"));
    assert!(refused("[0.25, 2.0]", "[0.25, 0.01]").contains("positive definite"));
    assert!(refused("[0.25, 2.0]", "[0.5, 2.0]").contains("symmetric"));
    assert!(refused("mean_ln_pa = [7.25, 6.5]", "mean_ln_pa = [7.25]").contains("2 `tasks`"));
    assert!(refused("linear_scale", "linear_skale").contains("linear_skale"));
}

#[test]
fn ranks_that_crowd_are_seen_and_even_ones_are_not() {
    let even: Vec<f64> = (0..30).map(|n| (f64::from(n) + 0.5) / 30.0).collect();
    assert!(uniform_probability(&even) > 0.999);
    let high: Vec<f64> = even.iter().map(|rank| rank.powf(0.25)).collect();
    assert!(uniform_probability(&high) < 1e-4);
}

#[test]
fn a_simulated_literature_is_its_seeds_and_spreads_as_its_spreads_say() {
    let design = literature();
    let narrow = Spreads { level_publication: 0.01, level_curve: 0.01, ..Spreads::default() };
    let wide = Spreads { level_publication: 2.0, ..narrow };
    let of_task = |studies: &Studies| -> Vec<f64> {
        let curves = studies.publications.iter().flat_map(|(_, curves)| curves.iter().take(1));
        let own = curves.filter(|curve| curve.task.index() == 6);
        own.map(|curve| curve.log_moduli.iter().sum::<f64>() / curve.log_moduli.len() as f64).collect()
    };
    let variance = |spreads: &Spreads| {
        let levels = of_task(&simulate(&design, spreads, 9));
        let mean = levels.iter().sum::<f64>() / levels.len() as f64;
        levels.iter().map(|level| (level - mean).powi(2)).sum::<f64>() / (levels.len() - 1) as f64
    };
    assert!(of_task(&design).len() > 3, "linear healthy tissue has several publications");
    assert!(variance(&wide) > 4.0 * variance(&narrow), "{} {}", variance(&wide), variance(&narrow));
    assert_eq!(of_task(&simulate(&design, &wide, 9)), of_task(&simulate(&design, &wide, 9)));
    assert_ne!(of_task(&simulate(&design, &wide, 9)), of_task(&simulate(&design, &wide, 10)));
}

#[test]
fn slow_intervals_hold_the_spreads_that_made_a_literature() {
    let design = literature();
    let (mut inside, mut all) = (0, 0);
    for number in 0..12 {
        let truth = Spreads::from_prior(3, number);
        let made = simulate(&design, &truth, number);
        let found = intervals(&made, &refit(&made, &Spreads::default()).unwrap()).unwrap();
        let held = found.iter().zip(truth.to_array()).filter(|([low, high], truth)| low <= truth && truth <= high);
        inside += held.count();
        all += SPREADS;
    }
    // Of 204 at 90 %, the sd is 2.1 % were they independent.
    let share = f64::from(u32::try_from(inside).unwrap()) / all as f64;
    assert!(share > 0.8, "{share}");
}

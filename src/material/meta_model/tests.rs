//! Recovery of known laws, Jacobians against differences, verdicts against the curves themselves.

use super::*;
use crate::material::task::stretches;

const OFFSET: f64 = 1e-3;

fn exact() -> MetaModelSettings {
    MetaModelSettings::default()
}

fn targets(model: MetaModel, parameters: &[f64], l: &[f64]) -> Vec<f64> {
    l.iter().map(|l| (model.energy_pa(parameters, *l) + OFFSET).ln()).collect()
}

#[test]
fn a_law_is_recovered_from_its_own_curve() {
    let l = stretches(0.7, 1.3, 61);
    let cases: [(MetaModel, &[f64]); 6] = [
        (MetaModel::NEO_HOOKEAN, &[333.28]),
        (MetaModel::MOONEY_RIVLIN, &[140.0, 166.5]),
        (MetaModel::OGDEN, &[420.0, 2.7]),
        (MetaModel::OGDEN, &[-200.0, -3.4]),
        (MetaModel::OGDEN_HIGH, &[-93.9, -22.0]),
        (MetaModel::OGDEN_HIGH, &[61.0, 17.0]),
    ];
    for (model, parameters) in cases {
        let fit = fit(model, &l, &targets(model, parameters, &l), &exact()).unwrap();
        for (found, true_value) in fit.parameters.iter().zip(parameters) {
            assert!((found / true_value - 1.0).abs() < 1e-6, "{model}: {:?}", fit.parameters);
        }
        assert!(fit.converged && fit.cost < 1e-12 && fit.r_squared > 1.0 - 1e-9 && fit.stability.everywhere());
    }
}

#[test]
fn a_law_is_recovered_from_its_own_stresses() {
    let l = stretches(0.8, 1.2, 31);
    let cases: [(MetaModel, &[f64]); 4] = [
        (MetaModel::NEO_HOOKEAN, &[333.28]),
        (MetaModel::MOONEY_RIVLIN, &[140.0, 166.5]),
        (MetaModel::OGDEN, &[-200.0, -3.4]),
        (MetaModel::OGDEN_HIGH, &[61.0, 17.0]),
    ];
    for (model, parameters) in cases {
        let stresses: Vec<f64> = l.iter().map(|l| model.stress_pa(parameters, *l)).collect();
        let fit = fit_stress(model, &l, &stresses, &exact()).unwrap();
        for (found, true_value) in fit.parameters.iter().zip(parameters) {
            assert!((found / true_value - 1.0).abs() < 1e-6, "{model}: {:?}", fit.parameters);
        }
        assert!(fit.converged && fit.r_squared > 1.0 - 1e-9 && fit.stability.everywhere());
    }
    assert_eq!(fit_stress(MetaModel::NEO_HOOKEAN, &l, &[0.0; 31], &exact()), Err(FitError::NoStress));
}

#[test]
fn energy_slopes_and_stress_are_the_derivatives() {
    let mut cases: Vec<(MetaModel, Vec<f64>)> =
        vec![(MetaModel::OGDEN, vec![300.0, 2.5]), (MetaModel::OGDEN_HIGH, vec![-100.0, -14.0])];
    // Every law of the list near the parameters that a brain-like curve gives it.
    let l = stretches(0.8, 1.2, 31);
    for model in MetaModel::all() {
        let fit = fit(model, &l, &targets(MetaModel::MOONEY_RIVLIN, &[140.0, 166.5], &l), &exact()).unwrap();
        cases.push((model, fit.parameters.iter().map(|p| 1.1 * p + 1e-3).collect()));
    }
    for (model, p) in cases {
        for l in [0.8, 0.99, 1.2] {
            let slope = model.energy_slope_pa(&p, l);
            for i in 0..model.parameter_names().len() {
                let h = 1e-6 * p[i].abs();
                let shifted = |d: f64| {
                    let mut q = p.clone();
                    q[i] += d;
                    model.energy_pa(&q, l)
                };
                let difference = (shifted(h) - shifted(-h)) / (2.0 * h);
                assert!((difference - slope[i]).abs() <= 1e-7 * slope[i].abs() + 1e-9, "{model} {i} at {l}");
                let stress = |d: f64| {
                    let mut q = p.clone();
                    q[i] += d;
                    model.stress_pa(&q, l)
                };
                let (difference, slope) = ((stress(h) - stress(-h)) / (2.0 * h), model.stress_slope_pa(&p, l)[i]);
                assert!((difference - slope).abs() <= 1e-7 * slope.abs() + 1e-9, "{model} stress {i} at {l}");
            }
            let h = 1e-6;
            let difference = (model.energy_pa(&p, l + h) - model.energy_pa(&p, l - h)) / (2.0 * h);
            assert!((difference - model.stress_pa(&p, l)).abs() < 1e-6 * difference.abs() + 1e-4, "{model} at {l}");
            let modulus = model.energy_pa(&p, 1.0 + 1e-4) / (1.5 * 1e-8);
            assert!((modulus / model.small_strain_shear_modulus_pa(&p) - 1.0).abs() < 2e-3, "{model}");
        }
    }
}

#[test]
fn verdicts_agree_with_the_curves_themselves() {
    let window = [0.8, 1.25];
    let l = stretches(window[0], window[1], 901);
    let mut seen = [0; 2];
    for model in [MetaModel::MOONEY_RIVLIN, MetaModel::OGDEN] {
        for a in [-300.0, -20.0, 25.0, 400.0] {
            for b in [-900.0_f64, -4.3, -1.7, 0.4, 1.6, 150.0] {
                let p = [a, if model == MetaModel::OGDEN { b.clamp(-4.3, 1.6) } else { b }];
                let verdict = model.stability(&p, window);
                let stress: Vec<f64> = l.iter().map(|l| model.stress_pa(&p, *l)).collect();
                let grows = l.iter().zip(&stress).all(|(l, s)| (l - 1.0) * s >= -1e-9);
                let convex = stress.windows(2).all(|pair| pair[1] > pair[0]);
                let rises = l.windows(2).zip(stress.windows(2)).all(|(l, s)| l[1] * s[1] > l[0] * s[0]);
                let holds = |range: StabilityRange| range != StabilityRange::Nowhere;
                assert_eq!(holds(verdict.energy_grows), grows, "{model} {p:?}");
                assert_eq!(holds(verdict.convex), convex, "{model} {p:?}");
                assert_eq!(holds(verdict.true_stress_rises), rises, "{model} {p:?}");
                seen[usize::from(convex)] += 1;
            }
        }
    }
    assert!(seen[0] > 5 && seen[1] > 5, "both verdicts occur: {seen:?}");
}

#[test]
fn covariance_is_the_scatter_of_repeated_fits() {
    let l = stretches(0.7, 1.3, 41);
    let cases: [(MetaModel, &[f64]); 3] = [
        (MetaModel::NEO_HOOKEAN, &[600.0]),
        (MetaModel::MOONEY_RIVLIN, &[140.0, 166.5]),
        (MetaModel::OGDEN, &[-200.0, -3.4]),
    ];
    for (model, parameters) in cases {
        let clean = targets(model, parameters, &l);
        let n = 400;
        let mut found = Vec::new();
        let mut predicted = vec![0.0; parameters.len()];
        for repeat in 0..n {
            let rng = crate::material::random::CounterRng::new(5, repeat);
            let noisy: Vec<f64> = clean.iter().enumerate().map(|(i, y)| y + 0.02 * rng.normal(i as u64)).collect();
            let fit = fit(model, &l, &noisy, &exact()).unwrap();
            for (sum, i) in predicted.iter_mut().zip(0..) {
                *sum += fit.covariance[i][i] / n as f64;
            }
            found.push(fit.parameters);
        }
        for i in 0..parameters.len() {
            let mean = found.iter().map(|p| p[i]).sum::<f64>() / n as f64;
            let scatter = found.iter().map(|p| (p[i] - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
            // A variance of 400 normal numbers has a relative standard error of 7 %.
            assert!((predicted[i] / scatter - 1.0).abs() < 0.25, "{model} {i}: {} against {scatter}", predicted[i]);
        }
    }
}

#[test]
fn a_parameter_at_its_bound_is_named_and_has_no_variance() {
    let l = stretches(0.7, 1.3, 41);
    let y: Vec<f64> = targets(MetaModel::OGDEN_HIGH, &[-40.0, -20.0], &l);
    let fit = fit(MetaModel::OGDEN, &l, &y, &exact()).unwrap();
    assert_eq!(fit.at_bound, ["alpha"]);
    assert!((fit.parameters[1] + 5.0).abs() < 1e-5);
    assert!(fit.covariance[1][1] == 0.0 && fit.covariance[0][0] > 0.0);
}

#[test]
fn points_that_determine_nothing_are_refused() {
    let model = MetaModel::MOONEY_RIVLIN;
    assert!(matches!(fit(model, &[0.9, 1.1], &[1.0, 2.0], &exact()), Err(FitError::TooFew { .. })));
    assert_eq!(fit(model, &[1.0; 5], &[1.0; 5], &exact()), Err(FitError::AllAtRest));
    let bad = fit(model, &[0.9, 1.0, -1.1], &[1.0, 2.0, 3.0], &exact());
    assert!(matches!(bad, Err(FitError::Point { index: 2, .. })));
    let nothing = [OFFSET.ln(); 5];
    let l = stretches(0.8, 1.2, 5);
    assert_eq!(fit(MetaModel::NEO_HOOKEAN, &l, &nothing, &exact()), Err(FitError::NoEnergy));
    let one = fit(model, &[1.1; 3], &[1.0, 1.01, 0.99], &exact());
    assert_eq!(one, Err(FitError::TooFewStretches { found: 1, model, needed: 2 }));
    assert!(fit(MetaModel::NEO_HOOKEAN, &[1.1; 3], &[1.0, 1.01, 0.99], &exact()).is_ok());
    assert!(one.unwrap_err().to_string().contains("give rows at 2"));
}

#[test]
fn a_fit_as_a_material_keeps_its_shear_modulus() {
    let l = stretches(0.7, 1.3, 41);
    for model in MetaModel::all() {
        let fit = fit(model, &l, &targets(MetaModel::MOONEY_RIVLIN, &[140.0, 166.5], &l), &exact()).unwrap();
        let material = fit.material(0.45);
        assert!((material.shear_modulus_pa() / fit.shear_modulus_pa - 1.0).abs() < 1e-12, "{model}");
        assert_eq!(material.poisson_ratio(), 0.45);
    }
}

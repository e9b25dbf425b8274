use super::*;
use crate::material::Task;
use crate::material::gp::Hyperparameters;
use crate::material::literature::{Curves, table};
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
        curves.iter().find(|c| c.task.region != crate::material::Region::Abnormal).unwrap_or(&curves[0]).task
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
    let grid = crate::material::task::stretches(0.9, 1.1, 5);
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

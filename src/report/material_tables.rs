//! Tables of sampled materials: one line a material, the posterior and the drawn curves over the stretch.

use crate::material::generative::nine_levels;
use crate::material::gp::{JointPosterior, Spread};
use crate::material::meta_model::{Fit, MetaModel};
use crate::material::statistics::{COMPARED, Comparison};
use serde::Serialize;
use serde_json::json;
use std::fmt::Write;

/// One material, from a level or a draw.
#[derive(Clone, Debug, Serialize)]
pub struct Sampled {
    /// Standard deviations from the mean, of a level.
    pub sd_level: Option<f64>,
    /// Its number, of a draw.
    pub draw: Option<u64>,
    /// The law fitted.
    pub fit: Fit,
}

/// How the shear moduli of some materials are spread. Levels are chosen and not drawn: they have ends, and no quantiles. A tail
/// of draws is told only where one of them or more is expected to lie in it.
pub fn quantiles(sampled: &[Sampled]) -> serde_json::Value {
    let mut moduli: Vec<f64> = sampled.iter().map(|s| s.fit.shear_modulus_pa).collect();
    moduli.sort_by(f64::total_cmp);
    let at = |p: f64| moduli[((moduli.len() - 1) as f64 * p).round() as usize];
    let mut told = json!({
        "count": moduli.len(), "stable": sampled.iter().filter(|s| s.fit.stability.everywhere()).count(),
        "lowest": at(0.0), "median": at(0.5), "highest": at(1.0),
    });
    if sampled.iter().all(|s| s.draw.is_some()) {
        for (low, high, tail) in [("p2.5", "p97.5", 0.025), ("p16", "p84", 0.16)] {
            if moduli.len() as f64 * tail >= 1.0 {
                told[low] = json!(at(tail));
                told[high] = json!(at(1.0 - tail));
            }
        }
    }
    told
}

/// A line per material.
pub fn materials_csv(sampled: &[Sampled], law: MetaModel) -> String {
    let names = law.parameter_names().join(",");
    let mut text = format!("sd_level,draw,law,{names},shear_modulus_pa,cost,r_squared,stable\n");
    for s in sampled {
        let level = s.sd_level.map_or_else(String::new, |v| v.to_string());
        let draw = s.draw.map_or_else(String::new, |v| v.to_string());
        let parameters: Vec<String> = s.fit.parameters.iter().map(ToString::to_string).collect();
        let Fit { shear_modulus_pa, cost, r_squared, stability, .. } = &s.fit;
        let stable = stability.everywhere();
        let parameters = parameters.join(",");
        let _ = writeln!(text, "{level},{draw},{law},{parameters},{shear_modulus_pa},{cost},{r_squared},{stable}");
    }
    text
}

/// The posterior over the stretch.
pub fn posterior_csv(joint: &JointPosterior) -> String {
    let prior = &joint.prior;
    let mut text = String::from("stretch,mean_ln_pa,latent_sd,observation_sd\n");
    for i in 0..prior.stretches.len() {
        let (mean, latent, observation) = (prior.mean[i], prior.latent_sd[i], prior.observation_sd[i]);
        let _ = writeln!(text, "{},{mean},{latent},{observation}", prior.stretches[i]);
    }
    text
}

/// One row a stretch, one column a draw, ln(W / Pa + offset).
pub fn curves_csv(joint: &JointPosterior, draws: u64, seed: u64, spread: Spread) -> String {
    let curves: Vec<Vec<f64>> = (0..draws).map(|draw| joint.draw(seed, draw, spread)).collect();
    let mut text = String::from("stretch");
    for draw in 0..draws {
        let _ = write!(text, ",draw_{draw}");
    }
    for (i, stretch) in joint.prior.stretches.iter().enumerate() {
        let _ = write!(text, "\n{stretch}");
        for curve in &curves {
            let _ = write!(text, ",{}", curve[i]);
        }
    }
    text + "\n"
}

/// Shear moduli of one task, Pa, at the nine levels.
#[derive(Clone, Debug, Serialize)]
pub struct TaskModuli {
    /// Kind of study and region.
    pub task: String,
    /// From two standard deviations below the mean to two above.
    pub shear_modulus_pa: Vec<f64>,
}

/// A line per task, a column per level.
pub fn moduli_csv(rows: &[TaskModuli]) -> String {
    let mut text = String::from("task");
    for level in nine_levels() {
        let _ = write!(text, ",{level}");
    }
    for row in rows {
        let _ = write!(text, "\n{}", row.task);
        for modulus in &row.shear_modulus_pa {
            let _ = write!(text, ",{modulus}");
        }
    }
    text + "\n"
}

/// The same for a terminal, without the end of its last line.
pub(super) fn levels_text(rows: &[TaskModuli]) -> String {
    let mut text = format!("{:<22}", "shear modulus (Pa), sd");
    for level in nine_levels() {
        let _ = write!(text, "{level:>11.1}");
    }
    for row in rows {
        let _ = write!(text, "\n{:<22}", row.task);
        for modulus in &row.shear_modulus_pa {
            let _ = write!(text, "{modulus:>11.1}");
        }
    }
    text
}

/// The same for a terminal, with the tests whether the laws fit equally well.
pub fn moduli_text(rows: &[TaskModuli], tests: &[(String, Comparison)]) -> String {
    let mut text = levels_text(rows);
    let laws = COMPARED.map(MetaModel::name).join(", ");
    let _ = write!(
        text,
        "\n\nDo {laws} fit equally well? Costs at 11 levels from -2 to 2 sd.\n\
         Friedman: each curve fitted by all three laws (paired). Kruskal-Wallis: the costs as three independent samples, \
         with those of the mean curve once more (the paper's).\n"
    );
    for (task, Comparison { friedman, kruskal_wallis, .. }) in tests {
        let _ = writeln!(
            text,
            "{task:<22}Friedman H = {:.2}, p = {:.2e}    Kruskal-Wallis H = {:.2}, p = {:.2e}",
            friedman.h, friedman.p, kruskal_wallis.h, kruskal_wallis.p
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::meta_model::{MetaModelSettings, fit};
    use crate::material::task::stretches;

    #[test]
    fn levels_have_no_quantiles_and_draws_only_those_that_they_are_enough_for() {
        let model = MetaModel::NEO_HOOKEAN;
        let l = stretches(0.8, 1.2, 21);
        let material = |n: u64| {
            let targets: Vec<f64> = l.iter().map(|l| (model.energy_pa(&[100.0 + n as f64], *l) + 1e-3).ln()).collect();
            fit(model, &l, &targets, &MetaModelSettings::default()).unwrap()
        };
        let drawn = |count: u64| {
            let draws = (0..count).map(|n| Sampled { sd_level: None, draw: Some(n), fit: material(n) });
            quantiles(&draws.collect::<Vec<_>>())
        };
        let levels = (0..9).map(|n| Sampled { sd_level: Some(n as f64), draw: None, fit: material(n) });
        let of_levels = quantiles(&levels.collect::<Vec<_>>());
        let told = |of: &serde_json::Value| ["p2.5", "p16", "p84", "p97.5"].map(|name| of[name].is_number());
        assert_eq!(told(&of_levels), [false; 4]);
        assert!(of_levels["median"].is_number() && of_levels["highest"].is_number());
        assert_eq!(told(&drawn(3)), [false; 4]);
        assert_eq!(told(&drawn(7)), [false, true, true, false]);
        assert_eq!(told(&drawn(40)), [true; 4]);
    }
}

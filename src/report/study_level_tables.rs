//! Tables of the study-level model: the prediction over the stretch, drawn functions, a person's moduli, publications
//! beside what the others say of them; and the same for a terminal.

use super::material_tables::{TaskModuli, levels_text};
use crate::material::study_level::{LeftOut, ModuliPrior, StudyLevelFile, StudyLevelPrior, uniform_probability};
use std::fmt::Write;

/// Mean and sd of ln g over the stretch.
pub fn prediction_csv(prior: &StudyLevelPrior) -> String {
    let mut text = String::from("stretch,mean_ln_pa,sd\n");
    for ((stretch, mean), sd) in prior.stretches.iter().zip(&prior.mean).zip(&prior.sd) {
        let _ = writeln!(text, "{stretch},{mean},{sd}");
    }
    text
}

/// One row a stretch, one column a draw, ln(g / Pa).
pub fn log_curves_csv(prior: &StudyLevelPrior, draws: u64, seed: u64) -> String {
    let curves: Vec<Vec<f64>> = (0..draws).map(|draw| prior.draw(seed, draw)).collect();
    let mut text = String::from("stretch");
    for draw in 0..draws {
        let _ = write!(text, ",draw_{draw}");
    }
    for (i, stretch) in prior.stretches.iter().enumerate() {
        let _ = write!(text, "\n{stretch}");
        for curve in &curves {
            let _ = write!(text, ",{}", curve[i]);
        }
    }
    text + "\n"
}

/// Mean, sd and correlations of the log moduli of a person nobody has measured.
pub fn moduli_prior_csv(prior: &ModuliPrior) -> String {
    let sds = prior.sds_ln();
    let columns: Vec<String> = prior.tasks.iter().map(|task| format!("correlation_{task}")).collect();
    let mut text = format!("task,mean_ln_pa,sd_ln,{}\n", columns.join(","));
    for (i, task) in prior.tasks.iter().enumerate() {
        let _ = write!(text, "{task},{},{}", prior.mean_ln_pa[i], sds[i]);
        for (j, sd) in sds.iter().enumerate() {
            let _ = write!(text, ",{}", prior.covariance_ln[i][j] / (sds[i] * sd));
        }
        text.push('\n');
    }
    text
}

/// A line per publication.
pub fn left_out_csv(left_out: &[LeftOut]) -> String {
    let mut text = String::from(
        "publication,points,log_density_per_point,log_density_per_point_at_mode,inside_95,inside_50,mean_log_modulus,rank\n",
    );
    for left in left_out {
        let points = left.points as f64;
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{}",
            quoted(&left.publication),
            left.points,
            left.log_density / points,
            left.log_density_at_mode / points,
            left.inside_95,
            left.inside_50,
            left.mean_log_modulus,
            left.rank
        );
    }
    text
}

/// A cell of a table, in quotes where it holds a comma or a quote: a user's citation is in words.
fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
}

/// The spreads with their intervals, and the moduli, for a terminal.
pub fn fit_text(file: &StudyLevelFile) -> String {
    let mut text = format!("{:<28}{:>9}   90 % interval\n", "spread", "mode");
    let values = file.spreads.to_array();
    for (name, value) in crate::material::study_level::SPREAD_NAMES.iter().zip(values) {
        let [low, high] = file.intervals_90.get(*name).copied().unwrap_or([f64::NAN; 2]);
        let _ = writeln!(text, "{name:<28}{value:>9.3}   {low:.3} to {high:.3}");
    }
    let _ = writeln!(text, "\n{:<28}{:>9}   95 % (Pa)", "a person's modulus", "median");
    for ((task, mean), sd) in file.moduli.tasks.iter().zip(&file.moduli.mean_ln_pa).zip(file.moduli.sds_ln()) {
        let at = |k: f64| (mean + k * sd).exp();
        let _ = writeln!(text, "{task:<28}{:>9.0}   {:.0} to {:.0}", at(0.0), at(-1.96), at(1.96));
    }
    text.trim_end().to_owned()
}

/// Shear moduli of a new person at nine levels, for a terminal.
pub fn show_text(rows: &[TaskModuli]) -> String {
    levels_text(rows) + "\n"
}

/// Publications that were left out, in sum, for a terminal.
pub fn left_out_text(left_out: &[LeftOut]) -> String {
    let points = left_out.iter().map(|left| left.points).sum::<usize>();
    let density = left_out.iter().map(|left| left.log_density).sum::<f64>() / points as f64;
    let inside = left_out.iter().filter(|left| left.inside_95 >= 0.9).count();
    let half = left_out.iter().map(|left| left.inside_50).sum::<f64>() / left_out.len() as f64;
    let ranks: Vec<f64> = left_out.iter().map(|left| left.rank).collect();
    format!(
        "{} publications, each predicted from all others: log predictive density {density:.2} per point ({points} points);\n\
         {inside} have nine tenths of their points inside the 95 % band of a new study, {:.0} % of points lie inside the 50 % \
         band;\nranks of their mean log modulus are uniform with p = {:.2}",
        left_out.len(),
        100.0 * half,
        uniform_probability(&ranks)
    )
}

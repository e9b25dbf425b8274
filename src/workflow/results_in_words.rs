//! What single steps have found in a few lines of text. (Of a case, a prediction and their kin: `report`.)

use super::law_fitting::{FittedLaw, LawTest};
use super::lost_label::name_of_label;
use super::meshing::MeshedFile;
use super::programs::Finding;
use super::segmenting::Segmented;
use super::settings::Settings;
use super::simulation::Simulation;
use super::synthetic::SyntheticFiles;
use super::user_file::shown;
use super::why::Explained;
use crate::material::gp::Spread;
use crate::material::rheometry::Measured;
use crate::material::study_level::Of;
use crate::report::in_words::fit_in_words;
use serde_json::Value;
use std::path::Path;

/// A number of a manifest's figures.
fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The programs of this machine, with the command that installs what is missing.
pub fn programs(findings: &[Finding]) -> String {
    let line = |f: &Finding| {
        let state = f.location.clone().unwrap_or_else(|| format!("missing; install: {}", f.install));
        format!("  {:<18} {:<48} {state}\n", f.what, f.used_for)
    };
    "Needed: nothing beyond this program. Optional:\n".to_owned() + &findings.iter().map(line).collect::<String>()
}

/// Why each stage would run.
pub fn explained(stages: &[Explained]) -> String {
    let line = |e: &Explained| {
        let reasons: Vec<String> = e.reasons.iter().map(ToString::to_string).collect();
        format!("{:<16} {}\n", e.stage, if e.would_run { reasons.join("; ") } else { "up to date".to_owned() })
    };
    stages.iter().map(line).collect()
}

/// A deformation, or a motion.
pub fn simulated(found: &Simulation, output: &Path) -> String {
    let Simulation { convergence, motion, .. } = found;
    let mut text = format!(
        "{}: largest displacement {:.3} mm, rms {:.3} mm\n",
        output.display(),
        found.displacement_max_mm,
        found.displacement_rms_mm
    );
    text += &match motion {
        None => format!(
            "{} Newton iterations in {} load steps, {} linear iterations, relative residual {:.1e}\n",
            convergence.iterations.len(),
            convergence.load_steps.len(),
            convergence.linear_iterations(),
            convergence.relative_residual
        ),
        Some(m) => format!(
            "{} time steps, {:.3} s, {} ({:.1e} mm/s)\n",
            m.steps,
            m.time_s,
            if m.rested { "at rest" } else { "still moving" },
            m.fastest_mm_per_s
        ),
    };
    text += &format!(
        "most squeezed: cell {} to {:.3} of its volume\n",
        convergence.worst_cell, convergence.worst_volume_ratio
    );
    for wall in &found.contact {
        let force = wall.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        text += &format!(
            "wall before {}: {:.0} mm2 pressed with {force:.3} N, at most {:.3} mm deep\n",
            wall.set, wall.area_mm2, wall.depth_mm
        );
    }
    for springs in &found.tethers {
        let force = springs.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        text +=
            &format!("springs at {}: {force:.3} N, stretched by at most {:.3} mm\n", springs.set, springs.stretch_mm);
    }
    if let Some(rmse) = found.rmse_mm {
        text += &format!("RMSE against the reference {rmse:.6} mm\n");
    }
    if let Some(series) = &found.series {
        text += &format!("series in {}\n", output.with_file_name(shown(Path::new(series))).display());
    }
    text
}

/// Size and quality of a mesh, a line for each label and each set.
pub fn meshed(found: &MeshedFile, output: &Path) -> String {
    let m = &found.mesh;
    let figure = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let mut text = format!("{}: {} nodes, {} tetrahedra ({})\n", output.display(), m.nodes, m.tets, m.engine);
    text += &format!(
        "  dihedral angles from {:.1} degrees, radius ratio {:.2} on average and {:.2} at least, scaled Jacobian from {:.2}\n",
        figure(m.dihedral_min_deg),
        figure(m.radius_ratio_mean),
        figure(m.radius_ratio_min),
        figure(m.scaled_jacobian_min),
    );
    for (name, percent) in &m.volume_error_percent {
        text += &format!("  {name}: volume {percent:+.2} %, Dice {:.3}\n", figure(m.dice.get(name).copied()));
    }
    for (number, mm3) in &found.left_out_mm3 {
        text += &format!("  left out: {:.2} cc of {}, apart from the rest\n", mm3 / 1000.0, name_of_label(*number));
    }
    for warning in &found.warnings {
        text += &format!("  warning: {warning}\n");
    }
    for set in &found.sets {
        let ([x, y, z], name, nodes, mm2) = (set.centroid_mm, &set.name, set.nodes, set.area_mm2);
        text += &format!("  set {name}: {nodes} nodes, {mm2:.0} mm2 around ({x:.0}, {y:.0}, {z:.0})\n");
    }
    text
}

/// Where the labels are, and the volumes.
pub fn segmented(found: &Segmented) -> String {
    let v = &found.volumes;
    format!(
        "{}\nbrain {:.0} cc: grey matter {:.0}, white matter {:.0}, ventricles {:.1}, other CSF {:.0}",
        found.labels.display(),
        v.brain_cc,
        v.grey_matter_cc,
        v.white_matter_cc,
        v.ventricle_cc,
        v.csf_cc
    )
}

/// Where a synthetic patient is, and what was done to it.
pub fn synthesised(truth: &Value, files: &SyntheticFiles, settings: &Settings) -> String {
    let figure = |name: &str| number(&truth[name]);
    format!(
        "{}: {} {}, resected {:.1} cc, cavity {:.1} cc, brain shift up to {:.1} mm, head turned by {:.1} degrees between the scans",
        files.output.display(),
        settings.synth.side,
        if files.resected_mask.is_some() { "mask" } else { settings.synth.lobe.name() },
        figure("resected_cc"),
        figure("cavity_cc"),
        figure("largest_displacement_mm"),
        figure("rotation_deg"),
    )
}

/// Each law's parameters, moduli and stability.
pub fn fitted(test: &LawTest, laws: &[FittedLaw]) -> String {
    let measured = match test.points.measured {
        Measured::NominalStress => "nominal stress",
        Measured::Energy => "strain energy density",
    };
    let head = format!("{}: {} points of {measured}\n", test.name, test.points.stretches.len());
    laws.iter().fold(head, |text, one| text + &fit_in_words(&one.fit, one.parameter_names, &one.parameter_sd))
}

/// The Gaussian process as it was fitted.
pub fn fitted_process(facts: &Value, rank: usize) -> String {
    let figure = |name: &str| number(&facts[name]);
    format!(
        "{} observations of {} studies, rank {rank}\n\
         negative log marginal likelihood {:.6} (at the published hyperparameters {:.6})\n\
         lengthscale {:.6}\n",
        facts["observations"],
        facts["studies"],
        figure("negative_log_likelihood"),
        figure("negative_log_likelihood_of_published_hyperparameters"),
        figure("lengthscale"),
    )
}

/// Whose the moduli of draws are, with what they were drawn with.
fn drawn_of(settings: &Value) -> &'static str {
    if let Ok(of) = serde_json::from_value(settings["of"].clone()) {
        return match of {
            Of::Mean => " of the task's mean",
            Of::Laboratory => " of what one laboratory finds on average",
            Of::Person => " of a person nobody has measured",
            Of::Study => " of what another laboratory publishes",
        };
    }
    match serde_json::from_value(settings["spread"].clone()) {
        Ok(Spread::Study) => " of what one more study would report",
        Ok(Spread::Tissue) => {
            " of the process's mean curve (with the studies as independent noise about it; what one more study would report \
             spreads far wider)"
        }
        Err(_) => "",
    }
}

/// Materials of a generative model: a row for each level, or the spread of the draws. `settings` are what they were made with.
pub fn materials(facts: &Value, settings: &Value) -> String {
    let rows = facts["materials"].as_array().map_or(&[][..], Vec::as_slice);
    if rows.iter().all(|row| row["sd_level"].is_number()) {
        let row = |row: &Value| {
            let (modulus, r2) = (number(&row["fit"]["shear_modulus_pa"]), number(&row["fit"]["r_squared"]));
            format!("{:>5.2}   {modulus:>18.1}   {r2:.3}\n", number(&row["sd_level"]))
        };
        return "   sd   shear modulus (Pa)      R2\n".to_owned() + &rows.iter().map(row).collect::<String>();
    }
    let q = &facts["shear_modulus_pa"];
    let pa = |name: &str| number(&q[name]);
    // A tail that too few draws were made for is not in the figures.
    let between = |share: &str, low: &str, high: &str| {
        let told = q[low].is_number().then(|| format!(", {share} % in {:.1} to {:.1}", pa(low), pa(high)));
        told.unwrap_or_default()
    };
    format!(
        "{} draws, {} fitted by a law stable at every stretch\nshear modulus{}: median {:.1} Pa{}{}\n",
        q["count"],
        q["stable"],
        drawn_of(settings),
        pa("median"),
        between("68", "p16", "p84"),
        between("95", "p2.5", "p97.5")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_spread_of_drawn_moduli_is_said_to_be_whose_it_is() {
        let facts = json!({
            "materials": [{ "draw": 0 }],
            "shear_modulus_pa": { "count": 1, "stable": 1, "median": 1106.5, "p16": 1093.6, "p84": 1119.9 },
        });
        let said = |settings: Value| materials(&facts, &settings);
        let tissue = said(json!({ "spread": Spread::Tissue }));
        assert!(tissue.contains("of the process's mean curve (with the studies as independent noise"), "{tissue}");
        assert!(tissue.contains("): median 1106.5 Pa, 68 % in 1093.6 to 1119.9"), "{tissue}");
        let study = said(json!({ "spread": Spread::Study }));
        assert!(study.contains("shear modulus of what one more study would report: median"), "{study}");
        let whose = |of: Of| said(json!({ "model": "study-level", "of": of }));
        assert!(whose(Of::Person).contains("of a person nobody has measured: median"));
        // No two spreads are called the same.
        let all: std::collections::BTreeSet<String> = Of::ALL.map(whose).into_iter().chain([tissue, study]).collect();
        assert_eq!(all.len(), 6);
    }
}

//! Summary, tables and charts of an outcome, as HTML.

use super::super::chart::{DataPoint, HeatMap, LineChart, Rule, Series, colour_bar};
use super::super::colour::ColourScale;
use super::super::html::{count, fixed, number};
use super::parts::{quantity, tile};
use crate::experiment::outcome::{
    ESTIMATE, ExperimentOutcome, MeshOutcome, RegistrationOutcome, ResectionVolumes, SampleOutcome,
};
use crate::experiment::verdict::{Claim, pa, range};
use maud::{Markup, PreEscaped, html};

/// A set's name for readers.
pub fn set_name(set: &str) -> String {
    match set {
        "all" => "all nodes".to_owned(),
        "ventricle" => "ventricle wall".to_owned(),
        "margin" => "resection margin".to_owned(),
        other => other.replace('_', " "),
    }
}

/// A tissue's name for readers.
pub fn tissue_name(tissue: &str) -> String {
    tissue.replace('_', " ")
}

/// Median and spread in words.
pub fn spread(values: &[f64]) -> String {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    finite.sort_unstable_by(f64::total_cmp);
    let Some(last) = finite.len().checked_sub(1) else { return "no values".to_owned() };
    let at = |q: f64| number(finite[(q * last as f64).round() as usize], 3);
    format!("{} nodes: median {} mm, 95 % below {} mm, largest {} mm", finite.len(), at(0.5), at(0.95), at(1.0))
}

/// Whether a row stands out, and its cells.
pub type Row = (bool, Vec<Markup>);

/// Cells of plain words.
pub fn words(cells: impl IntoIterator<Item = String>) -> Vec<Markup> {
    cells.into_iter().map(|cell| html! { (cell) }).collect()
}

/// A table that scrolls on its own when the page is narrow.
pub fn table(caption: &str, head: &[String], rows: &[Row]) -> Markup {
    html! {
        div class="scroll" tabindex="0" role="region" aria-label=(caption) {
            table {
                caption { (caption) }
                thead { tr { @for cell in head { th scope="col" { (cell) } } } }
                tbody {
                    @for (chosen, cells) in rows {
                        tr class=[chosen.then_some("best")] {
                            @for (n, cell) in cells.iter().enumerate() {
                                @if n == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        } "\n"
    }
}

/// Key figures, what speaks for the verdict, and what was compared.
pub fn summary(outcome: &ExperimentOutcome) -> Markup {
    let mut tiles: Vec<Markup> = Vec::new();
    // The state the verdict is about, as on the first screen.
    if let Some(judged) = outcome.judged() {
        for set in outcome.rmse_sets() {
            let Some(&rmse) = judged.rmse_mm.get(&set) else { continue };
            let note = outcome
                .rest_rmse_mm
                .get(&set)
                .map_or_else(String::new, |rest| format!("undeformed: {} mm", number(*rest, 3)));
            tiles.push(tile(&format!("RMSE, {}", set_name(&set)), &quantity(Some(rmse), 3, "mm"), &note));
        }
    }
    // What the verdict says of them: a range where samples cannot be told apart, nothing where none is claimed.
    tiles.extend(outcome.verdict.moduli.iter().filter_map(|(tissue, claim)| modulus(tissue, claim)));
    for (tissue, truth) in &outcome.reference_shear_modulus_pa {
        let name = format!("Shear modulus of the reference, {}", tissue_name(tissue));
        tiles.push(tile(&name, &quantity(Some(*truth), 4, "Pa"), "what went in"));
    }
    for (tissue, modulus) in &outcome.held_shear_modulus_pa {
        let name = format!("Shear modulus, {}", tissue_name(tissue));
        tiles.push(tile(
            &name,
            &quantity(Some(*modulus), 4, "Pa"),
            "held at the prior of abnormal tissue, not estimated",
        ));
    }
    let floor_mm = outcome.noise_floor.and_then(|floor| floor.combined_mm());
    tiles.extend(outcome.volumes.iter().flat_map(|v| volume_tiles(v, floor_mm)));
    if let Some(floor) = outcome.noise_floor {
        let part = |name: &str, mm: Option<f64>| mm.map(|mm| format!("{name} {} mm", number(mm, 2)));
        let parts: Vec<String> = [
            part("registration", floor.registration_mm),
            part("voxel", floor.voxel_mm),
            part("segmentation", floor.segmentation_mm),
            part("measured at rest", floor.at_rest_mm),
        ]
        .into_iter()
        .flatten()
        .collect();
        tiles.push(tile("Noise floor", &quantity(floor.combined_mm(), 2, "mm"), &parts.join(", ")));
    }
    if let Some(mesh) = &outcome.mesh {
        let note = format!("{} nodes, engine {}", count(mesh.nodes), mesh.engine);
        tiles.push(tile("Tetrahedra", &html! { (count(mesh.tets)) }, &note));
    }
    html! {
        @if let Some(part) = compared(outcome) { p { (part) } "\n" }
        @if !outcome.verdict.reasons.is_empty() {
            p { "What speaks for the verdict:" }
            ul { @for reason in outcome.verdict.because() { li { (reason) } } } "\n"
        }
        dl class="figures" { @for tile in tiles { (tile) } } "\n"
    }
}

/// What is said of a tissue's modulus; `None` where nothing is.
pub fn modulus(tissue: &str, claim: &Claim) -> Option<Markup> {
    let name = format!("Shear modulus, {}", tissue_name(tissue));
    let (value, note) = match claim {
        Claim::Interval { mode_pa, interval_95_pa } => {
            (pa(*mode_pa), format!("95 % interval: {}", range(*interval_95_pa)))
        }
        Claim::Above { bound_pa } => (format!("> {}", pa(*bound_pa)), "with 95 % certainty".to_owned()),
        Claim::Range { range_pa } => {
            let said = range(*range_pa);
            let note = if said.contains(" to ") { "cannot be told apart" } else { "the best sample" };
            (said.trim_end_matches(" Pa").to_owned(), note.to_owned())
        }
        Claim::Withheld => return None,
    };
    Some(tile(&name, &html! { (value) span class="unit" { " Pa" } }, &note))
}

fn volume_tiles(v: &ResectionVolumes, floor_mm: Option<f64>) -> Vec<Markup> {
    let mut tiles = Vec::new();
    if v.resected_cc.is_some() {
        tiles.push(tile("Resected tissue", &quantity(v.resected_cc, 3, "cc"), "on the image before surgery"));
    }
    if v.cavity_cc.is_some() {
        tiles.push(tile("Cavity", &quantity(v.cavity_cc, 3, "cc"), "on the image after surgery"));
    }
    if v.ventricle_before_cc.is_some() {
        let change = |after: f64| v.ventricle_before_cc.map_or(0.0, |before| 100.0 * (after / before - 1.0));
        let after = |after: f64| format!("after: {} cc ({} %)", number(after, 3), signed_fixed(change(after)));
        let note = v.ventricle_after_cc.map_or_else(String::new, after);
        tiles.push(tile("Ventricles before surgery", &quantity(v.ventricle_before_cc, 3, "cc"), &note));
    }
    if let Some(shift) = v.midline_shift_mm {
        tiles.push(midline_tile(shift, floor_mm));
    }
    if v.brain_cc.is_some() {
        tiles.push(tile("Brain before surgery", &quantity(v.brain_cc, 4, "cc"), ""));
    }
    tiles
}

/// How far the midline has moved; to no side where that is less than the scans can tell, or than the decimal that is shown.
fn midline_tile(shift_mm: f64, floor_mm: Option<f64>) -> Markup {
    /// What one decimal rounds to nothing, mm.
    const SHOWN_MM: f64 = 0.05;
    let side = match floor_mm.filter(|floor| *floor > SHOWN_MM) {
        Some(floor) if shift_mm.abs() < floor => "to no side: below the noise floor",
        None if shift_mm.abs() < SHOWN_MM => "to no side",
        _ if shift_mm > 0.0 => "to the right",
        _ => "to the left",
    };
    tile("Midline shift", &html! { (fixed(shift_mm.abs(), 1)) span class="unit" { " mm" } }, side)
}

fn signed_fixed(percent: f64) -> String {
    if percent > 0.0 { format!("+{}", fixed(percent, 1)) } else { fixed(percent, 1) }
}

/// A level of the prior: two decimals at most, and none that say nothing.
fn signed(level: f64) -> String {
    let text = fixed(level, 2);
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if level > 0.0 { format!("+{text}") } else { text.to_owned() }
}

/// How many simulations there are, and what they were held against; nothing where none was made.
fn compared(outcome: &ExperimentOutcome) -> Option<String> {
    let all = outcome.samples.len();
    let converged = outcome.samples.iter().filter(|s| s.converged).count();
    let reference = &outcome.reference;
    let simulations = if all == 1 { "simulation" } else { "simulations" };
    (all > 0).then(|| format!("{converged} of {all} {simulations} converged. Compared with: {reference}."))
}

/// Registrations in numbers.
pub fn registrations(all: &[RegistrationOutcome]) -> Option<Markup> {
    if all.is_empty() {
        return None;
    }
    let head = ["registration", "rotation (°)", "translation x, y, z (mm)", "similarity", "before", "after"];
    let rows: Vec<Row> = all
        .iter()
        .map(|r| {
            let shift: Vec<String> = r.translation_mm.iter().map(|t| fixed(*t, 2)).collect();
            let similarity = |s: Option<f64>| s.map_or_else(|| "–".to_owned(), |s| number(s, 4));
            let cells = [
                format!("{} to {}", r.moving, r.fixed),
                fixed(r.rotation_deg, 2),
                shift.join(", "),
                r.similarity.clone(),
                similarity(r.similarity_before),
                similarity(r.similarity_after),
            ];
            (false, words(cells))
        })
        .collect();
    Some(table("Rigid registrations", &head.map(str::to_owned), &rows))
}

/// Mesh quality and boundary sets.
pub fn mesh(outcome: &ExperimentOutcome) -> Option<Markup> {
    let tables: Vec<Markup> = outcome.mesh.iter().map(quality).chain(boundary_sets(outcome)).collect();
    (!tables.is_empty()).then(|| html! { @for table in tables { (table) } })
}

fn quality(m: &MeshOutcome) -> Markup {
    let optional = |v: Option<f64>, digits, unit: &str| {
        v.map_or_else(|| "–".to_owned(), |v| format!("{} {unit}", number(v, digits)))
    };
    let mut rows = vec![
        ("engine".to_owned(), m.engine.clone()),
        ("nodes".to_owned(), count(m.nodes)),
        ("tetrahedra".to_owned(), count(m.tets)),
        ("smallest dihedral angle".to_owned(), optional(m.dihedral_min_deg, 3, "°")),
        ("1 % of tetrahedra have one below".to_owned(), optional(m.dihedral_percentile_1_deg, 3, "°")),
        ("tetrahedra below 10°".to_owned(), optional(m.dihedral_below_10_percent, 2, "%")),
        ("radius ratio, mean".to_owned(), optional(m.radius_ratio_mean, 3, "")),
        ("radius ratio, smallest".to_owned(), optional(m.radius_ratio_min, 3, "")),
        ("scaled Jacobian, smallest".to_owned(), optional(m.scaled_jacobian_min, 3, "")),
    ];
    for (name, cc) in &m.volume_cc {
        rows.push((format!("volume, {}", tissue_name(name)), format!("{} cc", number(*cc, 4))));
    }
    for (name, percent) in &m.volume_error_percent {
        let name = format!("volume against the label map, {}", tissue_name(name));
        rows.push((name, format!("{} %", fixed(*percent, 2))));
    }
    for (name, dice) in &m.dice {
        rows.push((format!("Dice with the label map, {}", tissue_name(name)), fixed(*dice, 3)));
    }
    if let (Some(mean), Some(far)) = (m.surface_distance_mean_mm, m.surface_distance_95_mm) {
        let figures = format!("{} / {} mm", fixed(mean, 2), fixed(far, 2));
        rows.push(("distance to the border of the labels, mean / 95 %".to_owned(), figures));
    }
    let rows: Vec<Row> = rows.into_iter().map(|(name, value)| (false, words([name, value]))).collect();
    html! {
        div class="columns" {
            (table("Mesh", &["measure".to_owned(), "value".to_owned()], &rows))
            @if !m.dihedral_counts.is_empty() { figure { (PreEscaped(dihedral_chart(&m.dihedral_counts))) } }
        }
    }
}

fn boundary_sets(outcome: &ExperimentOutcome) -> Option<Markup> {
    let head = ["set", "nodes", "area (mm²)", "centre x, y, z (mm)"].map(str::to_owned);
    let rows: Vec<Row> = outcome
        .sets
        .iter()
        .map(|s| {
            let centre = s.centroid_mm.map(|c| c.map(|x| fixed(x, 1)).join(", "));
            let area = s.area_mm2.map(|a| number(a, 4));
            let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
            let cells = [s.name.clone(), count(s.nodes), or_dash(area), or_dash(centre)];
            (false, words(cells))
        })
        .collect();
    (!rows.is_empty()).then(|| table("Boundary sets", &head, &rows))
}

fn dihedral_chart(counts: &[usize]) -> String {
    let width = 180.0 / counts.len() as f64;
    let points = counts.iter().enumerate().map(|(n, &angles)| DataPoint {
        x: (n as f64 + 0.5) * width,
        y: angles as f64,
        y_error: None,
        note: format!("{:.0} to {:.0}°: {}", n as f64 * width, (n + 1) as f64 * width, count(angles)),
        chosen: false,
    });
    let chart = LineChart {
        description: "Dihedral angles of the mesh: number of angles over the angle in degrees".to_owned(),
        x_label: "dihedral angle (°)".to_owned(),
        y_label: "angles".to_owned(),
        y_from_zero: true,
        series: vec![Series { name: "angles".to_owned(), points: points.collect() }],
        ..LineChart::default()
    };
    chart.to_svg()
}

/// Table of the samples, and their curves where these are not drawn elsewhere.
pub fn samples(outcome: &ExperimentOutcome, curves: bool) -> Markup {
    let (table, all) = (sample_table(outcome), outcome.samples.len());
    html! {
        @if curves { div class="charts" { (figures(outcome)) } "\n" }
        @if all > 20 { details { summary { "All " (all) " samples" } (table) } } @else { (table) }
    }
}

/// A curve, or a map for every set where two tissues form a grid.
pub fn figures(outcome: &ExperimentOutcome) -> Markup {
    if let Some(grid) = Grid::of(outcome) {
        return html! { @for set in outcome.rmse_sets() { (grid.figure(outcome, &set)) } };
    }
    html! {
        @if let Some(curve) = curve(outcome) {
            figure { (PreEscaped(curve)) figcaption { (curve_caption(outcome)) } }
        }
    }
}

fn curve_caption(outcome: &ExperimentOutcome) -> String {
    let floor = outcome.noise_floor.and_then(|f| f.combined_mm());
    let floor = floor.map_or("", |_| " Differences below the noise floor mean nothing.");
    format!("RMSE of every sample; the ring marks the best one.{floor}")
}

/// RMSE over the modulus (one tissue) or over the SD level (several tissues that move together); `None` where no sample has one.
fn curve(outcome: &ExperimentOutcome) -> Option<String> {
    let one = outcome.tissues.len() == 1;
    let tissue = outcome.tissues.first().cloned().unwrap_or_default();
    let abscissa =
        |s: &SampleOutcome| if one { s.shear_modulus_pa.get(&tissue) } else { s.sd_levels.get(&tissue) }.copied();
    let mut series = Vec::new();
    // Where tasks are compared each has a curve of its own.
    let mut tasks: Vec<Option<&str>> = outcome.samples.iter().map(|s| s.task.as_deref()).collect();
    tasks.dedup();
    for (set, task) in
        outcome.rmse_sets().into_iter().flat_map(|set| tasks.iter().map(move |task| (set.clone(), *task)))
    {
        let mut points: Vec<DataPoint> = outcome
            .samples
            .iter()
            .filter(|s| s.task.as_deref() == task)
            .filter_map(|s| {
                let moduli: Vec<String> = s
                    .shear_modulus_pa
                    .iter()
                    .map(|(t, mu)| format!("{} {} Pa", tissue_name(t), number(*mu, 4)))
                    .collect();
                let y = s.rmse_mm.get(&set).copied().unwrap_or(f64::NAN);
                let note = format!("{}: {} mm; {}", s.id, number(y, 3), moduli.join(", "));
                let chosen = outcome.best_sample.as_deref() == Some(s.id.as_str());
                Some(DataPoint { x: abscissa(s)?, y, y_error: None, note, chosen })
            })
            .collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        if points.iter().any(|p| p.y.is_finite()) {
            series.push(Series { name: task.map_or_else(|| set_name(&set), |task| task.replace('-', " ")), points });
        }
    }
    if series.is_empty() {
        return None;
    }
    let mut y_rules: Vec<Rule> = outcome
        .rest_rmse_mm
        .iter()
        .map(|(set, mm)| Rule { at: *mm, name: format!("undeformed, {}", set_name(set)) })
        .collect();
    let floor = outcome.noise_floor.and_then(|f| f.combined_mm());
    y_rules.extend(floor.map(|mm| Rule { at: mm, name: "noise floor".to_owned() }));
    let truth = outcome.reference_shear_modulus_pa.get(&tissue).filter(|_| one);
    let x_label = if one {
        format!("shear modulus of {} (Pa)", tissue_name(&tissue))
    } else {
        "level of the prior (SD from its mean, all tissues)".to_owned()
    };
    let chart = LineChart {
        description: format!("RMSE of the samples over the {x_label}"),
        x_label,
        y_label: "RMSE (mm)".to_owned(),
        x_log: one,
        y_from_zero: true,
        series,
        y_rules,
        x_rules: truth.map(|t| Rule { at: *t, name: "reference".to_owned() }).into_iter().collect(),
        ..LineChart::default()
    };
    Some(chart.to_svg())
}

/// Samples of two tissues on a full grid.
struct Grid {
    /// Tissue of the columns and of the rows.
    tissues: [String; 2],
    /// Moduli of the columns and of the rows, ascending.
    moduli_pa: [Vec<f64>; 2],
    /// Sample number at [row][column].
    samples: Vec<Vec<usize>>,
}

impl Grid {
    fn of(outcome: &ExperimentOutcome) -> Option<Self> {
        let [a, b] = <[String; 2]>::try_from(outcome.tissues.clone()).ok()?;
        let distinct = |tissue: &String| {
            // An estimate lies between the lines.
            let swept = outcome.samples.iter().filter(|s| s.id != ESTIMATE);
            let mut values: Vec<f64> = swept.filter_map(|s| s.shear_modulus_pa.get(tissue).copied()).collect();
            values.sort_unstable_by(f64::total_cmp);
            values.dedup();
            values
        };
        let moduli_pa = [distinct(&a), distinct(&b)];
        if moduli_pa.iter().any(|m| m.len() < 2) {
            return None;
        }
        let find = |x: f64, y: f64| {
            outcome
                .samples
                .iter()
                .position(|s| s.shear_modulus_pa.get(&a) == Some(&x) && s.shear_modulus_pa.get(&b) == Some(&y))
        };
        let row = |y: &f64| moduli_pa[0].iter().map(|x| find(*x, *y)).collect::<Option<Vec<usize>>>();
        let samples = moduli_pa[1].iter().map(row).collect::<Option<Vec<_>>>()?;
        Some(Self { tissues: [a, b], moduli_pa, samples })
    }

    fn figure(&self, outcome: &ExperimentOutcome, set: &str) -> Markup {
        let rmse = |n: usize| outcome.samples[n].rmse_mm.get(set).copied().unwrap_or(f64::NAN);
        let values: Vec<Vec<f64>> = self.samples.iter().map(|row| row.iter().map(|n| rmse(*n)).collect()).collect();
        let title = format!("RMSE, {} (mm)", set_name(set));
        let Some(scale) = ColourScale::over(values.iter().flatten().copied(), &title) else {
            return html! {};
        };
        let names = |axis: usize| self.moduli_pa[axis].iter().map(|m| number(*m, 4)).collect::<Vec<_>>();
        let place = |id: &String| {
            let at = |n: &usize| &outcome.samples[*n].id == id;
            let row = self.samples.iter().position(|row| row.iter().any(at))?;
            Some((row, self.samples[row].iter().position(at)?))
        };
        let [a, b] = self.tissues.each_ref().map(|t| tissue_name(t));
        let map = HeatMap {
            description: format!("{title} over the shear moduli of {a} and {b}, smallest {}", number(scale.low, 3)),
            x_label: format!("shear modulus of {a} (Pa)"),
            y_label: format!("shear modulus of {b} (Pa)"),
            columns: names(0),
            rows: names(1),
            values,
            chosen: outcome.best_sample.as_ref().and_then(place),
            scale,
        };
        html! {
            figure {
                (PreEscaped(map.to_svg()))
                figcaption {
                    div class="bar-row" { (PreEscaped(colour_bar(&map.scale))) }
                    "The frame marks the best sample."
                }
            }
        }
    }
}

fn sample_table(outcome: &ExperimentOutcome) -> Markup {
    let sets = outcome.rmse_sets();
    let mut head = vec!["sample".to_owned()];
    let level_of = |s: &SampleOutcome, tissue: &String| s.sd_levels.get(tissue).copied();
    let together = |s: &SampleOutcome| outcome.tissues.windows(2).all(|t| level_of(s, &t[0]) == level_of(s, &t[1]));
    // One column when all tissues move together, none without levels.
    let levelled: &[String] = if outcome.samples.iter().all(|s| s.sd_levels.is_empty()) {
        &[]
    } else if outcome.samples.iter().all(together) {
        outcome.tissues.get(..1).unwrap_or(&[])
    } else {
        &outcome.tissues
    };
    for tissue in levelled {
        let whose = if levelled.len() == 1 { String::new() } else { format!(" of {}", tissue_name(tissue)) };
        head.push(format!("level{whose} (SD)"));
    }
    for tissue in &outcome.tissues {
        head.push(format!("µ of {} (Pa)", tissue_name(tissue)));
    }
    head.extend(sets.iter().map(|set| format!("RMSE, {} (mm)", set_name(set))));
    let apart = outcome.samples.iter().any(|s| !s.surface_distance_mm.is_empty());
    let apart: &[String] = if apart { &sets } else { &[] };
    head.extend(apart.iter().map(|set| format!("surfaces apart, {} (mm)", set_name(set))));
    head.extend(["largest displacement (mm)", "Newton steps", "converged"].map(str::to_owned));
    let mut rows: Vec<Row> = Vec::new();
    let dash = || "–".to_owned();
    if !outcome.rest_rmse_mm.is_empty() {
        let mut row = vec!["undeformed".to_owned()];
        row.extend(levelled.iter().chain(&outcome.tissues).map(|_| dash()));
        row.extend(sets.iter().map(|set| outcome.rest_rmse_mm.get(set).map_or_else(dash, |mm| number(*mm, 3))));
        let rest_apart = &outcome.rest_surface_distance_mm;
        row.extend(apart.iter().map(|set| rest_apart.get(set).map_or_else(dash, |mm| number(*mm, 3))));
        row.extend([number(0.0, 1), dash(), dash()]);
        rows.push((false, words(row)));
    }
    for s in &outcome.samples {
        // An estimate that claims no modulus has won against nothing.
        let best = outcome.best_sample.as_deref() == Some(s.id.as_str()) && !s.shear_modulus_pa.is_empty();
        let mut row = vec![if best { format!("{} · best", s.id) } else { s.id.clone() }];
        row.extend(levelled.iter().map(|t| s.sd_levels.get(t).map_or_else(dash, |level| signed(*level))));
        let modulus = |t: &String| s.shear_modulus_pa.get(t).map_or_else(dash, |mu| number(*mu, 4));
        row.extend(outcome.tissues.iter().map(modulus));
        row.extend(sets.iter().map(|set| s.rmse_mm.get(set).map_or_else(dash, |mm| number(*mm, 3))));
        row.extend(apart.iter().map(|set| s.surface_distance_mm.get(set).map_or_else(dash, |mm| number(*mm, 3))));
        row.push(s.displacement_max_mm.map_or_else(dash, |mm| number(mm, 3)));
        row.push(s.newton_iterations.to_string());
        row.push(if s.converged { "yes" } else { "no" }.to_owned());
        rows.push((best, words(row)));
    }
    table("Samples (µ: shear modulus, undeformed)", &head, &rows)
}

/// Residuals over Newton steps.
pub fn convergence(outcome: &ExperimentOutcome) -> Option<Markup> {
    let mut shown: Vec<&SampleOutcome> = outcome.samples.iter().filter(|s| s.relative_residuals.len() > 1).collect();
    // Six lines can be told apart: the best sample, then evenly through the grid.
    let best = outcome.best_sample.as_deref();
    if shown.len() > 6 {
        let last = shown.len() - 1;
        let mut picked: Vec<usize> = (0..5).map(|n| n * last / 4).collect();
        picked.extend(shown.iter().position(|s| Some(s.id.as_str()) == best));
        picked.sort_unstable();
        picked.dedup();
        shown = picked.into_iter().map(|n| shown[n]).collect();
    }
    if shown.is_empty() {
        return None;
    }
    let series = shown.iter().map(|s| Series {
        name: s.id.clone(),
        points: s
            .relative_residuals
            .iter()
            .enumerate()
            .map(|(n, r)| DataPoint {
                x: n as f64,
                y: *r,
                y_error: None,
                note: format!("{}: step {n}, {r:.1e}", s.id),
                chosen: false,
            })
            .collect(),
    });
    let chart = LineChart {
        description: "Relative residual of the solver over Newton steps, one line per sample".to_owned(),
        x_label: "Newton step".to_owned(),
        y_label: "relative residual".to_owned(),
        y_log: true,
        series: series.collect(),
        ..LineChart::default()
    };
    let unfinished: Vec<String> = outcome.samples.iter().filter(|s| !s.converged).map(|s| s.id.clone()).collect();
    let verdict = if unfinished.is_empty() {
        "Every simulation reached its tolerance.".to_owned()
    } else {
        format!("Without a result: {}.", unfinished.join(", "))
    };
    Some(html! {
        p { (verdict) }
        div class="charts" { figure { (PreEscaped(chart.to_svg())) } } "\n"
    })
}

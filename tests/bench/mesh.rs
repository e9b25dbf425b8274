//! Meshes of the template's labels: accuracy, shape, size and time, engine by engine.

use crate::bar::{Bar, data};
use hgm::geometry::Native;
use hgm::image::LabelMap;
use hgm::image::nifti::{ReadOptions, decode_labels};
use hgm::mesh::engine::{Engine, EnginePrograms, MeshSettings, MeshSize, mesh_labels};
use hgm::mesh::quality::{fidelity, shape_quality, surface_distance};
use hgm::tag::{TagSettings, falx_sheet, tag_boundary_sets};
use std::collections::BTreeMap;
use std::time::Instant;

/// Most volume error (percent) and least Dice of grey, white and ventricle; mean and 95 % surface distance (mm); seconds.
struct Limits {
    cells: usize,
    volume_percent: [f64; 3],
    dice: [f64; 3],
    surface_mm: [f64; 2],
    wall_s: f64,
}

const LIMITS: [Limits; 2] = [
    Limits {
        cells: 60_000,
        volume_percent: [1.0, 1.5, 3.0],
        dice: [0.945, 0.93, 0.91],
        surface_mm: [0.5, 1.0],
        wall_s: 5.0,
    },
    Limits {
        cells: 160_000,
        volume_percent: [0.5, 0.5, 1.0],
        dice: [0.97, 0.965, 0.955],
        surface_mm: [0.35, 0.7],
        wall_s: 10.0,
    },
];

pub fn bars() -> Vec<Bar> {
    let Some(folder) = data() else { return Vec::new() };
    let file = folder.join("meshes/template_labels.nii.gz");
    let Ok(bytes) = std::fs::read(&file) else {
        println!("{} is not there: no bars of meshes", file.display());
        return Vec::new();
    };
    let (map, _): (LabelMap<Native>, _) =
        decode_labels(&bytes, "template_labels.nii.gz", &ReadOptions::default()).expect("the measuring data are sound");
    let programs = hgm::workflow::Programs::look_up(None, |name| std::env::var_os(name)).engines();
    let mut bars = Vec::new();
    for engine in Engine::all().filter(|engine| programs.has(*engine)) {
        let mut areas: Vec<BTreeMap<String, f64>> = Vec::new();
        for limits in &LIMITS {
            areas.extend(column(&map, engine, &programs, limits, &mut bars));
        }
        if let [coarse, fine] = &areas[..] {
            let worst = coarse.iter().map(|(set, area)| (100.0 * (area / fine[set] - 1.0).abs(), set.clone()));
            let (percent, set) = worst.fold((0.0, String::new()), |a, b| if b.0 > a.0 { b } else { a });
            let name = format!("mesh {}: set areas at both sizes", engine.name());
            bars.push(Bar::new(&name, "within 8 %", format!("{percent:.1} % ({set})"), percent <= 8.0));
        }
    }
    bars
}

/// One engine at one size; returns the areas of the boundary sets.
fn column(
    map: &LabelMap<Native>,
    engine: Engine,
    programs: &EnginePrograms,
    limits: &Limits,
    bars: &mut Vec<Bar>,
) -> Option<BTreeMap<String, f64>> {
    // The lattice may have half as many tets again; a sixth is enough.
    let cells = if engine == Engine::LATTICE { limits.cells * 7 / 6 } else { limits.cells };
    let settings =
        MeshSettings { engine, size: MeshSize::Cells(cells), split: Some(falx_sheet()), ..MeshSettings::default() };
    let start = Instant::now();
    let made = mesh_labels(map, &settings, programs);
    let wall_s = start.elapsed().as_secs_f64();
    let name = |what: &str| format!("mesh {} {}k: {what}", engine.name(), limits.cells / 1000);
    let (mut mesh, _) = match made {
        Ok(made) => made,
        Err(error) => {
            bars.push(Bar::new(&name("a mesh"), "there is one", error.to_string(), false));
            return None;
        }
    };
    let mut add =
        |what: &str, bar: String, measured: String, met: bool| bars.push(Bar::new(&name(what), &bar, measured, met));
    let (count, shape) = (mesh.tets().len(), shape_quality(&mesh));
    let off = 100.0 * (count as f64 / cells as f64 - 1.0);
    add("tets", "within 15 %".into(), format!("{count} ({off:+.1} %)"), off.abs() <= 15.0);
    let (least, share, first) =
        (shape.dihedral_min_deg, shape.dihedral_below_10_percent, shape.dihedral_percentile_1_deg);
    add(
        "dihedral min, < 10, 1st percentile",
        ">= 10; <= .05 %; >= 15".into(),
        format!("{least:.1}; {share:.3} %; {first:.1}"),
        least >= 10.0 && share <= 0.05 && first >= 15.0,
    );
    let (mean, ratio, jacobian) = (shape.radius_ratio_mean, shape.radius_ratio_min, shape.scaled_jacobian_min);
    add(
        "radius ratio mean, min, scaled Jacobian",
        ">= .70; >= .10; >= .05".into(),
        format!("{mean:.3}; {ratio:.3}; {jacobian:.3}"),
        mean >= 0.7 && ratio >= 0.1 && jacobian >= 0.05,
    );
    let (rough, crossing) = (shape.non_manifold_outer_edges, shape.crossing_facets);
    add("non-manifold edges, crossing facets", "0; 0".into(), format!("{rough}; {crossing}"), rough + crossing == 0);
    let fit = fidelity(&mesh, map, &[]);
    let figures = [2, 3, 4].map(|l| fit.label(l).map_or((f64::NAN, 0.0), |f| (f.volume_error_percent, f.dice)));
    let volumes = figures.map(|f| f.0);
    let met = (0..3).all(|n| volumes[n].abs() <= limits.volume_percent[n]);
    add("volume error", format!("<= {:?} %", limits.volume_percent), format!("{volumes:.2?} %"), met);
    let dice = figures.map(|f| f.1);
    let met = (0..3).all(|n| dice[n] >= limits.dice[n]);
    add("Dice", format!(">= {:?}", limits.dice), format!("{dice:.4?}"), met);
    if let Some(distance) = surface_distance(&mesh, map, &[]) {
        let measured = [distance.mean_mm, distance.percentile_95_mm];
        let met = (0..2).all(|n| measured[n] <= limits.surface_mm[n]);
        add("surface distance mean, 95 %", format!("<= {:?} mm", limits.surface_mm), format!("{measured:.2?} mm"), met);
    }
    add("wall", format!("<= {} s", limits.wall_s), format!("{wall_s:.1} s"), wall_s <= limits.wall_s);
    let report = tag_boundary_sets(&mut mesh, &TagSettings::default()).ok()?;
    Some(report.sets.into_iter().map(|set| (set.name, set.area_mm2)).collect())
}

//! Bars of walls without friction: what is known of simple bodies (the tests' own cases, their figures written down), and cost,
//! depth, robustness and bytes on the brain meshes of `HGM_BENCH_DATA`, in the skull that the template's labels give.

use super::bar::{Bar, cpu_seconds, data};
use super::hertz::{self, CONTACT_MM, REFINEMENTS};
use super::walls::{
    ROOMS, energy_kept_in_a_bounce, even_pressure, sensitivities_off, slid_apart_along_a_sheet, slid_down_a_slope,
};
use hgm::experiment::resection::{ResectionSettings, Supports};
use hgm::experiment::supports::{SkullSettings, with_sliding_sets};
use hgm::fem::{FemError, Outcome, Scenario, simulate};
use hgm::geometry::{Mni, SmoothField};
use hgm::image::LabelMap;
use hgm::image::nifti::{ReadOptions, decode};
use hgm::material::law::Material;
use hgm::material::random::CounterRng;
use hgm::mesh::TetMesh;
use hgm::mesh::format::vtu;
use hgm::tag::{TagSettings, tag_boundary_sets};
use std::path::Path;
use std::sync::Arc;

const DEEPEST_MM: f64 = 0.05;

fn on_threads<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had").install(f)
}

/// A brain mesh with the labels of DSEG files and all boundary sets.
fn mesh(folder: &Path, name: &str, skull: &SkullSettings) -> Option<TetMesh> {
    let read = vtu::decode(&std::fs::read(folder.join(name)).ok()?, name).ok()?.mesh;
    let labels = read.labels().iter().map(|l| l + 1).collect();
    let mut mesh = TetMesh::new(read.nodes_mm().to_vec(), read.tets().to_vec(), labels).ok()?;
    tag_boundary_sets(&mut mesh, &TagSettings::default()).ok()?;
    Some(with_sliding_sets(&mesh, skull))
}

fn skull(folder: &Path, settings: &SkullSettings) -> Option<Arc<SmoothField>> {
    let name = "template_labels.nii.gz";
    let volume = decode(&std::fs::read(folder.join(name)).ok()?, name, &ReadOptions::default()).ok()?.volume;
    let labels: LabelMap<Mni> = volume.map(|v: f32| v as u8).relabelled();
    settings.distance(&labels).map(Arc::new)
}

/// Grey 1370 Pa, white 990 Pa, the whole weight along -z, held by base and falx.
fn held(settings: &ResectionSettings) -> Scenario {
    let mut scenario = settings.scenario(&nalgebra::UnitQuaternion::identity());
    for (name, pa) in [("grey_matter", 1370.0), ("white_matter", 990.0)] {
        scenario.materials.insert(name.to_owned(), Material::neo_hookean(pa, 0.45));
    }
    scenario
}

fn solve(mesh: &TetMesh, scenario: &Scenario) -> Result<Outcome, FemError> {
    simulate(mesh, scenario, &|_| ())
}

fn timed(mesh: &TetMesh, scenario: &Scenario) -> (f64, Result<Outcome, FemError>) {
    let begin = cpu_seconds();
    let first = on_threads(1, || solve(mesh, scenario));
    let once = cpu_seconds() - begin;
    if once > 1.0 {
        return (once, first);
    }
    // The kernel counts in hundredths of a second.
    let begin = cpu_seconds();
    on_threads(1, || (0..5).for_each(|_| drop(solve(mesh, scenario))));
    ((cpu_seconds() - begin) / 5.0, first)
}

fn words(outcome: &Outcome) -> String {
    let wall = &outcome.contact[0];
    format!(
        "{} Newton and {} linear iterations, {} load steps, {:.0} mm2 pressed",
        outcome.convergence.iterations.len(),
        outcome.convergence.linear_iterations(),
        outcome.convergence.load_steps.len(),
        wall.area_mm2
    )
}

fn cost(name: &str, mesh: &TetMesh, settings: &ResectionSettings, field: &Arc<SmoothField>, bars: &mut Vec<Bar>) {
    for (gravity, down) in [("upright", [0.0, 0.0, -9.81]), ("on the back", [0.0, -9.81, 0.0])] {
        let mut held = held(settings);
        held.loads.gravity_m_per_s2 = down;
        let sliding = settings.sliding(&held, field);
        let ((fixed_s, _), (sliding_s, found)) = (timed(mesh, &held), timed(mesh, &sliding));
        let ratio = sliding_s / fixed_s;
        let named = |what: &str| format!("contact {name} {gravity}, {what}");
        match found {
            Ok(found) => {
                let text = format!("{ratio:.2}x ({sliding_s:.2} and {fixed_s:.2} CPU-s; {})", words(&found));
                bars.push(Bar::new(&named("cost"), "<= 3x the held solve", text, ratio <= 3.0));
                let depth = found.contact[0].depth_mm;
                bars.push(Bar::new(
                    &named("depth"),
                    &format!("<= {DEEPEST_MM} mm"),
                    format!("{depth:.4} mm"),
                    depth <= DEEPEST_MM,
                ));
            }
            Err(error) => bars.push(Bar::new(&named("cost"), "<= 3x the held solve", error.to_string(), false)),
        }
    }
}

/// Any posture, density, stiffness and room; every third one slides along no falx at all, every fourth one is an element that
/// does not lock.
fn random_scenario(n: u64, settings: &ResectionSettings, field: &Arc<SmoothField>) -> Scenario {
    let rng = CounterRng::new(17, n);
    let between = |counter, low: f64, high: f64| rng.between(counter, low, high);
    let mut settings = settings.clone();
    settings.skull.gap_mm = between(0, 0.0, 4.0);
    settings.density_kg_per_m3 = between(1, 33.0, 1040.0);
    let mut scenario = held(&settings);
    scenario.loads.gravity_m_per_s2 = rng.direction(100).map(|d| 9.81 * d);
    for (k, name) in (10..).step_by(10).zip(["grey_matter", "white_matter"]) {
        let (mu, nu) = (between(k, 200f64.ln(), 5e3f64.ln()).exp(), between(k + 1, 0.30, 0.49));
        scenario.materials.insert(name.to_owned(), Material::neo_hookean(mu, nu));
    }
    let mut sliding = settings.sliding(&scenario, field);
    if n.is_multiple_of(3) {
        sliding.fixed.retain(|set| set != "falx");
    }
    if n.is_multiple_of(4) {
        sliding.solver.element = hgm::fem::ElementKind::TET4_NODAL;
    }
    sliding
}

fn robustness(small: &TetMesh, settings: &ResectionSettings, field: &Arc<SmoothField>, bars: &mut Vec<Bar>) {
    let (mut converged, mut verdicts, mut broken) = (0, 0, 0);
    let begin = cpu_seconds();
    for n in 0..200 {
        match on_threads(1, || solve(small, &random_scenario(n, settings, field))) {
            Ok(outcome) if outcome.displacement_mm.iter().flatten().all(|v| v.is_finite()) => converged += 1,
            Err(FemError::NoEquilibrium { .. }) => verdicts += 1,
            _ => broken += 1,
        }
    }
    let text =
        format!("{converged} converge, {verdicts} verdicts, {broken} broken, {:.0} CPU-s", cpu_seconds() - begin);
    bars.push(Bar::new("contact 200 random scenarios", "all end well or with a verdict", text, broken == 0));
}

fn bytes(small: &TetMesh, settings: &ResectionSettings, field: &Arc<SmoothField>, bars: &mut Vec<Bar>) {
    let sliding = settings.sliding(&held(settings), field);
    let on = |threads| on_threads(threads, || solve(small, &sliding).map(|o| o.displacement_mm).ok());
    let one = on(1);
    let same = one.is_some() && [2, 8].into_iter().all(|threads| on(threads) == one);
    let text = if same { "the same" } else { "differ" };
    bars.push(Bar::new("contact brain5k on 1, 2 and 8 threads", "the same bytes", text, same));
}

/// An even pressure through a wall that knows nothing of the body's facets.
fn patch(bars: &mut Vec<Bar>) {
    for element in ["tet4", "tet4-nodal", "tet10"] {
        let found = even_pressure(element);
        let [along, across] = found.force_off_n;
        let text = format!(
            "pressure and displacement within {:.1e} of even, force within {along:.1e} N, {across:.1e} N across, depth within {:.1e} mm",
            found.deviation, found.depth_off_mm
        );
        let met = found.deviation < 1e-8 && along < 1e-9 && across < 1e-12 && found.depth_off_mm < 1e-6;
        bars.push(Bar::new(&format!("contact patch test, {element}"), "even to 1e-8", text, met));
    }
}

/// A sphere on a plane, at three refinements.
fn sphere(bars: &mut Vec<Bar>) {
    let mut last = f64::INFINITY;
    for cells in REFINEMENTS {
        let (found, force) = hertz::pressed(cells);
        let (off, radius_off) = (found.force_n / force - 1.0, (found.radius_mm - CONTACT_MM).abs());
        let text = format!(
            "force {:+.2} % of {force:.3e} N, radius {:.3} mm of {CONTACT_MM} mm (an element is {:.3} mm)",
            100.0 * off,
            found.radius_mm,
            found.edge_mm
        );
        let finest = cells == REFINEMENTS[REFINEMENTS.len() - 1];
        let asked =
            format!("nearer than before{}, radius within an element", if finest { " and within 2 %" } else { "" });
        let met = off.abs() < last && radius_off < found.edge_mm && (!finest || off.abs() < 0.02);
        bars.push(Bar::new(&format!("contact Hertz, {cells} elements over the radius"), &asked, text, met));
        last = off.abs();
    }
}

fn sliding(bars: &mut Vec<Bar>) {
    let slid = slid_down_a_slope();
    let text = format!(
        "{:.1e} of the way along it, {:.1e} mm off it, {:.1e} mm across",
        slid.along_off.abs(),
        slid.off_mm.abs(),
        slid.across_mm.abs()
    );
    let met = slid.along_off.abs() < 1e-8 && slid.off_mm.abs() < 0.1 && slid.across_mm.abs() < 1e-9;
    bars.push(Bar::new("contact block down a slope of 20 degrees", "as if it fell, to 1e-8", text, met));
    let apart = slid_apart_along_a_sheet();
    let text = format!(
        "normal way within {:.1e} mm of the pressure's, way along it within {:.1e} mm, {:.1e} N held back, {} and {} nodes",
        apart.across_off_mm, apart.along_off_mm, apart.carried_n, apart.sides[0], apart.sides[1]
    );
    let met = apart.across_off_mm < 1e-3 && apart.along_off_mm < 1e-6 && apart.carried_n < 1e-8;
    bars.push(Bar::new("contact two blocks along a falx", "no gap to 1e-3 mm, nothing held back", text, met));
}

fn bounce(bars: &mut Vec<Bar>) {
    let kept = [4e-5, 2e-5, 1e-5].map(energy_kept_in_a_bounce);
    let [coarse, fine, finest] = kept;
    let limit = 2.0 * finest - fine;
    let text = format!("{coarse:.5}, {fine:.5}, {finest:.5} by steps of 40, 20, 10 us; {limit:.5} at no step");
    let met = coarse < fine && fine < finest && finest > 0.99 && (limit - 1.0).abs() < 1e-3;
    bars.push(Bar::new("contact energy kept in a bounce", "1 to 1e-3 but for the step", text, met));
}

fn sensitivities(bars: &mut Vec<Bar>) {
    for ((room, touches), state) in ROOMS.into_iter().zip(["away from the wall", "just within its layer", "pressed"]) {
        let (off, touched) = sensitivities_off(room);
        let name = format!("contact sensitivities, {state}");
        let text = format!("within {off:.1e} of the largest (by stiffness, weight, gap, all loads; room {room} mm)");
        bars.push(Bar::new(&name, "slopes of solutions to 1e-5", text, off < 1e-5 && touched == touches));
    }
}

/// Every bar of contact.
pub fn bars() -> Vec<Bar> {
    let mut bars = Vec::new();
    patch(&mut bars);
    sphere(&mut bars);
    sliding(&mut bars);
    bounce(&mut bars);
    sensitivities(&mut bars);
    bars.extend(on_brains());
    bars
}

/// Every bar of contact on brain meshes.
fn on_brains() -> Vec<Bar> {
    let mut settings =
        ResectionSettings { supports: Supports::Sliding, density_kg_per_m3: 1000.0, ..Default::default() };
    settings.skull.gap_mm = 0.8;
    let Some(folder) = data().map(|folder| folder.join("meshes")) else {
        println!(
            "contact: the bars on brains need HGM_BENCH_DATA with brain5k.vtu, brain30k.vtu and template_labels.nii.gz; skipped"
        );
        return Vec::new();
    };
    let meshes = ["brain5k.vtu", "brain30k.vtu"].map(|name| mesh(&folder, name, &settings.skull));
    let ([Some(small), Some(large)], Some(field)) = (meshes, skull(&folder, &settings.skull)) else {
        println!("contact: a mesh or template_labels.nii.gz is missing or damaged in HGM_BENCH_DATA; skipped");
        return Vec::new();
    };
    let mut bars = Vec::new();
    cost("brain5k", &small, &settings, &field, &mut bars);
    cost("brain30k", &large, &settings, &field, &mut bars);
    bytes(&small, &settings, &field, &mut bars);
    if std::env::var_os("HGM_BENCH_SHORT").is_none() {
        robustness(&small, &settings, &field, &mut bars);
    }
    bars
}

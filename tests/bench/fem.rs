//! The solver's bars: agreement, speed, locking, robustness, dynamics, growth. Meshes brain5k.vtu, brain30k.vtu and the
//! reference brain5k_gravity_two_tissue_nu045.csv come from `HGM_BENCH_DATA`; bars without them are skipped by name.

use super::bar::{Bar, data};
use hgm::fem::{FemError, Model, Outcome, Scenario, simulate};
use hgm::material::law::Material;
use hgm::material::random::CounterRng;
use hgm::mesh::TetMesh;
use hgm::mesh::format::vtu;
use std::path::Path;
use std::time::Instant;

/// CPU seconds of this process (Linux; wall-clock elsewhere).
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    // User and system time are the 14th and 15th field, the 12th and 13th after the name.
    let mut fields = after.split_whitespace().skip(11).map_while(|t| t.parse::<f64>().ok());
    let ticks = fields.next().zip(fields.next()).map(|(user, system)| user + system);
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    // The kernel counts in hundredths of a second.
    ticks.map_or_else(|| START.get_or_init(Instant::now).elapsed().as_secs_f64(), |t| t / 100.0)
}

/// CPU seconds per call, repeated until a second is full so that the clock's grain does not count.
fn timed<T>(f: impl Fn() -> T) -> (f64, T) {
    let (begin, mut calls) = (cpu_s(), 0);
    loop {
        let value = f();
        calls += 1;
        let spent = cpu_s() - begin;
        if spent > 1.0 || calls >= 50 {
            return (spent / f64::from(calls), value);
        }
    }
}

fn single<T: Send>(f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread can be had").install(f)
}

fn mesh(folder: &Path, name: &str) -> Option<TetMesh> {
    let bytes = std::fs::read(folder.join(name)).ok()?;
    vtu::decode(&bytes, name).ok().map(|m| m.mesh)
}

/// Grey 1370 Pa, white 990 Pa, labels as in the brain meshes.
fn two_tissues(poisson_ratio: f64, loads: &str, solver: &str) -> Scenario {
    let law = |pa| format!("law = 'neo-hookean'\nshear_modulus_pa = {pa}\npoisson_ratio = {poisson_ratio}\n");
    let text = format!(
        "fixed = ['fixed']\n[labels]\ngrey_matter = 1\nwhite_matter = 2\n[materials.grey_matter]\n{}\
         [materials.white_matter]\n{}[loads]\n{loads}\n[solver]\n{solver}\n",
        law(1370.0),
        law(990.0)
    );
    Scenario::from_toml(&text).expect("the text above is a scenario")
}

const GRAVITY: &str = "gravity_m_per_s2 = [0.0, 0.0, -9.81]";
const PUSH: &str = "patch = [{ set = 'superior', force_n = [0.0, 0.0, -10.0] }]";

fn solve(mesh: &TetMesh, scenario: &Scenario) -> Result<Outcome, FemError> {
    simulate(mesh, scenario, &|_| ())
}

fn rms_mm(outcome: &Outcome) -> f64 {
    let n = outcome.displacement_mm.len() as f64;
    (outcome.displacement_mm.iter().flatten().map(|v| v * v).sum::<f64>() / n).sqrt()
}

/// Every tetrahedron cut in eight at its edges' middles.
fn refined(mesh: &TetMesh) -> TetMesh {
    let edge = |tet: &[u32; 4], a: usize, b: usize| (tet[a].min(tet[b]), tet[a].max(tet[b]));
    let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let mut edges: Vec<(u32, u32)> = mesh.tets().iter().flat_map(|tet| pairs.map(|(a, b)| edge(tet, a, b))).collect();
    edges.sort_unstable();
    edges.dedup();
    let mut nodes = mesh.nodes_mm().to_vec();
    let first = nodes.len();
    nodes.extend(edges.iter().map(|&(a, b)| {
        let [a, b] = [a, b].map(|n| mesh.nodes_mm()[n as usize]);
        [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]))
    }));
    let (mut tets, mut labels) = (Vec::new(), Vec::new());
    for (tet, &label) in mesh.tets().iter().zip(mesh.labels()) {
        let middle = |a, b| (first + edges.binary_search(&edge(tet, a, b)).unwrap_or(0)) as u32;
        let [m01, m02, m03, m12, m13, m23] = pairs.map(|(a, b)| middle(a, b));
        let [a, b, c, d] = *tet;
        tets.extend([
            [a, m01, m02, m03],
            [m01, b, m12, m13],
            [m02, m12, c, m23],
            [m03, m13, m23, d],
            [m01, m02, m03, m13],
            [m01, m12, m02, m13],
            [m02, m23, m03, m13],
            [m02, m12, m23, m13],
        ]);
        labels.extend([label; 8]);
    }
    let mut fine = TetMesh::new(nodes, tets, labels).expect("halves of a valid mesh are valid");
    for (name, set) in &mesh.node_sets {
        let inside = |n: u32| set.binary_search(&n).is_ok();
        let middles = edges.iter().enumerate().filter(|(_, e)| inside(e.0) && inside(e.1));
        let all = set.iter().copied().chain(middles.map(|(k, _)| (first + k) as u32)).collect();
        fine.set_nodes(name, all).expect("the nodes are there");
    }
    fine
}

/// Peak memory of this process, MB (Linux).
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or_default().to_owned();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}

fn agreement(folder: &Path, small: &TetMesh) -> Option<Bar> {
    let text = std::fs::read_to_string(folder.join("brain5k_gravity_two_tissue_nu045.csv")).ok()?;
    let rows: Vec<Vec<f64>> =
        text.lines().map(|l| l.split(',').filter_map(|v| v.trim().parse().ok()).collect()).collect();
    let reference: Vec<&[f64]> = rows.iter().filter(|r| r.len() >= 3).map(|r| &r[r.len() - 3..]).collect();
    let outcome = solve(small, &two_tissues(0.45, GRAVITY, "relative_residual = 1e-10")).ok()?;
    let pairs = outcome.displacement_mm.iter().zip(&reference);
    let worst = pairs.flat_map(|(u, r)| (0..3).map(move |i| (u[i] - r[i]).abs())).fold(0.0, f64::max);
    let whole = reference.len() == outcome.displacement_mm.len();
    Some(Bar::new("fem brain5k against four codes", "<= 1e-6 mm", format!("{worst:.1e} mm"), whole && worst <= 1e-6))
}

fn statics(small: &TetMesh, large: &TetMesh, bars: &mut Vec<Bar>) -> Vec<(f64, f64)> {
    let mut growth = Vec::new();
    for (name, mesh, most) in [("brain5k", small, 0.25), ("brain30k", large, 4.0)] {
        let scenario = two_tissues(0.45, GRAVITY, "");
        let (seconds, outcome) = timed(|| single(|| solve(mesh, &scenario)));
        let met = seconds <= most && outcome.is_ok();
        bars.push(Bar::new(
            &format!("fem {name} gravity"),
            &format!("<= {most} CPU-s"),
            format!("{seconds:.3} CPU-s"),
            met,
        ));
        growth.push((mesh.nodes_mm().len() as f64, seconds));
    }
    // What a finer residual costs more, per iteration: a Newton iteration or two are in it.
    let run = |residual: &str| {
        let solver = format!("linear = 'pcg-block-jacobi'\nrelative_residual = {residual}");
        let scenario = two_tissues(0.45, GRAVITY, &solver);
        let (seconds, outcome) = timed(|| single(|| solve(large, &scenario)));
        (seconds, outcome.map_or(0, |o| o.convergence.linear_iterations()) as f64)
    };
    let ((fine, more), (rough, fewer)) = (run("1e-10"), run("1e-3"));
    let per = 1e3 * (fine - rough) / (more - fewer);
    bars.push(Bar::new("fem brain30k CG iteration", "<= 2 ms", format!("{per:.2} ms"), per <= 2.0));
    // At the solution, the memory of the matrix included; the model deals its rows out to the one thread there is.
    let scenario = two_tissues(0.45, GRAVITY, "");
    let assembly = single(|| {
        let model = Model::new(large, &scenario).ok()?;
        let (_, state) = model.solve(&scenario.materials, None, &|_| ()).ok()?;
        Some(timed(|| model.stiffness(&scenario.materials, &state).is_ok()).0)
    });
    if let Some(seconds) = assembly {
        let per = 1e6 * seconds / large.tets().len() as f64;
        let text = format!("{per:.2} us");
        bars.push(Bar::new("fem assembly of force and tangent", "<= 0.4 us per tet", text, per <= 0.4));
    }
    let memory = peak_mb();
    bars.push(Bar::new(
        "fem brain30k memory with PCG",
        "<= 1000 MB",
        format!("{memory:.0} MB at most so far"),
        memory <= 1e3,
    ));
    growth
}

fn locking(small: &TetMesh, bars: &mut Vec<Bar>) {
    let run = |element: &str| {
        let scenario = two_tissues(0.49, GRAVITY, &format!("element = '{element}'"));
        timed(|| single(|| solve(small, &scenario).map_or(f64::NAN, |o| rms_mm(&o))))
    };
    let ((plain_s, plain), (nodal_s, nodal)) = (run("tet4"), run("tet4-nodal"));
    let off = 100.0 * (nodal / 4.22 - 1.0);
    let text = format!("{nodal:.3} mm, {off:+.1} % (tet4 {plain:.3})");
    bars.push(Bar::new("fem brain5k nu .49 averaged element", "within 8 % of 4.22 mm", text, off.abs() <= 8.0));
    let cost = nodal_s / plain_s;
    let text = format!("{cost:.2}x ({nodal_s:.3} and {plain_s:.3} CPU-s)");
    bars.push(Bar::new("fem cost of the averaged element", "<= 3x tet4", text, cost <= 3.0));
}

fn robustness(small: &TetMesh, large: &TetMesh, bars: &mut Vec<Bar>) {
    for (name, mesh) in [("brain5k", small), ("brain30k", large)] {
        let begin = cpu_s();
        let found = single(|| solve(mesh, &two_tissues(0.45, PUSH, "")));
        let text = found.as_ref().map_or_else(ToString::to_string, |o| {
            format!("{} load steps, {:.2} CPU-s", o.convergence.load_steps.len(), cpu_s() - begin)
        });
        bars.push(Bar::new(&format!("fem {name} 10 N in one call"), "converges", text, found.is_ok()));
    }
    let begin = cpu_s();
    let found = single(|| solve(large, &two_tissues(0.49, GRAVITY, "")));
    let text = found.as_ref().map_or_else(ToString::to_string, |_| format!("{:.2} CPU-s", cpu_s() - begin));
    bars.push(Bar::new("fem brain30k nu .49 gravity", "converges", text, found.is_ok()));
    let (mut converged, mut verdicts, mut broken) = (0, 0, 0);
    let begin = cpu_s();
    for n in 0..200 {
        match single(|| solve(small, &random_scenario(n))) {
            Ok(outcome) => {
                let all = outcome.displacement_mm.iter().flatten().chain(&outcome.jacobian);
                let finite = all.chain(&outcome.strain_energy_density_pa).all(|v| v.is_finite());
                converged += usize::from(finite);
                broken += usize::from(!finite);
            }
            Err(FemError::NoEquilibrium { .. }) => verdicts += 1,
            Err(_) => broken += 1,
        }
    }
    let text = format!("{converged} converge, {verdicts} verdicts, {broken} broken, {:.0} CPU-s", cpu_s() - begin);
    bars.push(Bar::new("fem 200 random scenarios", "all end well or with a verdict", text, broken == 0));
}

/// Moduli 50 Pa to 50 kPa, nu .30 to .499, gravity of any strength and direction, every other one also pushed.
fn random_scenario(n: u64) -> Scenario {
    let rng = CounterRng::new(4, n);
    let between = |counter, low, high| rng.between(counter, low, high);
    let push = format!("patch = [{{ set = 'superior', force_n = [0.0, 0.0, {}] }}]", -between(0, 0.0, 10.0));
    let mut scenario = two_tissues(0.45, if n.is_multiple_of(2) { &push } else { "" }, "");
    let down = rng.direction(100);
    let strength = between(1, 0.0, 9.81);
    scenario.loads.gravity_m_per_s2 = down.map(|d| strength * d);
    for (k, name) in (10..).step_by(10).zip(["grey_matter", "white_matter"]) {
        let (mu, nu) = (between(k, 50f64.ln(), 5e4f64.ln()).exp(), between(k + 1, 0.30, 0.499));
        scenario.materials.insert(name.to_owned(), Material::neo_hookean(mu, nu));
    }
    scenario
}

fn dynamics(small: &TetMesh, bars: &mut Vec<Bar>) {
    let solver = "method = 'backward-euler'\n[dynamics]\ntime_step_s = 0.05\nsteps = 60\nrest_speed_mm_per_s = 0.0";
    let scenario = two_tissues(0.45, GRAVITY, solver);
    let (seconds, _) = timed(|| single(|| solve(small, &scenario).map(|_| ())));
    let rate = 60.0 / seconds;
    bars.push(Bar::new("fem brain5k motion, one thread", ">= 30 steps/s", format!("{rate:.0} steps/s"), rate >= 30.0));
    let begin = Instant::now();
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads can be had");
    let done = two.install(|| solve(small, &scenario).is_ok());
    let gain = 60.0 / begin.elapsed().as_secs_f64() / rate;
    bars.push(Bar::new(
        "fem brain5k motion, two threads",
        ">= 1.6x one (wall-clock)",
        format!("{gain:.2}x"),
        done && gain >= 1.6,
    ));
    let long = "method = 'backward-euler'\n[dynamics]\ntime_step_s = 0.05\nsteps = 2000";
    let (rest, moved) =
        (solve(small, &two_tissues(0.45, GRAVITY, "")), solve(small, &two_tissues(0.45, GRAVITY, long)));
    if let (Ok(rest), Ok(moved)) = (rest, moved) {
        let both = rest.displacement_mm.iter().flatten().zip(moved.displacement_mm.iter().flatten());
        let off = both.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let rested = moved.motion.is_some_and(|m| m.rested);
        let text = format!("{off:.1e} mm, {}", if rested { "at rest" } else { "still moving" });
        bars.push(Bar::new("fem brain5k rests at the static solution", "<= 1e-3 mm", text, rested && off <= 1e-3));
    }
}

fn sweep(small: &TetMesh, bars: &mut Vec<Bar>) {
    let scenario = two_tissues(0.45, GRAVITY, "");
    let Ok(model) = Model::new(small, &scenario) else { return };
    let begin = cpu_s();
    let (mut state, mut solved) = (None, 0);
    single(|| {
        for row in 0..9 {
            // There and back, so that neighbours in the list are neighbours in ln mu.
            for step in 0..9 {
                let column = if row % 2 == 0 { step } else { 8 - step };
                let mut materials = scenario.materials.clone();
                for (name, level, pa) in [("grey_matter", row, 1370.0), ("white_matter", column, 990.0)] {
                    let mu = pa * (0.25 * (f64::from(level) - 4.0)).exp();
                    materials.insert(name.to_owned(), Material::neo_hookean(mu, 0.45));
                }
                if let Ok((_, next)) = model.solve(&materials, state.as_ref(), &|_| ()) {
                    state = Some(next);
                    solved += 1;
                }
            }
        }
    });
    let seconds = cpu_s() - begin;
    let text = format!("{seconds:.1} CPU-s, {solved} solved");
    bars.push(Bar::new("fem sweep of 81 on brain5k", "<= 30 CPU-s", text, seconds <= 30.0 && solved == 81));
}

/// Every bar of the solver.
pub fn bars() -> Vec<Bar> {
    let Some(folder) = data() else {
        println!("fem: all bars need HGM_BENCH_DATA with brain5k.vtu and brain30k.vtu; skipped");
        return Vec::new();
    };
    let folder = folder.join("meshes");
    let (Some(small), Some(large)) = (mesh(&folder, "brain5k.vtu"), mesh(&folder, "brain30k.vtu")) else {
        println!("fem: brain5k.vtu or brain30k.vtu is missing or damaged in HGM_BENCH_DATA; skipped");
        return Vec::new();
    };
    let mut bars: Vec<Bar> = agreement(&folder, &small).into_iter().collect();
    let mut growth = statics(&small, &large, &mut bars);
    locking(&small, &mut bars);
    sweep(&small, &mut bars);
    dynamics(&small, &mut bars);
    let fine = refined(&large);
    let begin = cpu_s();
    let found = single(|| solve(&fine, &two_tissues(0.45, GRAVITY, "")));
    growth.push((fine.nodes_mm().len() as f64, cpu_s() - begin));
    let exponent = (growth[2].1 / growth[0].1).ln() / (growth[2].0 / growth[0].0).ln();
    let text = growth.iter().map(|(n, s)| format!("{n:.0}: {s:.2} s")).collect::<Vec<_>>().join(", ");
    let met = exponent <= 1.4 && found.is_ok();
    bars.push(Bar::new("fem growth of cost with nodes", "exponent <= 1.4", format!("{exponent:.2} ({text})"), met));
    robustness(&small, &large, &mut bars);
    bars
}

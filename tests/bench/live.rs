//! Bars of a live session: steps a second with frames made, a hand that tears at it all the while, and memory. Meshes
//! brain5k.vtu and brain30k.vtu come from `HGM_BENCH_DATA`; bars without them are skipped by name.

use crate::bar::{Bar, data};
use hgm::fem::Scenario;
use hgm::live::{Colour, Colours, Command, LiveBody, Pace, Session, frame_bytes};
use hgm::material::random::CounterRng;
use hgm::mesh::TetMesh;
use hgm::mesh::format::vtu;
use hgm::workflow::Sights;
use std::time::Instant;

/// Steps that are timed.
const STEPS: u64 = 300;
/// The paper's rates, for comparison: Unity on a GPU.
const PAPER: [&str; 2] = ["6 to 8 Hz", "1.5 to 3 Hz"];

fn scenario(tissues: usize) -> Scenario {
    let pa = |tissue: usize| if tissues == 1 { 1180.0 } else { [1370.0, 990.0][tissue] };
    let law = |t| format!("law = 'neo-hookean'\nshear_modulus_pa = {}\npoisson_ratio = 0.45\n", pa(t));
    let text = format!(
        "fixed = ['fixed']\n[labels]\ngrey_matter = 1\nwhite_matter = 2\n[materials.grey_matter]\n{}\
         [materials.white_matter]\n{}[loads]\ngravity_m_per_s2 = [0.0, 0.0, -9.81]\n",
        law(0),
        law(1)
    );
    Scenario::from_toml(&text).expect("the text above is a scenario")
}

fn body(mesh: &TetMesh, tissues: usize) -> LiveBody {
    LiveBody {
        name: "brain".to_owned(),
        mesh: mesh.clone(),
        scenario: scenario(tissues),
        tissues: Vec::new(),
        sights: Sights::default(),
        notes: Vec::new(),
        mesh_sha256: String::new(),
    }
}

/// The node of the set `superior` that lies highest.
fn top(mesh: &TetMesh) -> (u32, [f64; 3]) {
    let height = |n: &u32| mesh.nodes_mm()[*n as usize][2];
    let set = &mesh.node_sets["superior"];
    let node = set.iter().copied().max_by(|a, b| height(a).total_cmp(&height(b))).unwrap_or(0);
    (node, mesh.nodes_mm()[node as usize])
}

/// Steps a second on all threads while a hand draws circles of 15 mm, a frame made of every other step.
fn rate(mesh: &TetMesh, tissues: usize) -> f64 {
    let mut session = Session::open(&body(mesh, tissues)).expect("the mesh carries the scenario");
    let (node, at) = top(mesh);
    let colours = Colours::of(&body(mesh, tissues), session.mesh());
    for _ in 0..20 {
        session.step();
    }
    let (begin, mut shown) = (Instant::now(), 0);
    for step in 0..STEPS {
        let turn = step as f64 / 20.0;
        let to_mm = [at[0] + 15.0 * turn.cos(), at[1] + 15.0 * turn.sin(), at[2] + 5.0];
        session.apply(&Command::Drag { node, to_mm }).expect("the node is on the surface");
        rayon::scope(|_| session.step());
        if step % 2 == 0 {
            let numbers = colours.numbers(&session, Colour::Displacement);
            shown += frame_bytes(&session, &session.stepper().readout(), &Pace::default(), &numbers).len();
        }
    }
    assert!(shown > 0 && session.recovered() == 0);
    STEPS as f64 / begin.elapsed().as_secs_f64()
}

/// Resident memory of this process, MB (Linux).
fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmRSS")).unwrap_or_default().to_owned();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}

/// Seeded hands, sliders and toggles for so many seconds: memory grown (MB), steps, lost ways, how far the rest after reset
/// is from the rest before (mm).
fn torn(mesh: &TetMesh, seconds: f64) -> (f64, u64, u64, f64) {
    let mut session = Session::open(&body(mesh, 2)).expect("the mesh carries the scenario");
    let settle = |session: &mut Session| {
        for _ in 0..2000 {
            session.step();
            if session.is_at_rest() {
                break;
            }
        }
        session.displacement_mm()
    };
    let rest = settle(&mut session);
    let (node, at) = top(mesh);
    let dice = CounterRng::new(22, 0);
    let mut n = 0;
    let mut around = |middle: f64, reach: f64| {
        n += 1;
        middle + reach * (2.0 * dice.uniform(n) - 1.0)
    };
    let (begin, mut start_mb) = (Instant::now(), f64::NAN);
    let from = session.steps();
    while begin.elapsed().as_secs_f64() < seconds {
        let place = [around(at[0], 50.0), around(at[1], 50.0), around(at[2], 50.0)];
        let command = match session.steps() % 12 {
            0..4 => Command::Drag { node, to_mm: place },
            4 => Command::Release {},
            5 => Command::Ball { centre_mm: place, radius_mm: 20.0 },
            6 => Command::Lift {},
            7 => Command::Modulus { tissue: "grey_matter".to_owned(), pa: around(7.0, 1.5).exp() },
            8 => Command::Gravity { m_per_s2: [around(0.0, 9.0), around(0.0, 9.0), around(0.0, 9.0)] },
            9 => Command::PoissonRatio { tissue: "white_matter".to_owned(), ratio: around(0.4, 0.08) },
            10 => Command::Support { set: "superior".to_owned(), held: around(0.0, 1.0) > 0.5 },
            _ => Command::Undo {},
        };
        session.apply(&command).ok();
        session.step();
        if start_mb.is_nan() && begin.elapsed().as_secs_f64() > 0.1 * seconds {
            start_mb = resident_mb();
        }
    }
    let (grown, steps) = (resident_mb() - start_mb, session.steps() - from);
    session.apply(&Command::Reset {}).expect("the first scenario is one");
    let again = settle(&mut session);
    let apart = rest.iter().flatten().zip(again.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    (grown, steps, session.recovered(), apart)
}

pub fn bars() -> Vec<Bar> {
    let Some(folder) = data().map(|folder| folder.join("meshes")) else {
        println!("live: all bars need HGM_BENCH_DATA with brain5k.vtu and brain30k.vtu; skipped");
        return Vec::new();
    };
    let read = |name: &str| {
        let bytes = std::fs::read(folder.join(name)).ok()?;
        vtu::decode(&bytes, name).ok().map(|m| m.mesh)
    };
    let mut bars = Vec::new();
    for (name, wanted, kinds) in [("brain5k", 60.0, [1, 2].as_slice()), ("brain30k", 10.0, &[2])] {
        let Some(mesh) = read(&format!("{name}.vtu")) else { continue };
        for &tissues in kinds {
            let hz = rate(&mesh, tissues);
            let bar = format!(">= {wanted} steps/s with frames (paper: {})", PAPER[tissues - 1]);
            bars.push(Bar::new(
                &format!("live, {name}, tissues: {tissues}"),
                &bar,
                format!("{hz:.1} steps/s"),
                hz >= wanted,
            ));
        }
    }
    if let Some(mesh) = read("brain5k.vtu") {
        let seconds = std::env::var("HGM_LIVE_SECONDS").ok().and_then(|s| s.parse().ok()).unwrap_or(600.0);
        let (grown, steps, lost, apart) = torn(&mesh, seconds);
        let said = format!("{seconds} s, {steps} steps, {grown:.1} MB, {lost} lost, rest {apart:.1e} mm apart");
        let met = grown <= 20.0 && lost == 0 && apart <= 1e-6;
        bars.push(Bar::new("live, brain5k, torn at", "ten minutes, 20 MB, none lost, rest to 1e-6 mm", said, met));
    }
    bars
}

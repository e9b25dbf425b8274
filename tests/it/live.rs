//! `hgm live`: rest, hands, replay, and what may reach the server.

use crate::job::{contents, program};
use crate::made::{finished_phantom, prepared_pair};
use hgm::fem::{Scenario, simulate};
use hgm::live::{
    Colour, Colours, Command, Export, LiveBody, LiveTissue, Recording, Server, Session, Spread, Timed, serve,
};
use hgm::material::law::Parameter;
use hgm::material::random::CounterRng;
use hgm::mesh::format::vtu;
use hgm::mesh::{TetMesh, TriMesh};
use hgm::workflow::{Case, Place, Resection, Scan, Settings, Sights, Silent, posed_case};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command as Process, Stdio};
use std::time::{Duration, Instant};
use tungstenite::protocol::Role;
use tungstenite::{Message, WebSocket};

const SCENARIO: &str = "
fixed = ['base']
[materials.grey_matter]
law = 'neo-hookean'
shear_modulus_pa = 1370.0
poisson_ratio = 0.45
[materials.white_matter]
law = 'neo-hookean'
shear_modulus_pa = 990.0
poisson_ratio = 0.45
[loads]
gravity_m_per_s2 = [0.0, 0.0, -9.81]
";

/// A block of 4 x 4 x 5 cells of 10 mm, the upper part white, with the sets `base` and `side`.
fn block() -> TetMesh {
    let node = |i: usize, j: usize, k: usize| (i + 5 * (j + 5 * k)) as u32;
    let nodes: Vec<[f64; 3]> = (0..150).map(|n| [n % 5, n / 5 % 5, n / 25].map(|x| 10.0 * f64::from(x))).collect();
    let (mut tets, mut labels) = (Vec::new(), Vec::new());
    for cell in 0..80 {
        let (i, j, k) = (cell % 4, cell / 4 % 4, cell / 16);
        let corner = |b: usize| node(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2));
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            tets.push([corner(0), corner(a), corner(b), corner(7)]);
            labels.push(if k < 3 { 2 } else { 3 });
        }
    }
    let mut mesh = TetMesh::new(nodes.clone(), tets, labels).unwrap();
    let among = |keep: &dyn Fn(&[f64; 3]) -> bool| -> Vec<u32> {
        (0..nodes.len() as u32).filter(|&n| keep(&nodes[n as usize])).collect()
    };
    mesh.set_nodes("base", among(&|x| x[2] == 0.0)).unwrap();
    mesh.set_nodes("side", among(&|x| x[0] == 0.0)).unwrap();
    mesh
}

fn body() -> LiveBody {
    LiveBody {
        name: "block".to_owned(),
        mesh: block(),
        scenario: Scenario::from_toml(SCENARIO).unwrap(),
        tissues: Vec::new(),
        sights: Sights::default(),
        notes: Vec::new(),
        mesh_sha256: "of the block".to_owned(),
    }
}

/// A node of the upper face, and one of its edge.
const TOP: u32 = 5 * 5 * 5 + 12;

fn settle(session: &mut Session) {
    for _ in 0..3000 {
        session.step();
        if session.is_at_rest() {
            return;
        }
    }
    panic!("no rest: {:?}", session.report());
}

fn apart_mm(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let apart = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    a.iter().zip(b).map(apart).fold(0.0, f64::max)
}

fn equilibrium(scenario: &Scenario, mesh: &TetMesh) -> Vec<[f64; 3]> {
    simulate(mesh, scenario, &|_| ()).unwrap().displacement_mm
}

#[test]
fn a_body_at_rest_lies_where_simulate_puts_it_with_time_and_without() {
    let body = body();
    let truth = equilibrium(&body.scenario, &body.mesh);
    assert!(truth.iter().any(|u| u[2] < -0.5));
    for quasi_static in [false, true] {
        let mut session = Session::open(&body).unwrap();
        session.apply(&Command::Manner { quasi_static }).unwrap();
        settle(&mut session);
        let apart = apart_mm(&session.displacement_mm(), &truth);
        assert!(apart < 1e-3, "{quasi_static}: {apart} mm");
    }
}

#[test]
fn every_change_leads_to_the_equilibrium_of_its_scenario_and_undo_back() {
    let mut session = Session::open(&body()).unwrap();
    session.apply(&Command::Manner { quasi_static: true }).unwrap();
    settle(&mut session);
    let before = session.displacement_mm();
    let tissue = "white_matter".to_owned();
    let changes = [
        Command::Modulus { tissue: tissue.clone(), pa: 400.0 },
        Command::PoissonRatio { tissue: tissue.clone(), ratio: 0.3 },
        Command::Law { tissue: tissue.clone(), law: "stable-neo-hookean".to_owned() },
        Command::Gravity { m_per_s2: [0.0, -9.81, 0.0] },
        Command::Density { kg_per_m3: 500.0 },
        Command::Csf { level_mm: Some(20.0) },
        Command::Pressure { set: "side".to_owned(), pa: 100.0 },
        Command::Support { set: "side".to_owned(), held: true },
    ];
    for change in &changes {
        session.apply(change).unwrap();
        settle(&mut session);
        let apart = apart_mm(&session.displacement_mm(), &equilibrium(session.scenario(), session.mesh()));
        assert!(apart < 1e-3, "{change:?}: {apart} mm");
    }
    for _ in &changes {
        session.apply(&Command::Undo {}).unwrap();
    }
    assert!(session.apply(&Command::Undo {}).is_err());
    settle(&mut session);
    assert!(apart_mm(&session.displacement_mm(), &before) < 1e-3);
}

#[test]
fn a_hand_pulls_a_ball_pushes_and_the_exported_scenario_gives_that_state() {
    let mut session = Session::open(&body()).unwrap();
    session.apply(&Command::Manner { quasi_static: true }).unwrap();
    settle(&mut session);
    let before = session.stepper().displacement_of_mm(TOP);
    session.apply(&Command::Drag { node: TOP, to_mm: [20.0, 20.0, 56.0] }).unwrap();
    session.apply(&Command::Ball { centre_mm: [48.0, 20.0, 20.0], radius_mm: 12.0 }).unwrap();
    settle(&mut session);
    let after = session.stepper().displacement_of_mm(TOP);
    let [grip, ball] = session.stepper().force_n();
    assert!(after[2] > before[2] + 1.0 && grip[2] > 0.01 && ball[0] < -0.005, "{before:?} {after:?} {grip:?} {ball:?}");

    let state = Export::of(&session).unwrap();
    let scenario = Scenario::from_toml(&state.scenario_toml().unwrap()).unwrap();
    let written = vtu::decode(&state.vtu().unwrap(), "state.vtu").unwrap();
    let apart = apart_mm(&session.displacement_mm(), &equilibrium(&scenario, &written.mesh));
    assert!(apart < 1e-3, "{apart} mm");

    session.apply(&Command::Release {}).unwrap();
    session.apply(&Command::Lift {}).unwrap();
    settle(&mut session);
    assert!(apart_mm(&[session.stepper().displacement_of_mm(TOP)], &[before]) < 1e-3);
}

/// The block with an upper corner of it labelled `resected`.
fn resectable() -> LiveBody {
    let whole = block();
    let nodes = whole.nodes_mm();
    let corner = |tet: &[u32; 4]| tet.iter().all(|&n| nodes[n as usize][0] >= 20.0 && nodes[n as usize][2] >= 40.0);
    let labels = whole.tets().iter().zip(whole.labels()).map(|(tet, &l)| if corner(tet) { 5 } else { l }).collect();
    let mut mesh = TetMesh::new(nodes.to_vec(), whole.tets().to_vec(), labels).unwrap();
    for (name, set) in &whole.node_sets {
        mesh.set_nodes(name, set.clone()).unwrap();
    }
    let more = "[materials.resected]\nlaw = 'neo-hookean'\nshear_modulus_pa = 3000.0\npoisson_ratio = 0.45\n[loads]";
    let scenario = Scenario::from_toml(&SCENARIO.replace("[loads]", more)).unwrap();
    LiveBody { mesh, scenario, ..body() }
}

#[test]
fn resected_tissue_is_taken_out_and_put_back_to_the_equilibrium_of_what_is_left() {
    let body = resectable();
    let mut recording = Recording::new(&body);
    let mut session = Session::open(&body).unwrap();
    let mut go = |session: &mut Session, command: Command| -> Result<(), String> {
        session.apply(&command)?;
        recording.commands.push(Timed { step: session.steps(), command });
        settle(session);
        recording.steps = session.steps();
        Ok(())
    };
    assert_eq!(session.resection(), Some(false));
    settle(&mut session);
    let before = session.displacement_mm();
    assert!(apart_mm(&before, &equilibrium(&body.scenario, &body.mesh)) < 1e-3);
    // A node that only the corner has.
    let out = 5 * 5 * 5 + 4;
    assert!(before[out][2] < -0.1);

    go(&mut session, Command::Resection { removed: true }).unwrap();
    assert_eq!((session.resection(), session.displacement_mm()[out]), (Some(true), [0.0; 3]));
    let left = session.stepper().mesh();
    assert!(
        !left.labels().contains(&5)
            && left.tets().len() + body.mesh.labels().iter().filter(|&&l| l == 5).count() == 480
    );
    let truth = equilibrium(session.scenario(), left);
    assert!(apart_mm(&session.stepper().displacement_mm(), &truth) < 1e-3);
    let of_left = body.mesh.restricted(|l| l != 5).unwrap().1;
    let shown: Vec<[f64; 3]> = of_left.iter().map(|&n| session.displacement_mm()[n as usize]).collect();
    assert!(apart_mm(&shown, &truth) < 1e-3, "in the numbers of the whole mesh, too");
    assert!(apart_mm(&shown, &of_left.iter().map(|&n| before[n as usize]).collect::<Vec<_>>()) > 0.02);
    // The exported state is of what is left.
    let state = Export::of(&session).unwrap();
    let (toml, written) = (state.scenario_toml().unwrap(), vtu::decode(&state.vtu().unwrap(), "state.vtu").unwrap());
    assert!(toml.contains("resected tissue is out"), "{toml}");
    assert!(apart_mm(&equilibrium(&Scenario::from_toml(&toml).unwrap(), &written.mesh), &truth) < 1e-3);
    // A hand cannot take what is not there, but what came to light.
    assert!(session.apply(&Command::Drag { node: out as u32, to_mm: [40.0, 0.0, 60.0] }).is_err());
    let floor = 4 * 25 + 13;
    assert!(Session::open(&body).unwrap().apply(&Command::Drag { node: floor, to_mm: [30.0, 20.0, 60.0] }).is_err());
    go(&mut session, Command::Drag { node: floor, to_mm: [30.0, 20.0, 60.0] }).unwrap();
    go(&mut session, Command::Release {}).unwrap();

    go(&mut session, Command::Undo {}).unwrap();
    assert_eq!(session.resection(), Some(false));
    assert!(apart_mm(&session.displacement_mm(), &before) < 1e-3);
    assert!(session.apply(&Command::Undo {}).is_err());
    go(&mut session, Command::Resection { removed: true }).unwrap();
    go(&mut session, Command::Resection { removed: false }).unwrap();
    assert!(apart_mm(&session.displacement_mm(), &before) < 1e-3);
    go(&mut session, Command::Resection { removed: true }).unwrap();
    let read = Recording::from_text(&recording.to_text()).unwrap();
    assert_eq!(read.replay(&body, &mut |_| ()).unwrap().displacement_mm(), session.displacement_mm());
    session.apply(&Command::Reset {}).unwrap();
    settle(&mut session);
    assert_eq!((session.resection(), session.displacement_mm()), (Some(false), before));
}

#[test]
fn a_mesh_without_resected_tissue_has_none_to_take_out() {
    let mut session = Session::open(&body()).unwrap();
    let said = session.apply(&Command::Resection { removed: true }).unwrap_err();
    assert!(said.contains("resected") && session.resection().is_none(), "{said}");
    assert!(session.apply(&Command::Undo {}).is_err(), "nothing has happened");
}

#[test]
fn a_patient_is_opened_with_the_resected_tissue_in_and_loses_it_to_the_cases_own_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    prepared_pair(&case);
    let before = contents(&case);
    let own = Case::open(&case).unwrap();
    let settings = Settings::resolve([&own.settings().unwrap()]).unwrap();
    let rest = own.mesh().unwrap();
    let posed = posed_case(&Place::from(case.as_path()), &settings, Resection::Undone, &mut Silent).unwrap();
    let left = posed.mesh.restricted(|l| l != 5).and_then(|(mesh, _)| mesh.largest_face_connected_part()).unwrap().0;
    assert_eq!((left.nodes_mm(), left.tets()), (rest.nodes_mm(), rest.tets()));
    let mut session = Session::open(&LiveBody::of(posed, &settings.prior)).unwrap();
    assert_eq!(session.resection(), Some(false));
    session.apply(&Command::Resection { removed: true }).unwrap();
    assert_eq!(session.resection(), Some(true));
    for _ in 0..5 {
        session.step();
    }
    assert!(session.displacement_mm().as_flattened().iter().all(|x| x.is_finite()));
    assert!(contents(&case) == before, "the case is left as it is");

    let phantom = finished_phantom()[0].clone();
    let refused = posed_case(&Place::from(phantom), &settings, Resection::Undone, &mut Silent).unwrap_err();
    assert!(refused.to_string().contains("no tissue was resected"), "{refused}");
}

/// A square at this x, mm.
fn wall(x: f64) -> TriMesh {
    let nodes_mm = vec![[x, -50.0, -50.0], [x, 150.0, -50.0], [x, -50.0, 150.0], [x, 150.0, 150.0]];
    TriMesh { nodes_mm, triangles: vec![[0, 1, 2], [1, 3, 2]] }
}

#[test]
fn a_body_is_coloured_by_its_distance_to_the_target_and_grey_where_none_is_known() {
    let mut body = body();
    let mut colours = Colours::of(&body, &body.mesh);
    assert_eq!(colours.known(), [Colour::Displacement, Colour::Energy]);
    assert!(colours.choose(Colour::Error, &body).is_err() && colours.choose(Colour::PriorSd, &body).is_err());

    body.sights.targets = vec![("side".to_owned(), wall(-3.0)), ("nowhere".to_owned(), wall(7.0))];
    let colours = Colours::of(&body, &body.mesh);
    assert!(colours.known().contains(&Colour::Error));
    let mut session = Session::open(&body).unwrap();
    let side = &body.mesh.node_sets["side"];
    for (n, x) in colours.numbers(&session, Colour::Error).into_iter().enumerate() {
        let expected = if side.contains(&(n as u32)) { 3.0 } else { -1.0 };
        assert!((x - expected).abs() < 1e-12, "{n}: {x}");
    }
    settle(&mut session);
    let moved = session.displacement_mm();
    let numbers = colours.numbers(&session, Colour::Error);
    for &n in side {
        assert!((numbers[n as usize] - (3.0 + moved[n as usize][0])).abs() < 1e-9);
    }

    let state =
        vtu::decode(&Export::of(&session).unwrap().coloured(&session, &colours).vtu().unwrap(), "s.vtu").unwrap();
    assert_eq!(state.point_field("target_distance_mm").unwrap().values, numbers);
    assert!(state.point_field("displacement_sd_prior_mm").is_none());

    // A phantom's state is known everywhere.
    body.sights.truth_mm = Some(equilibrium(&body.scenario, &body.mesh));
    let colours = Colours::of(&body, &body.mesh);
    assert!(colours.numbers(&session, Colour::Error).into_iter().all(|x| (0.0..1e-3).contains(&x)));
    let start = colours.numbers(&Session::open(&body).unwrap(), Colour::Error);
    let truth: Vec<f64> = moved.iter().map(|u| u.iter().map(|x| x * x).sum::<f64>().sqrt()).collect();
    assert!(start.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 2e-3));
}

#[test]
fn the_sd_of_the_prior_is_that_of_equilibria_of_other_moduli() {
    let mut body = body();
    let spreads = [("grey_matter", 0.5), ("white_matter", 0.3)];
    let tissue = |(name, log_sd): (&str, f64)| LiveTissue {
        name: name.to_owned(),
        prior: Some(Spread { log_mean: 7.0, log_sd }),
        posterior: None,
    };
    body.tissues = spreads.into_iter().map(tissue).collect();
    body.sights.estimate_sd_mm = Some(vec![0.25; body.mesh.nodes_mm().len()]);
    let mut colours = Colours::of(&body, &body.mesh);
    let session = Session::open(&body).unwrap();
    colours.choose(Colour::PriorSd, &body).unwrap();
    let found = colours.numbers(&session, Colour::PriorSd);
    let mut variance = vec![0.0; found.len()];
    for (name, log_sd) in spreads {
        let at = |log_step: f64| {
            let mut scenario = body.scenario.clone();
            let material = scenario.materials.get_mut(name).unwrap();
            *material = material.scaled(Parameter::Stiffness, log_step.exp()).unwrap();
            equilibrium(&scenario, &body.mesh)
        };
        for (sum, (a, b)) in variance.iter_mut().zip(at(0.01).iter().zip(&at(-0.01))) {
            *sum += (0..3).map(|i| (log_sd * (a[i] - b[i]) / 0.02).powi(2)).sum::<f64>();
        }
    }
    assert!(found.iter().any(|&sd| sd > 0.1));
    for (sd, variance) in found.iter().zip(variance) {
        assert!((sd - variance.sqrt()).abs() < 1e-3 * (0.1 + sd), "{sd} {}", variance.sqrt());
    }
    assert!(colours.numbers(&session, Colour::EstimateSd).iter().all(|&sd| sd == 0.25));
}

/// Random numbers one after the other.
struct Dice(CounterRng, u64);

impl Dice {
    fn new(seed: u64) -> Self {
        Self(CounterRng::new(seed, 0), 0)
    }

    fn uniform(&mut self) -> f64 {
        self.1 += 1;
        self.0.uniform(self.1)
    }
}

/// Seeded commands of a hand that does everything.
fn random_command(rng: &mut Dice, step: u64) -> Command {
    let tissue = if rng.uniform() < 0.5 { "grey_matter" } else { "white_matter" }.to_owned();
    let mut around = |middle: f64, reach: f64| middle + reach * (2.0 * rng.uniform() - 1.0);
    match step % 11 {
        0..=2 => Command::Drag { node: TOP, to_mm: [around(20.0, 60.0), around(20.0, 60.0), around(50.0, 60.0)] },
        3 => Command::Release {},
        4 => Command::Ball { centre_mm: [around(20.0, 40.0), around(20.0, 40.0), around(50.0, 30.0)], radius_mm: 15.0 },
        5 => Command::Lift {},
        6 => Command::Modulus { tissue, pa: around(0.0, 1.0).mul_add(2.5, 7.0).exp() },
        7 => Command::Gravity { m_per_s2: [around(0.0, 10.0), around(0.0, 10.0), around(0.0, 10.0)] },
        8 => Command::PoissonRatio { tissue, ratio: around(0.35, 0.14) },
        9 => Command::Support { set: "side".to_owned(), held: around(0.0, 1.0) > 0.0 },
        _ if around(0.0, 1.0) > 0.0 => Command::Undo {},
        _ => Command::Pressure { set: "side".to_owned(), pa: around(0.0, 1000.0) },
    }
}

#[test]
fn whatever_hands_do_every_number_stays_one_and_reset_gives_the_same_rest() {
    let body = body();
    let mut session = Session::open(&body).unwrap();
    settle(&mut session);
    let rest = session.displacement_mm();
    let mut rng = Dice::new(22);
    for step in 0..600 {
        session.apply(&random_command(&mut rng, step)).ok();
        session.step();
        let all = session.displacement_mm();
        assert!(all.iter().flatten().all(|x| x.is_finite() && x.abs() < 1e4), "step {step}");
    }
    assert_eq!(session.recovered(), 0);
    session.apply(&Command::Reset {}).unwrap();
    assert!(session.displacement_mm().iter().flatten().all(|&x| x == 0.0));
    settle(&mut session);
    assert_eq!(session.displacement_mm(), rest, "the same way to the same rest");
}

#[test]
fn a_start_inside_out_finds_back() {
    let scenario = SCENARIO.replace("poisson_ratio = 0.45", "poisson_ratio = 0.45\ninversion_threshold = 0.1");
    let scenario = Scenario::from_toml(&scenario).unwrap();
    let mesh = block();
    let mut stepper = hgm::fem::live::Stepper::new(&mesh, &scenario).unwrap();
    let mut start = vec![[0.0; 3]; mesh.nodes_mm().len()];
    start[TOP as usize] = [0.0, 0.0, -25.0];
    assert!(stepper.start_from(&start).unwrap());
    assert!(stepper.readout().inverted > 0);
    stepper.set_manner(hgm::fem::live::Manner::QuasiStatic);
    for _ in 0..60 {
        stepper.step();
    }
    assert_eq!(stepper.readout().inverted, 0);
    let apart = apart_mm(&stepper.displacement_mm(), &equilibrium(&scenario, &mesh));
    assert!(apart < 1e-3, "{apart} mm");
}

#[test]
fn a_replay_gives_the_same_bytes_with_one_and_two_threads() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("block.vtu"), vtu::encode(&block(), &[], &[]).unwrap()).unwrap();
    std::fs::write(at("s.toml"), SCENARIO).unwrap();
    let posed = hgm::workflow::posed_mesh(&at("block.vtu"), Some(&at("s.toml")), &Settings::default());
    let body = LiveBody::of(posed.unwrap(), &hgm::experiment::prior::PriorSettings::default());
    assert!(body.tissues.iter().all(|tissue| tissue.prior.is_some() && tissue.posterior.is_none()));
    let mut rng = Dice::new(5);
    let mut recording = Recording::new(&body);
    let mut session = Session::open(&body).unwrap();
    for step in 0..80 {
        let command = random_command(&mut rng, step);
        if session.apply(&command).is_ok() {
            recording.commands.push(Timed { step: session.steps(), command });
        }
        session.step();
    }
    recording.steps = session.steps();
    std::fs::write(at("session.jsonl"), recording.to_text()).unwrap();
    let run = |threads: &str, out: &str| {
        let words = ["live", "block.vtu", "s.toml", "--replay", "session.jsonl", "-o", out, "--threads", threads];
        let ended = Process::new(program()).current_dir(folder.path()).args(words).output().unwrap();
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        std::fs::read(at(out)).unwrap()
    };
    let one = run("1", "one.vtu");
    assert_eq!(one, run("2", "two.vtu"));
    let state = vtu::decode(&one, "one.vtu").unwrap();
    assert_eq!(state.point_field("displacement").unwrap().vectors().unwrap(), session.displacement_mm());

    // The same as a series: its last file is that state, one in between the one a shorter recording ends in.
    let words = ["live", "block.vtu", "s.toml", "--replay", "session.jsonl", "-o", "way.pvd", "--every", "25"];
    assert!(Process::new(program()).current_dir(folder.path()).args(words).status().unwrap().success());
    let list = std::fs::read_to_string(at("way.pvd")).unwrap();
    for (n, step) in [0, 25, 50, 75, 80].into_iter().enumerate() {
        assert!(list.contains(&format!("timestep=\"{step}\" part=\"0\" file=\"way-{n:04}.vtu\"")), "{list}");
    }
    assert_eq!(list.matches("DataSet").count(), 5);
    assert_eq!(std::fs::read(at("way-0004.vtu")).unwrap(), one);
    let mut shorter = Recording { steps: 50, ..recording.clone() };
    shorter.commands.retain(|timed| timed.step < 50);
    let halfway = shorter.replay(&body, &mut |_| ()).unwrap().displacement_mm();
    let written = vtu::decode(&std::fs::read(at("way-0002.vtu")).unwrap(), "way-0002.vtu").unwrap();
    assert_eq!(written.point_field("displacement").unwrap().vectors().unwrap(), halfway);
    let words = ["live", "block.vtu", "s.toml", "--replay", "session.jsonl", "-o", "never.vtu", "--every", "25"];
    let ended = Process::new(program()).current_dir(folder.path()).args(words).output().unwrap();
    assert_eq!((ended.status.code(), at("never.vtu").exists()), (Some(3), false));

    // What is no recording, or of something else, is refused and writes nothing.
    let text = recording.to_text();
    for (name, wrong, word) in [
        ("cut.jsonl", text[..text.len() - 20].to_owned(), "line"),
        ("other.jsonl", text.replace(&recording.mesh_sha256, "abc"), "another mesh"),
        ("late.jsonl", text.replacen("\"step\":0", "\"step\":99999", 1), "step"),
        ("empty.jsonl", String::new(), "empty"),
    ] {
        std::fs::write(at(name), wrong).unwrap();
        let words = ["live", "block.vtu", "s.toml", "--replay", name, "-o", "never.vtu"];
        let ended = Process::new(program()).current_dir(folder.path()).args(words).output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{name}: {said}");
        assert!(said.contains(word) && said.contains(name), "{name}: {said}");
        assert!(!at("never.vtu").exists());
    }
}

/// Port and token of an address.
fn parts(address: &str) -> (u16, String) {
    let rest = address.strip_prefix("http://127.0.0.1:").unwrap();
    let (port, token) = rest.trim_end_matches('/').split_once('/').unwrap();
    (port.parse().unwrap(), token.to_owned())
}

/// Sends a request and returns the stream with the head of the answer.
fn ask(port: u16, path: &str, headers: &str) -> (TcpStream, String) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\n{headers}\r\n\r\n").unwrap();
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") && stream.read(&mut byte).unwrap_or(0) == 1 {
        head.push(byte[0]);
    }
    (stream, String::from_utf8(head).unwrap())
}

fn knock(address: &str, origin: &str, token: &str) -> (TcpStream, String) {
    let (port, _) = parts(address);
    let headers = format!(
        "Host: 127.0.0.1:{port}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
    );
    ask(port, &format!("/{token}/socket"), &headers)
}

fn enter(address: &str) -> WebSocket<TcpStream> {
    let (port, token) = parts(address);
    let begin = Instant::now();
    loop {
        let (stream, head) = knock(address, &format!("http://127.0.0.1:{port}"), &token);
        if head.starts_with("HTTP/1.1 101") {
            return WebSocket::from_raw_socket(stream, Role::Client, None);
        }
        // The one before may still be leaving.
        assert!(begin.elapsed() < Duration::from_secs(10), "{head}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The next text message; frames in between are acknowledged.
fn next_text(socket: &mut WebSocket<TcpStream>) -> serde_json::Value {
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(20) {
        match socket.read().unwrap() {
            Message::Text(text) => return serde_json::from_str(text.as_str()).unwrap(),
            Message::Binary(_) => socket.send(Message::text(r#"{"do":"ack"}"#)).unwrap(),
            _ => {}
        }
    }
    panic!("no text came")
}

/// The next frame as words of its header.
fn next_frame(socket: &mut WebSocket<TcpStream>) -> Vec<u32> {
    loop {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            let words: Vec<u32> = bytes[..80].as_chunks::<4>().0.iter().map(|w| u32::from_le_bytes(*w)).collect();
            assert_eq!(words[0], u32::from_le_bytes(*b"HGML"));
            if words[1] == 2 {
                socket.send(Message::text(r#"{"do":"ack"}"#)).unwrap();
                return words;
            }
        }
    }
}

#[test]
fn a_page_gets_mesh_targets_and_scan_before_its_first_frame() {
    let mut body = resectable();
    body.sights.targets = vec![("side".to_owned(), wall(-3.0))];
    let values = (0..24).collect();
    body.sights.scan = Some(Scan { dims: [2, 3, 4], origin_mm: [-1.0, 2.0, 0.5], voxel_mm: 1.5, values });
    let server = serve(&body, 0, false).unwrap();
    let mut socket = enter(&server.address());
    let mut got = Vec::new();
    while got.len() < 4 {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            got.push(bytes.to_vec());
        }
    }
    let word = |bytes: &[u8], n: usize| u32::from_le_bytes(bytes[4 * n..4 * n + 4].try_into().unwrap());
    let real = |bytes: &[u8], n: usize| f32::from_bits(word(bytes, n));
    assert_eq!(got.iter().map(|bytes| word(bytes, 1)).collect::<Vec<_>>(), [1, 3, 4, 2]);
    let left = body.mesh.restricted(|l| l != 5).unwrap().0.boundary_facets(|_| true).len() as u32;
    let facets = body.mesh.boundary_facets(|_| true).len() as u32;
    let head: Vec<u32> = (2..7).map(|n| word(&got[0], n)).collect();
    assert_eq!(head, [150, 480, facets, left, 5]);
    assert_eq!(got[0].len() as u32, 28 + 12 * 150 + 12 * (facets + left) + 16 * 480 + 480);
    assert_eq!((word(&got[1], 2), word(&got[1], 3), real(&got[1], 5)), (4, 2, -3.0));
    assert!(got[1].ends_with(b"side"));
    assert_eq!([2, 3, 4].map(|n| word(&got[2], n)), [2, 3, 4]);
    assert_eq!([5, 6, 7, 8].map(|n| real(&got[2], n)), [-1.0, 2.0, 0.5, 1.5]);
    assert_eq!(got[2][36..], (0..24).collect::<Vec<u8>>());
    assert_eq!(word(&got[3], 5) & 8, 0, "the tissue is in place");
    socket.send(Message::text(r#"{"do":"resection","removed":true}"#)).unwrap();
    let begin = Instant::now();
    while next_frame(&mut socket)[5] & 8 == 0 {
        assert!(begin.elapsed() < Duration::from_secs(20));
    }
    server.stopper()();
    server.wait().unwrap();
}

fn served() -> (Server, String) {
    let server = serve(&body(), 0, true).unwrap();
    let address = server.address();
    (server, address)
}

#[test]
fn only_the_right_token_and_origin_get_in_and_only_one_at_a_time() {
    let (server, address) = served();
    let (port, token) = parts(&address);
    let own = format!("http://127.0.0.1:{port}");
    let (mut page, head) = ask(port, &format!("/{token}/"), &format!("Host: 127.0.0.1:{port}"));
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("Content-Security-Policy: default-src 'none'"), "{head}");
    let mut text = String::new();
    page.read_to_string(&mut text).unwrap();
    assert!(text.contains("<canvas"));
    let wrong = "0".repeat(token.len());
    for (origin, token) in [
        (own.as_str(), wrong.as_str()),
        ("http://evil.example", token.as_str()),
        ("null", token.as_str()),
        (own.as_str(), ""),
    ] {
        let (_, head) = knock(&address, origin, token);
        assert!(head.starts_with("HTTP/1.1 403"), "{origin} {token}: {head}");
    }
    assert!(ask(port, &format!("/{token}/"), "Host: evil.example").1.starts_with("HTTP/1.1 403"));
    assert!(
        ask(port, &format!("/{token}/../../etc/passwd"), &format!("Host: 127.0.0.1:{port}"))
            .1
            .starts_with("HTTP/1.1 404")
    );

    let mut first = enter(&address);
    assert!(knock(&address, &own, &token).1.starts_with("HTTP/1.1 409"));
    let begun = next_frame(&mut first);
    assert!(next_frame(&mut first)[3] > begun[3], "the body steps");
    first.close(None).unwrap();
    drop(first);
    let mut second = enter(&address);
    assert!(next_frame(&mut second)[3] > begun[3]);
    server.stopper()();
    let driven = server.wait().unwrap();
    assert_eq!(driven.recording.steps, driven.measured.steps);
}

#[test]
fn malformed_messages_are_refused_with_a_reason_and_change_nothing() {
    let (server, address) = served();
    let mut socket = enter(&address);
    let mut refused = 0;
    assert!(next_text(&mut socket)["laws"].as_array().unwrap().len() > 3);
    let mut rng = Dice::new(3);
    for n in 0..1000 {
        let text = match n % 5 {
            0 => "{".to_owned(),
            1 => format!(r#"{{"do":"modulus","tissue":"../{n}","pa":500}}"#),
            2 => format!(r#"{{"do":"drag","node":{},"to_mm":[0,0,0]}}"#, 1_000_000 + n),
            3 => r#"{"do":"export_vtu","path":"out.vtu"}"#.to_owned(),
            _ => (0..40).map(|_| char::from(32 + (90.0 * rng.uniform()) as u8)).collect(),
        };
        socket.send(Message::text(text)).unwrap();
        if n % 10 == 9 {
            for _ in 0..10 {
                let said = next_text(&mut socket);
                assert!(!said["refused"].as_str().unwrap().is_empty(), "{said}");
                refused += 1;
            }
        }
    }
    assert_eq!(refused, 1000);
    // One that is too long ends the connection, not the session.
    socket.send(Message::text("x".repeat(20_000))).ok();
    drop(socket);
    let mut again = enter(&address);
    assert!(next_text(&mut again)["name"] == "block");
    server.stopper()();
    let driven = server.wait().unwrap();
    let done: Vec<&Command> = driven.recording.commands.iter().map(|timed| &timed.command).collect();
    assert!(
        done.iter().all(|c| matches!(c, Command::Release {} | Command::Lift {} | Command::TimeStep { .. })),
        "{done:?}"
    );
}

#[test]
fn a_client_that_never_reads_holds_up_nobody() {
    let (server, address) = served();
    let (port, token) = parts(&address);
    let (mut silent, head) = knock(&address, &format!("http://127.0.0.1:{port}"), &token);
    assert!(head.starts_with("HTTP/1.1 101"));
    // Half a request beside it, too.
    let mut half = TcpStream::connect(("127.0.0.1", port)).unwrap();
    half.write_all(b"GET /").unwrap();
    std::thread::sleep(Duration::from_millis(700));
    silent.write_all(&[0x81, 0xfe]).unwrap();
    server.stopper()();
    let begin = Instant::now();
    let driven = server.wait().unwrap();
    assert!(begin.elapsed() < Duration::from_secs(5));
    assert!(driven.measured.steps > 10, "{:?}", driven.measured);
    assert!(driven.measured.frames <= 2, "a client that acknowledges nothing gets no more: {:?}", driven.measured);
}

#[test]
fn what_a_page_does_is_recorded_and_replays_to_the_same_end() {
    let (server, address) = served();
    let mut socket = enter(&address);
    next_frame(&mut socket);
    for text in [
        r#"{"do":"modulus","tissue":"grey_matter","pa":2740}"#,
        r#"{"do":"drag","node":137,"to_mm":[25,20,60]}"#,
        r#"{"do":"export_scenario"}"#,
    ] {
        socket.send(Message::text(text)).unwrap();
    }
    let file = loop {
        let said = next_text(&mut socket);
        assert!(said["refused"].is_null(), "{said}");
        if said["file"].is_string() {
            break said;
        }
    };
    assert!(file["text"].as_str().unwrap().contains("shear_modulus_pa = 2740.0"), "{file}");
    server.stopper()();
    let recording = server.wait().unwrap().recording;
    assert!(recording.commands.iter().any(|timed| matches!(timed.command, Command::Drag { node: TOP, .. })));
    let read = Recording::from_text(&recording.to_text()).unwrap();
    assert_eq!(read, recording);
    assert!(read.replay(&body(), &mut |_| ()).unwrap().steps() == recording.steps);
}

#[test]
fn ctrl_c_ends_the_server_and_leaves_the_recording_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("block.vtu"), vtu::encode(&block(), &[], &[]).unwrap()).unwrap();
    std::fs::write(at("s.toml"), SCENARIO).unwrap();
    let words = ["live", "block.vtu", "s.toml", "--no-browser", "--json", "--record", "session.jsonl"];
    let mut running =
        Process::new(program()).current_dir(folder.path()).args(words).stdout(Stdio::piped()).spawn().unwrap();
    let mut printed = String::new();
    let mut out = running.stdout.take().unwrap();
    let mut byte = [0];
    while !printed.ends_with('}') && out.read(&mut byte).unwrap() == 1 {
        printed.push(char::from(byte[0]));
    }
    let address = serde_json::from_str::<serde_json::Value>(&printed).unwrap()["address"].as_str().unwrap().to_owned();
    let mut socket = enter(&address);
    socket.send(Message::text(r#"{"do":"density","kg_per_m3":600}"#)).unwrap();
    next_frame(&mut socket);
    std::thread::sleep(Duration::from_millis(200));
    assert!(Process::new("kill").args(["-INT", &running.id().to_string()]).status().unwrap().success());
    assert_eq!(running.wait().unwrap().code(), Some(0));
    let recording = Recording::from_text(&std::fs::read_to_string(at("session.jsonl")).unwrap()).unwrap();
    assert!(recording.commands.iter().any(|t| t.command == Command::Density { kg_per_m3: 600.0 }), "{recording:?}");
}

#[test]
fn bodies_that_cannot_be_opened_are_refused_by_file() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &[u8]| std::fs::write(folder.path().join(name), text).unwrap();
    write("block.vtu", &vtu::encode(&block(), &[], &[]).unwrap());
    write("set.toml", SCENARIO.replace("'base'", "'skull'").as_bytes());
    write("loose.toml", SCENARIO.replace("['base']", "[]").as_bytes());
    write("bad.toml", b"fixed = 3");
    for (words, word) in [
        (&["block.vtu", "set.toml"][..], "skull"),
        (&["block.vtu", "loose.toml"], "fixed"),
        (&["block.vtu", "bad.toml"], "bad.toml"),
        (&["none.vtu"], "none.vtu"),
        (&["."], "hgm prep"),
    ] {
        let ended =
            Process::new(program()).current_dir(folder.path()).arg("live").args(words).arg("--no-browser").output();
        let ended = ended.unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(3), "{words:?}: {said}");
        assert!(said.contains(word), "{words:?}: {said}");
    }
    assert!(Path::new(folder.path()).read_dir().unwrap().count() == 4);
}

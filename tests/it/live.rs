//! `hgm live`: rest, hands, colours, replay.

use crate::job::{contents, program};
use crate::made::{finished_phantom, prepared_pair};
use hgm::fem::{Scenario, simulate};
use hgm::live::{Colour, Colours, Command, Export, LiveBody, LiveTissue, Recording, Session, Spread, Timed};
use hgm::material::law::Parameter;
use hgm::material::random::CounterRng;
use hgm::mesh::format::vtu;
use hgm::mesh::{TetMesh, TriMesh};
use hgm::workflow::{Case, Place, Resection, Settings, Sights, Silent, posed_case};
use std::process::Command as Process;

pub const SCENARIO: &str = "
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
pub fn block() -> TetMesh {
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

pub fn body() -> LiveBody {
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
pub const TOP: u32 = 5 * 5 * 5 + 12;

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
pub fn resectable() -> LiveBody {
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
pub fn wall(x: f64) -> TriMesh {
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
pub struct Dice(CounterRng, u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(CounterRng::new(seed, 0), 0)
    }

    pub fn uniform(&mut self) -> f64 {
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
fn slow_whatever_hands_do_every_number_stays_one_and_reset_gives_the_same_rest() {
    let body = body();
    let mut session = Session::open(&body).unwrap();
    settle(&mut session);
    let rest = session.displacement_mm();
    let mut rng = Dice::new(22);
    for step in 0..600 {
        session.apply(&random_command(&mut rng, step)).ok();
        session.step();
        let all = session.displacement_mm();
        let farthest = all.iter().flatten().fold(0.0_f64, |m, x| if x.is_nan() { *x } else { m.max(x.abs()) });
        assert!(farthest < 1e4, "step {step}: {farthest} mm");
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
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!((ended.status.code(), at("never.vtu").exists()), (Some(3), false), "{said}");
    assert!(["never.vtu", ".pvd", "--every"].iter().all(|word| said.contains(word)), "{said}");

    // Nothing it is made of is written over, and a name says what it is.
    std::fs::copy(at("block.vtu"), at("on-0001.vtu")).unwrap();
    let before = contents(folder.path());
    for (mesh, out, word) in [
        ("block.vtu", "block.vtu", "another name"),
        ("block.vtu", "./session.jsonl", "another name"),
        ("block.vtu", "s.toml", "another name"),
        ("on-0001.vtu", "on.pvd", "another name"),
        ("block.vtu", "x.stl", ".vtu"),
    ] {
        let words = ["live", mesh, "s.toml", "--replay", "session.jsonl", "-o", out];
        let ended = Process::new(program()).current_dir(folder.path()).args(words).output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(ended.status.code() == Some(3) && said.contains(word), "{out}: {said}");
    }
    for out in ["block.vtu", "s.toml"] {
        let words = ["live", "block.vtu", "s.toml", "--no-browser", "--record", out];
        let ended = Process::new(program()).current_dir(folder.path()).args(words).output().unwrap();
        assert_eq!(ended.status.code(), Some(3), "{out}");
    }
    assert!(contents(folder.path()) == before);

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

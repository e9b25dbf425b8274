//! Bodies before walls without friction, and how far each is from what is known of it: the tests hold the figures against their
//! bounds, `./run bench contact` writes them down.

use super::meshes::{block, cube};
use hgm::fem::{By, Load, Model, Outcome, Scenario, simulate};
use hgm::material::law::Parameter;
use hgm::mesh::TetMesh;

/// A soft tissue.
pub const GREY: &str =
    "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n";

/// The equilibrium (or the last moment) of a scenario.
pub fn solved(mesh: &TetMesh, text: &str) -> Outcome {
    simulate(mesh, &Scenario::from_toml(text).unwrap(), &|_| ()).unwrap()
}

/// A cube of 40 mm with its inner nodes moved about, so that no facet answers another.
fn uneven_cube(cells: usize) -> TetMesh {
    let regular = cube(cells, 40.0);
    let inside = |x: f64| x > 1e-9 && x < 40.0 - 1e-9;
    let place = |x: [f64; 3]| {
        let x = x.map(|v| 40.0 * v);
        let wave = |k: f64| (0.31 * x[0] + 0.47 * x[1] + 0.23 * x[2] + k).sin();
        // Nodes of a face move within it.
        [0, 1, 2].map(|i| x[i] + if inside(x[i]) { 2.0 * wave(i as f64) } else { 0.0 })
    };
    let mut mesh = block([cells; 3], place);
    mesh.node_sets.clone_from(&regular.node_sets);
    mesh
}

/// An even pressure on one face of a body whose other face stands on a wall.
pub struct EvenPressure {
    /// Largest deviation of the wall's pressure and of the top's displacement from their even value, as a share of it.
    pub deviation: f64,
    /// Of the wall's force from the pressure's, N, along the normal and across it.
    pub force_off_n: [f64; 2],
    /// Of the depth from that of the wall's soft layer, mm.
    pub depth_off_mm: f64,
}

/// 200 Pa on the top of the uneven cube, made of these elements.
pub fn even_pressure(element: &str) -> EvenPressure {
    let mesh = uneven_cube(4);
    let text = format!(
        "{GREY}[[prescribed]]\nset = 'x0'\ndisplacement_mm = [0, 0, 0]\ncomponents = [true, false, false]\n\
         [[prescribed]]\nset = 'y0'\ndisplacement_mm = [0, 0, 0]\ncomponents = [false, true, false]\n\
         [loads]\npressure = [{{ set = 'z1', pressure_pa = 200.0 }}]\n\
         [[contact]]\nset = 'z0'\nwall = {{ shape = 'plane', point_mm = [7.0, -3.0, 0.0], normal = [0, 0, 2] }}\n\
         [solver]\nelement = '{element}'\nrelative_residual = 1e-12\n"
    );
    let outcome = solved(&mesh, &text);
    let on = |set: &str| mesh.node_sets[set].iter().map(|&n| n as usize);
    let mut deviation = 0.0_f64;
    deviation = on("z0").fold(deviation, |d, n| d.max((outcome.contact_pressure_pa[n] / 200.0 - 1.0).abs()));
    let top = outcome.displacement_mm[on("z1").next().unwrap()];
    deviation = on("z1").fold(deviation, |d, n| d.max((outcome.displacement_mm[n][2] / top[2] - 1.0).abs()));
    let wall = &outcome.contact[0];
    // The wall's soft layer: p = k e^2 / 2w at e = w/2 - gap.
    let gap = 0.025 - (2.0 * 0.05 * 200.0 / 90_000.0f64).sqrt();
    EvenPressure {
        deviation,
        force_off_n: [(wall.force_n[2] - 200.0 * 16e-4).abs(), wall.force_n[0].abs()],
        depth_off_mm: (wall.depth_mm - (-gap).max(0.0)).abs(),
    }
}

/// A block that slides down a slope, against one that falls along it.
pub struct Slid {
    /// How far it has come along the slope, as a share of backward Euler's g sin(a) h^2 n (n + 1) / 2, less one.
    pub along_off: f64,
    /// How far it has left the slope, mm.
    pub off_mm: f64,
    /// How far it has gone across the way down, mm.
    pub across_mm: f64,
}

/// The mean displacement of a block on a slope of 20 degrees after 0.4 s.
pub fn slid_down_a_slope() -> Slid {
    let angle = 20f64.to_radians();
    let (s, c) = angle.sin_cos();
    // The slope falls towards +x; the block stands on it with its own z across.
    let turned = |x: [f64; 3]| [c * x[0] + s * x[2], x[1], -s * x[0] + c * x[2]];
    let mut mesh = block([3, 3, 2], |x| turned([30.0 * x[0], 30.0 * x[1], 20.0 * x[2]]));
    let bottom = |x: &[f64; 3]| (s * x[0] + c * x[2]).abs() < 1e-9;
    let nodes = (0..mesh.nodes_mm().len() as u32).filter(|&n| bottom(&mesh.nodes_mm()[n as usize])).collect();
    mesh.set_nodes("bottom", nodes).unwrap();
    let (h, steps) = (0.01, 40);
    let text = format!(
        "{}[loads]\ngravity_m_per_s2 = [0, 0, -9.81]\n\
         [[contact]]\nset = 'bottom'\nwall = {{ shape = 'plane', point_mm = [0, 0, 0], normal = [{s}, 0, {c}] }}\n\
         [solver]\nmethod = 'backward-euler'\nrelative_residual = 1e-11\n\
         [dynamics]\ntime_step_s = {h}\nsteps = {steps}\nmass_damping_per_s = 0.0\nstiffness_damping_s = 0.02\n\
         newton_iterations = 0\n",
        GREY.replace("1000.0", "20000.0")
    );
    let outcome = solved(&mesh, &text);
    let mut mean = [0.0; 3];
    let whole: f64 = (0..mesh.tets().len()).map(|t| mesh.volume_mm3(t)).sum();
    for (t, tet) in mesh.tets().iter().enumerate() {
        for &n in tet {
            let share = 0.25 * mesh.volume_mm3(t) / whole;
            (0..3).for_each(|i| mean[i] += share * outcome.displacement_mm[n as usize][i]);
        }
    }
    let (along, off) = (c * mean[0] - s * mean[2], s * mean[0] + c * mean[2]);
    let n = f64::from(steps);
    let fallen = 1e3 * 9.81 * s * h * h * n * (n + 1.0) / 2.0;
    Slid { along_off: along / fallen - 1.0, off_mm: off, across_mm: mean[1] }
}

/// Two blocks on either side of a sheet, pressed together and moved apart along it.
pub struct SlidApart {
    /// Nodes of the sheet on either side.
    pub sides: [usize; 2],
    /// Largest difference of a node's way into the wall's soft layer from that of the pressure, mm.
    pub across_off_mm: f64,
    /// Of its way along the sheet from what was asked, mm.
    pub along_off_mm: f64,
    /// What holds back what slides, N.
    pub carried_n: f64,
}

/// 3 mm each, under 100 Pa.
pub fn slid_apart_along_a_sheet() -> SlidApart {
    let mut mesh = block([4, 3, 3], |x| [80.0 * x[0] - 40.0, 40.0 * x[1], 40.0 * x[2]]);
    let on = |mesh: &TetMesh, x: f64| {
        (0..mesh.nodes_mm().len() as u32).filter(|&n| (mesh.nodes_mm()[n as usize][0] - x).abs() < 1e-9).collect()
    };
    for (set, x) in [("left", -40.0), ("sheet", 0.0), ("right", 40.0)] {
        let nodes: Vec<u32> = on(&mesh, x);
        mesh.set_nodes(set, nodes).unwrap();
    }
    let moved = |set: &str, y: f64| {
        format!("[[prescribed]]\nset = '{set}'\ndisplacement_mm = [0, {y}, 0]\ncomponents = [false, true, true]\n")
    };
    let text = format!(
        "{}{}[supports]\nsheet = 'sliding'\n{}[loads]\n\
         pressure = [{{ set = 'left', pressure_pa = 100.0 }}, {{ set = 'right', pressure_pa = 100.0 }}]\n\
         [solver]\nrelative_residual = 1e-11\n",
        moved("left", 3.0),
        moved("right", -3.0),
        // Without lateral strain the pressure is even.
        GREY.replace("0.45", "0.0")
    );
    let scenario = Scenario::from_toml(&text).unwrap();
    let body = scenario.body(&mesh).unwrap();
    assert_eq!(body.nodes_mm().len(), mesh.nodes_mm().len() + 16);
    assert_eq!(scenario.body(&body).unwrap().nodes_mm().len(), body.nodes_mm().len());
    let outcome = solved(&mesh, &text);
    assert_eq!(outcome.displacement_mm.len(), body.nodes_mm().len());
    // p = k e^2 / 2w: how far either side moves into the layer before its wall.
    let way = (2.0 * 0.05 * 100.0 / 90_000.0f64).sqrt();
    let mut found = SlidApart { sides: [0; 2], across_off_mm: 0.0, along_off_mm: 0.0, carried_n: 0.0 };
    for &n in &body.node_sets["sheet"] {
        let u = outcome.displacement_mm[n as usize];
        found.sides[usize::from(u[1] < 0.0)] += 1;
        found.across_off_mm = found.across_off_mm.max((u[0].abs() - way).abs());
        found.along_off_mm = found.along_off_mm.max((u[1].abs() - 3.0).abs());
    }
    found.carried_n = outcome.reaction_n.iter().map(|r| r[1].abs()).sum();
    found
}

/// Energy after a bounce over that before: a stiff block that falls on a soft wall and comes back, by steps of this many seconds.
pub fn energy_kept_in_a_bounce(h: f64) -> f64 {
    let mesh = cube(1, 20.0);
    let (mass_kg, g, drop_mm) = (8e-3, 9.81, 2.0);
    // From the drop to well after the first bounce: contact lasts about pi sqrt(m / k A) = 31 ms.
    let steps = (0.062 / h).round() as usize;
    let text = format!(
        "{}[loads]\ngravity_m_per_s2 = [0, 0, -{g}]\n\
         [[contact]]\nset = 'z0'\nwall = {{ shape = 'plane', point_mm = [0, 0, -{drop_mm}], normal = [0, 0, 1] }}\n\
         stiffness_pa_per_mm = 200.0\nsoftness_mm = 0.2\n\
         [solver]\nmethod = 'backward-euler'\nrelative_residual = 1e-10\n\
         [dynamics]\ntime_step_s = {h}\nsteps = {steps}\nmass_damping_per_s = 0.0\nstiffness_damping_s = 0.0\n\
         newton_iterations = 0\nkeep_every = 1\nrest_speed_mm_per_s = 0.0\n",
        GREY.replace("1000.0", "1e6")
    );
    let frames = solved(&mesh, &text).motion.unwrap().frames;
    let height = |k: usize| frames[k].displacement_mm.iter().map(|u| u[2]).sum::<f64>() / 8.0;
    let whole = |k: usize| {
        let v = (height(k) - height(k - 1)) / h / 1e3;
        // Backward Euler's own invariant in free fall is the mean height of a step.
        let z = 0.5 * (height(k) + height(k - 1)) / 1e3;
        mass_kg * (0.5 * v * v + g * (z + drop_mm / 1e3))
    };
    let last = frames.len() - 1;
    assert!(height(last) > -drop_mm + 0.2, "it has come up again: {}", height(last));
    whole(last) / whole(1)
}

const LEANING: &str = "
    fixed = ['x0']
    [materials.grey_matter]
    law = 'neo-hookean'
    shear_modulus_pa = 1370.0
    poisson_ratio = 0.45
    [loads]
    gravity_m_per_s2 = [1.0, -0.5, -4.0]
    [solver]
    relative_residual = 1e-12
";

/// A cube that is held at a side and leans on a plane of this height.
pub fn leaning(height_mm: f64) -> Scenario {
    let wall = format!(
        "[[contact]]\nset = 'z0'\nwall = {{ shape = 'plane', point_mm = [0, 0, {height_mm}], normal = [0.1, 0, 1] }}\n\
         stiffness_pa_per_mm = 2000.0\nsoftness_mm = 1.0\n"
    );
    Scenario::from_toml(&format!("{LEANING}{wall}")).unwrap()
}

/// Height of a plane of [`leaning`] that the body just touches when nothing is in its way.
pub fn height_of_the_lowest(mesh: &TetMesh) -> f64 {
    let free = solved(mesh, LEANING);
    let below = |n: &u32| {
        let (x, u) = (mesh.nodes_mm()[*n as usize], free.displacement_mm[*n as usize]);
        0.1 * (x[0] + u[0]) + x[2] + u[2]
    };
    mesh.node_sets["z0"].iter().map(below).fold(f64::MAX, f64::min)
}

/// Rooms (mm) of the lowest node of the leaning cube: away from the wall, just within its layer, and pressed against it; and whether
/// it touches.
pub const ROOMS: [(f64, bool); 3] = [(1.0, false), (0.47, true), (-2.0, true)];

/// Largest difference of the sensitivities of the leaning cube with this room from slopes of solutions (Richardson's of two
/// steps), as a share of the largest one: by stiffness, weight, gap and all loads; and whether it touches.
pub fn sensitivities_off(room: f64) -> (f64, bool) {
    let mesh = cube(3, 40.0);
    let lowest = height_of_the_lowest(&mesh);
    let length = 1.01f64.sqrt();
    // Height of the plane at which the lowest node has this room.
    let with_room = |room: f64| leaning(lowest - room * length);
    let by = [
        By::Material { name: "grey_matter".into(), parameter: Parameter::Stiffness },
        By::Load(Load::Weight),
        By::Gap(0),
        By::AllLoads,
    ];
    let scenario = with_room(room);
    let model = Model::new(&mesh, &scenario).unwrap();
    let (outcome, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    let columns = model.sensitivities(&scenario.materials, &state, &by).unwrap();
    let mut worst = 0.0_f64;
    for (by, column) in by.iter().zip(&columns) {
        let step = 2e-4;
        let at = |step: f64| {
            let mut s = if *by == By::Gap(0) { with_room(room + step) } else { scenario.clone() };
            match by {
                By::Material { name, .. } => {
                    let softer = s.materials[name].scaled(Parameter::Stiffness, step.exp()).unwrap();
                    s.materials.insert(name.clone(), softer);
                }
                By::Gap(_) => {}
                _ => s.loads.gravity_m_per_s2 = s.loads.gravity_m_per_s2.map(|g| g * step.exp()),
            }
            let model = Model::new(&mesh, &s).unwrap();
            let start = model.state(&outcome.displacement_mm).unwrap();
            model.solve(&s.materials, Some(&start), &|_| ()).unwrap().0.displacement_mm
        };
        let [above, below, far_above, far_below] = [step, -step, 2.0 * step, -2.0 * step].map(at);
        let scale = column.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs())).max(1e-3);
        for n in 0..column.len() {
            for i in 0..3 {
                let near = (above[n][i] - below[n][i]) / (2.0 * step);
                let far = (far_above[n][i] - far_below[n][i]) / (4.0 * step);
                let slope = (4.0 * near - far) / 3.0;
                worst = worst.max((slope - column[n][i]).abs() / scale);
            }
        }
    }
    (worst, outcome.contact[0].area_mm2 > 0.0)
}

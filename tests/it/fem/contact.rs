//! Walls without friction against what is known of them.

use super::meshes::{block, cube};
use hgm::fem::{By, Load, Model, Outcome, Scenario, simulate};
use hgm::material::law::Parameter;
use hgm::mesh::TetMesh;

const GREY: &str = "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n";

fn solved(mesh: &TetMesh, text: &str) -> Outcome {
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

/// Every node on the wall carries the same pressure, to the residual, on a face whose facets and the wall know nothing of
/// each other.
#[test]
fn even_pressure_goes_through_a_wall_evenly() {
    let mesh = uneven_cube(4);
    for element in ["tet4", "tet4-nodal", "tet10"] {
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
        if element == "tet10" {
            // The middles of edges carry a quadratic facet's load, its corners none: they show it by where they are.
            let depth = |n: usize| outcome.displacement_mm[n][2];
            let first = depth(on("z0").next().unwrap());
            deviation = on("z0").fold(deviation, |d, n| d.max((depth(n) - first).abs()));
        } else {
            deviation = on("z0").fold(deviation, |d, n| d.max((outcome.contact_pressure_pa[n] / 200.0 - 1.0).abs()));
        }
        let top = outcome.displacement_mm[on("z1").next().unwrap()];
        deviation = on("z1").fold(deviation, |d, n| d.max((outcome.displacement_mm[n][2] / top[2] - 1.0).abs()));
        assert!(deviation < 1e-8, "{element}: {deviation:.1e}");
        let wall = &outcome.contact[0];
        assert!((wall.force_n[2] - 200.0 * 16e-4).abs() < 1e-9 && wall.force_n[0].abs() < 1e-12, "{wall:?}");
        // The wall's soft layer: p = k e^2 / 2w at e = w/2 - gap.
        let gap = 0.025 - (2.0 * 0.05 * 200.0 / 90_000.0f64).sqrt();
        assert!((wall.depth_mm - (-gap).max(0.0)).abs() < 1e-6, "{wall:?}");
    }
}

#[test]
fn a_body_that_leaves_its_wall_is_not_held_back() {
    let mesh = cube(3, 40.0);
    let pulled = "fixed = ['z1']\n[solver]\nrelative_residual = 1e-12\n[loads]\ngravity_m_per_s2 = [0, 0, 9.81]\n";
    let wall = "[[contact]]\nset = 'z0'\nwall = { shape = 'own-surface' }\n";
    let [without, with] = ["", wall].map(|wall| solved(&mesh, &format!("{pulled}{wall}{GREY}")));
    // Two ways to one equilibrium: alike but for the solver's residual.
    for (a, b) in without.displacement_mm.iter().flatten().zip(with.displacement_mm.iter().flatten()) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    assert_eq!((with.contact[0].area_mm2, with.contact[0].force_n), (0.0, [0.0; 3]));
}

/// Backward Euler of the mean displacement: g sin(a) h^2 n (n + 1) / 2 down the slope, nothing off it.
#[test]
fn a_block_slides_down_a_slope_as_if_it_fell_along_it() {
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
    assert!((along / fallen - 1.0).abs() < 1e-8, "{along} against {fallen}");
    assert!(off.abs() < 0.1 && mean[1].abs() < 1e-9, "{off} off the slope");
}

/// Two blocks on either side of a sheet, pressed together and moved apart along it.
#[test]
fn blocks_slide_apart_along_a_sheet_without_a_gap() {
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
    let mut sides = [0.0_f64; 2];
    for &n in &body.node_sets["sheet"] {
        let u = outcome.displacement_mm[n as usize];
        let side = usize::from(u[1] < 0.0);
        sides[side] += 1.0;
        assert!((u[0].abs() - way).abs() < 1e-3 && (u[1].abs() - 3.0).abs() < 1e-6, "{u:?}");
    }
    assert_eq!(sides, [16.0, 16.0]);
    let carried: f64 = outcome.reaction_n.iter().map(|r| r[1].abs()).sum();
    assert!(carried < 1e-8, "{carried} N hold back what slides");
}

#[test]
fn the_edge_of_a_sheet_inside_the_body_stays_whole() {
    let mut mesh = block([4, 3, 4], |x| [80.0 * x[0] - 40.0, 40.0 * x[1], 80.0 * x[2]]);
    let upper = |x: &[f64; 3]| x[0].abs() < 1e-9 && x[2] > 39.0;
    let nodes = (0..mesh.nodes_mm().len() as u32).filter(|&n| upper(&mesh.nodes_mm()[n as usize])).collect();
    mesh.set_nodes("falx", nodes).unwrap();
    let held = (0..mesh.nodes_mm().len() as u32).filter(|&n| mesh.nodes_mm()[n as usize][2] == 0.0).collect();
    mesh.set_nodes("base", held).unwrap();
    let text = format!(
        "[supports]\nbase = 'fixed'\nfalx = 'sliding'\n{GREY}[loads]\ngravity_m_per_s2 = [9.81, 0, 0]\n\
         density_kg_per_m3 = 300.0\n"
    );
    let outcome = solved(&mesh, &text);
    let body = Scenario::from_toml(&text).unwrap().body(&mesh).unwrap().into_owned();
    // The left half leans on the sheet, the right half leaves it, and both hang together below.
    let at = |n: &u32| outcome.displacement_mm[*n as usize][0];
    let doubles: Vec<u32> = (mesh.nodes_mm().len() as u32..body.nodes_mm().len() as u32).collect();
    assert_eq!(doubles.len(), 8);
    let wall = &outcome.contact[0];
    assert!(wall.depth_mm < 0.05 && wall.area_mm2 > 0.0 && wall.force_n[0] < 0.0, "{wall:?}");
    let farthest = body.node_sets["falx"].iter().map(at).fold(f64::MIN, f64::max);
    assert!(farthest > 1.0, "the other side moves away: {farthest}");
}

/// A sheet whose fold takes in one cell whole: that cell stays with a neighbour, and the body has its equilibrium.
#[test]
fn a_sheet_that_folds_about_a_cell_still_slides() {
    let mut mesh = block([6, 6, 6], |x| [80.0 * x[0] - 40.0, 40.0 * x[1], 40.0 * x[2]]);
    let on = |x: f64| {
        let near = |f: &[u32; 3]| f.iter().all(|&n| (mesh.nodes_mm()[n as usize][0] - x).abs() < 1e-9);
        mesh.facets().into_iter().filter(|f| f.2.is_some() && near(&f.0)).collect::<Vec<_>>()
    };
    let plane = on(0.0);
    let cell = plane[plane.len() / 2].1;
    let own = mesh.facets().into_iter().filter(|f| f.2.is_some() && (f.1 == cell || f.2 == Some(cell)));
    let folded: Vec<[u32; 3]> = plane.iter().copied().chain(own).map(|f| f.0).collect();
    let held = (0..mesh.nodes_mm().len() as u32).filter(|&n| mesh.nodes_mm()[n as usize][2] == 0.0).collect();
    mesh.facet_sets.insert("falx".to_owned(), folded);
    mesh.set_nodes("base", held).unwrap();
    let text = format!(
        "[supports]\nbase = 'fixed'\nfalx = 'sliding'\n{GREY}[loads]\ngravity_m_per_s2 = [9.81, 0, 0]\n\
         density_kg_per_m3 = 100.0\n"
    );
    let body = Scenario::from_toml(&text).unwrap().body(&mesh).unwrap().into_owned();
    let mut pieces = body.pieces_beside(&[]);
    pieces.sort_unstable();
    pieces.dedup();
    assert_eq!(pieces.len(), 2, "the two halves");
    assert!(solved(&mesh, &text).convergence.worst_volume_ratio > 0.3);
    // A half that nothing holds is named at once.
    let left = (0..mesh.nodes_mm().len() as u32).filter(|&n| mesh.nodes_mm()[n as usize][0] == -40.0).collect();
    mesh.set_nodes("base", left).unwrap();
    let refused = Scenario::from_toml(&text).unwrap().body(&mesh).unwrap_err().to_string();
    assert!(refused.contains("by no facet") && refused.contains("`falx`"), "{refused}");
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

fn leaning(height_mm: f64) -> Scenario {
    let wall = format!(
        "[[contact]]\nset = 'z0'\nwall = {{ shape = 'plane', point_mm = [0, 0, {height_mm}], normal = [0.1, 0, 1] }}\n\
         stiffness_pa_per_mm = 2000.0\nsoftness_mm = 1.0\n"
    );
    Scenario::from_toml(&format!("{LEANING}{wall}")).unwrap()
}

/// Height of a plane of [`leaning`] that the body just touches when nothing is in its way.
fn height_of_the_lowest(mesh: &TetMesh) -> f64 {
    let free = solved(mesh, LEANING);
    let below = |n: &u32| {
        let (x, u) = (mesh.nodes_mm()[*n as usize], free.displacement_mm[*n as usize]);
        0.1 * (x[0] + u[0]) + x[2] + u[2]
    };
    mesh.node_sets["z0"].iter().map(below).fold(f64::MAX, f64::min)
}

#[test]
fn a_wall_that_is_moved_away_is_the_wall_put_there() {
    let mesh = cube(3, 40.0);
    let lowest = height_of_the_lowest(&mesh);
    // Three mm into the way of the lowest node, then one.
    let (by, length) = (2.0, 1.01f64.sqrt());
    let [height, lower] = [3.0, 3.0 - by].map(|mm| lowest + mm * length);
    let put = leaning(lower);
    let mut model = Model::new(&mesh, &leaning(height)).unwrap();
    let solved_by = |model: &Model| model.solve(&put.materials, None, &|_| ()).unwrap().0;
    let before = solved_by(&model);
    model.set_gap(0, by);
    let (moved, there) = (solved_by(&model), solved_by(&Model::new(&mesh, &put).unwrap()));
    let apart = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert!(moved.contact[0].area_mm2 > 0.0);
    assert!(apart(&moved.displacement_mm, &there.displacement_mm) < 1e-9);
    assert!(apart(&moved.displacement_mm, &before.displacement_mm) > 0.2);
}

/// A foretold start has nodes far behind the wall.
#[test]
fn from_a_start_through_its_wall_a_body_comes_to_where_it_comes_from_rest() {
    let mesh = cube(3, 40.0);
    let scenario = leaning(height_of_the_lowest(&mesh) + 2.0 * 1.01f64.sqrt());
    let model = Model::new(&mesh, &scenario).unwrap();
    let (outcome, _) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
    assert!(outcome.contact[0].area_mm2 > 0.0 && outcome.contact[0].depth_mm < 0.05);
    let through: Vec<[f64; 3]> = outcome.displacement_mm.iter().map(|u| [u[0], u[1], 1.3 * u[2] - 0.7]).collect();
    let start = model.state(&through).unwrap();
    let found = model.solve(&scenario.materials, Some(&start), &|_| ()).unwrap().0;
    assert_eq!(found.convergence.load_steps, [1.0]);
    let off = found.displacement_mm.iter().flatten().zip(outcome.displacement_mm.iter().flatten());
    let farthest = off.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    assert!(farthest < 1e-6, "{farthest} mm; {:?} {:?}", found.convergence, outcome.convergence);
}

/// Away from the wall, just within its layer, and pressed against it.
#[test]
fn sensitivities_before_a_wall_are_the_slopes_of_solutions() {
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
    for (room, touches) in [(1.0, false), (0.47, true), (-2.0, true)] {
        let scenario = with_room(room);
        let model = Model::new(&mesh, &scenario).unwrap();
        let (outcome, state) = model.solve(&scenario.materials, None, &|_| ()).unwrap();
        assert_eq!(outcome.contact[0].area_mm2 > 0.0, touches, "{room}");
        let columns = model.sensitivities(&scenario.materials, &state, &by).unwrap();
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
                    let error = (slope - column[n][i]).abs() / scale;
                    assert!(error < 1e-5, "{by:?} at {room}: {slope} against {}", column[n][i]);
                }
            }
        }
    }
}

/// A stiff block falls on a soft wall and comes back; backward Euler loses energy in proportion to its step.
#[test]
fn slow_a_bounce_keeps_its_energy_but_for_the_time_step() {
    let mesh = cube(1, 20.0);
    let (mass_kg, g, drop_mm) = (8e-3, 9.81, 2.0);
    let kept = |h: f64| {
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
    };
    let [coarse, fine, finest] = [4e-5, 2e-5, 1e-5].map(kept);
    println!("energy after a bounce over before: {coarse:.5} {fine:.5} {finest:.5}");
    assert!(coarse < fine && fine < finest && finest < 1.0 + 1e-6);
    assert!(finest > 0.99, "{finest}");
    // Without the step's loss: what is left at no step at all.
    assert!((2.0 * finest - fine - 1.0).abs() < 1e-3, "{}", 2.0 * finest - fine);
}

#[test]
fn walls_and_sheets_that_cannot_be_are_refused() {
    let mut mesh = cube(2, 40.0);
    let half = (0..mesh.nodes_mm().len() as u32).filter(|&n| mesh.nodes_mm()[n as usize][0] <= 20.0).collect();
    mesh.set_nodes("slab", half).unwrap();
    let refused = |text: &str| {
        let scenario = Scenario::from_toml(&format!("fixed = ['x0']\n{text}{GREY}")).unwrap();
        Model::new(&mesh, &scenario).err().expect(text).to_string()
    };
    let contact = |rest: &str| refused(&format!("[[contact]]\nset = 'z0'\n{rest}\n"));
    assert!(refused("[supports]\nskull = 'sliding'\n").contains("no set `skull`"));
    assert!(refused("[supports]\nslab = 'sliding'\n").contains("no sheet of facets"));
    assert!(contact("wall = { shape = 'plane', point_mm = [0, 0, 0], normal = [0, 0, 0] }").contains("a direction"));
    assert!(contact("wall = { shape = 'own-surface' }\nsoftness_mm = 0.0").contains("softness_mm"));
    assert!(contact("wall = { shape = 'own-surface' }\ngap_mm = -1.0").contains("0 or more"));
    assert!(contact("wall = { shape = 'field', name = 'skull' }").contains("`skull`"));
    assert!(Scenario::from_toml("[[contact]]\nset = 'z0'\nwall = { shape = 'cone' }").is_err());
    assert!(Scenario::from_toml("[supports]\nfalx = 'loose'").is_err());
}

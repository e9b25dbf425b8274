//! Walls without friction against what is known of them.

use super::meshes::{block, cube};
use super::walls::{
    GREY, ROOMS, energy_kept_in_a_bounce, even_pressure, height_of_the_lowest, leaning, sensitivities_off,
    slid_apart_along_a_sheet, slid_down_a_slope, solved,
};
use hgm::fem::{Contact, Model, Scenario, Wall};
use hgm::geometry::SmoothField;
use hgm::mesh::TetMesh;
use hgm::mesh::format::vtu;
use std::sync::Arc;

/// Every node on the wall carries the same pressure, to the residual, on a face whose facets and the wall know nothing of
/// each other.
#[test]
fn even_pressure_goes_through_a_wall_evenly() {
    for element in ["tet4", "tet4-nodal", "tet10"] {
        let found = even_pressure(element);
        assert!(found.deviation < 1e-8, "{element}: {:.1e}", found.deviation);
        let [along, across] = found.force_off_n;
        assert!(along < 1e-9 && across < 1e-12, "{element}: {along:.1e} {across:.1e} N");
        assert!(found.depth_off_mm < 1e-6, "{element}: {:.1e} mm", found.depth_off_mm);
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
    let slid = slid_down_a_slope();
    assert!(slid.along_off.abs() < 1e-8, "{:.1e} of the way", slid.along_off);
    assert!(slid.off_mm.abs() < 0.1 && slid.across_mm.abs() < 1e-9, "{} off the slope", slid.off_mm);
}

#[test]
fn blocks_slide_apart_along_a_sheet_without_a_gap() {
    let found = slid_apart_along_a_sheet();
    assert_eq!(found.sides, [16, 16]);
    assert!(found.across_off_mm < 1e-3 && found.along_off_mm < 1e-6, "{} {}", found.across_off_mm, found.along_off_mm);
    assert!(found.carried_n < 1e-8, "{} N hold back what slides", found.carried_n);
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

/// A facet of the sheet with all its nodes where the sheet ends inside the body is not parted: what is read back from a file
/// must not have a wall on one side of it.
#[test]
fn a_mesh_cut_along_a_sheet_has_the_same_answer_after_a_file() {
    let mut mesh = block([4, 4, 4], |x| [80.0 * x[0] - 40.0, 40.0 * x[1], 80.0 * x[2]]);
    let place = |mesh: &TetMesh, n: u32| mesh.nodes_mm()[n as usize];
    let within = mesh.facets().into_iter().filter(|f| f.2.is_some()).map(|f| f.0);
    let plane: Vec<[u32; 3]> = within.filter(|f| f.iter().all(|&n| place(&mesh, n)[0].abs() < 1e-9)).collect();
    let above = |f: &[u32; 3]| f.iter().all(|&n| place(&mesh, n)[2] > 39.0);
    // A tooth below the sheet's lower edge, away from the body's surface.
    let inner = |n: u32| (9.0..31.0).contains(&place(&mesh, n)[1]);
    let tooth = |f: &[u32; 3]| {
        let upper = f.iter().filter(|&&n| (place(&mesh, n)[2] - 40.0).abs() < 1e-9).count();
        let lower = f.iter().filter(|&&n| (place(&mesh, n)[2] - 20.0).abs() < 1e-9).count();
        (upper, lower) == (2, 1) && f.iter().all(|&n| inner(n))
    };
    let tooth = plane.iter().copied().find(tooth).unwrap();
    let sheet: Vec<[u32; 3]> = plane.iter().copied().filter(above).chain([tooth]).collect();
    let held = (0..mesh.nodes_mm().len() as u32).filter(|&n| place(&mesh, n)[2] == 0.0).collect();
    mesh.facet_sets.insert("falx".to_owned(), sheet);
    mesh.set_nodes("base", held).unwrap();
    let text = |gravity: f64| {
        format!(
            "[supports]\nbase = 'fixed'\nfalx = 'sliding'\n{GREY}[loads]\ngravity_m_per_s2 = [{gravity}, 0, 0]\n\
             density_kg_per_m3 = 100.0\n[solver]\nrelative_residual = 1e-10\n"
        )
    };
    let body = Scenario::from_toml(&text(9.81)).unwrap().body(&mesh).unwrap().into_owned();
    let mut sorted = tooth;
    sorted.sort_unstable();
    let same_nodes = |f: &&[u32; 3]| {
        let mut nodes = **f;
        nodes.sort_unstable();
        nodes == sorted
    };
    assert_eq!(body.facet_sets["falx"].iter().filter(same_nodes).count(), 2, "both sides of the tooth");
    let read = vtu::decode(&vtu::encode(&body, &[], &[]).unwrap(), "cut.vtu").unwrap().mesh;
    let sides = |mesh: &TetMesh| {
        let mut sides = mesh.facet_sets["falx"].clone();
        sides.sort_unstable();
        sides
    };
    assert_eq!(sides(&read), sides(&body));
    for gravity in [9.81, -9.81] {
        let [before, after] = [&mesh, &read].map(|mesh| solved(mesh, &text(gravity)));
        for (a, b) in before.displacement_mm.iter().flatten().zip(after.displacement_mm.iter().flatten()) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        assert!((before.contact[0].area_mm2 / after.contact[0].area_mm2 - 1.0).abs() < 1e-9);
    }
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

/// Where a scan shows less room than the gap that is taken away, the body would be squeezed with nothing pulling at it.
#[test]
fn a_wall_of_uneven_room_that_comes_nearer_does_not_press_a_body_at_rest() {
    let mesh = cube(4, 40.0);
    // Below the lowest face from .8 mm too little to 1 mm of room.
    let places = (0..13 * 13 * 13).map(|n| [n % 13, n / 13 % 13, n / 169].map(|i| 5.0 * f64::from(i) - 10.0));
    let samples = places.map(|x| (x[2] + 0.045 * x[0] - 0.8) as f32).collect();
    let field = SmoothField::new([-10.0; 3], [5.0; 3], [13; 3], samples).unwrap();
    let before = |gap_mm: f64, g: f64| {
        let text =
            format!("fixed = ['x1']\n{GREY}[loads]\ngravity_m_per_s2 = [0, 0, {g}]\ndensity_kg_per_m3 = 200.0\n");
        let mut scenario = Scenario::from_toml(&text).unwrap();
        let wall = Wall::Field { name: "skull".into(), even: false, distance_mm: Some(Arc::new(field.clone())) };
        scenario.contact.push(Contact::new("z0", wall, gap_mm));
        scenario
    };
    let solved = |model: &Model, of: &Scenario| model.solve(&of.materials, None, &|_| ()).unwrap().0;
    for gap_mm in [0.3, 0.01] {
        let moved = |g: f64| {
            let far = before(1.0, g);
            let mut model = Model::new(&mesh, &far).unwrap();
            model.set_gap(0, gap_mm);
            solved(&model, &far)
        };
        let largest = |u: &[[f64; 3]]| u.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(largest(&moved(0.0).displacement_mm) < 1e-9, "{gap_mm}");
        let (found, near) = (moved(-9.81), before(gap_mm, -9.81));
        let there = solved(&Model::new(&mesh, &near).unwrap(), &near);
        assert!(there.contact[0].area_mm2 > 0.0);
        for (a, b) in found.displacement_mm.iter().flatten().zip(there.displacement_mm.iter().flatten()) {
            assert!((a - b).abs() < 1e-9, "{gap_mm}: {a} {b}");
        }
    }
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

#[test]
fn sensitivities_before_a_wall_are_the_slopes_of_solutions() {
    for (room, touches) in ROOMS {
        let (off, touched) = sensitivities_off(room);
        assert_eq!(touched, touches, "{room}");
        assert!(off < 1e-5, "{off:.1e} at {room}");
    }
}

/// Backward Euler loses energy in proportion to its step.
#[test]
fn slow_a_bounce_keeps_its_energy_but_for_the_time_step() {
    let [coarse, fine, finest] = [4e-5, 2e-5, 1e-5].map(energy_kept_in_a_bounce);
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
    let plane = "wall = { shape = 'plane', point_mm = [0, 0, -1], normal = [0, 0, 1] }\ngap_mm = 2.0";
    assert!(contact(plane).contains("`wall.point_mm`"));
    assert!(contact("wall = { shape = 'field', name = 'skull' }").contains("`skull`"));
    assert!(Scenario::from_toml("[[contact]]\nset = 'z0'\nwall = { shape = 'cone' }").is_err());
    assert!(Scenario::from_toml("[supports]\nfalx = 'loose'").is_err());
}

//! Bad input is refused by name.

use super::meshes::{cube, two_tissue_cube};
use hgm::fem::{FemError, FemWarning, Idle, Scenario, simulate};
use hgm::mesh::TetMesh;

const GREY: &str = "[materials.grey_matter]\nlaw = 'neo-hookean'\nshear_modulus_pa = 1000.0\npoisson_ratio = 0.45\n";

fn refusal(mesh: &TetMesh, text: &str) -> (FemError, String) {
    let scenario = Scenario::from_toml(text).unwrap();
    let error = simulate(mesh, &scenario, &|_| ()).unwrap_err();
    let message = error.to_string();
    (error, message)
}

#[test]
fn unknown_sets_are_refused_with_those_that_exist() {
    let mesh = cube(2, 10.0);
    let (error, message) = refusal(&mesh, &format!("fixed = ['base']\n{GREY}"));
    assert!(matches!(error, FemError::UnknownSet { .. }));
    assert!(message.contains("`base`") && message.contains("x0, x1, y0"), "{message}");
    let patch = format!("fixed = ['z0']\n{GREY}[[loads.patch]]\nset = 'superior'\nforce_n = [0, 0, -1]");
    assert!(refusal(&mesh, &patch).1.contains("`superior`"));
}

#[test]
fn a_set_of_facets_among_nodes_is_named_as_one() {
    let mut mesh = cube(2, 10.0);
    mesh.facet_sets.insert("base".to_owned(), vec![mesh.boundary_facets(|_| true)[0]]);
    let (error, message) = refusal(&mesh, &format!("fixed = ['base']\n{GREY}"));
    assert!(matches!(error, FemError::OfFacets { .. }));
    assert!(message.contains("`base` is a set of facets") && message.contains("x0, x1, y0"), "{message}");
    assert!(!message.contains("there is no set"), "{message}");
}

#[test]
fn a_body_that_nothing_holds_is_refused() {
    assert!(matches!(refusal(&cube(1, 10.0), GREY).0, FemError::NothingHeld));
    let two = TetMesh::new(
        vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [5.0, 0.0, 0.0],
            [6.0, 0.0, 0.0],
            [5.0, 1.0, 0.0],
            [5.0, 0.0, 1.0],
        ],
        vec![[0, 1, 2, 3], [4, 5, 6, 7]],
        vec![2, 2],
    );
    let mut two = two.unwrap();
    two.set_nodes("one", vec![0, 1, 2]).unwrap();
    let (error, _) = refusal(&two, &format!("fixed = ['one']\n{GREY}"));
    assert!(matches!(error, FemError::Loose { nodes: 4, node: 4 }), "{error}");
}

/// Two cubes of 10 mm, the second moved, that share the nodes where they meet; its far faces are the sets `x` and `y`.
fn touching(moved: [f64; 3]) -> TetMesh {
    let first = cube(2, 10.0);
    let mut nodes = first.nodes_mm().to_vec();
    let number = |x: [f64; 3], nodes: &mut Vec<[f64; 3]>| {
        nodes.iter().position(|n| *n == x).unwrap_or_else(|| {
            nodes.push(x);
            nodes.len() - 1
        }) as u32
    };
    let place = |x: &[f64; 3]| [0, 1, 2].map(|i| x[i] + moved[i]);
    let second: Vec<u32> = first.nodes_mm().iter().map(|x| number(place(x), &mut nodes)).collect();
    let tets = [first.tets().to_vec(), first.tets().iter().map(|t| t.map(|n| second[n as usize])).collect()].concat();
    let labels = vec![2; tets.len()];
    let mut mesh = TetMesh::new(nodes, tets, labels).unwrap();
    mesh.set_nodes("held", first.node_sets["x0"].clone()).unwrap();
    for (set, face) in [("x", "x1"), ("y", "y1")] {
        let mut nodes: Vec<u32> = first.node_sets[face].iter().map(|n| second[*n as usize]).collect();
        nodes.sort_unstable();
        mesh.set_nodes(set, nodes).unwrap();
    }
    mesh
}

#[test]
fn a_piece_that_hangs_by_an_edge_or_a_corner_is_refused_and_one_that_is_held_or_joined_by_facets_is_not() {
    let weight = "[loads]\ngravity_m_per_s2 = [0.0, 1.0, 0.0]\ndensity_kg_per_m3 = 100.0\n";
    let solved = |mesh: &TetMesh, text: &str| simulate(mesh, &Scenario::from_toml(text).unwrap(), &|_| ()).unwrap();
    let held = format!("fixed = ['held']\n{GREY}{weight}");
    assert!(solved(&touching([10.0, 0.0, 0.0]), &held).warnings.is_empty(), "whole facets");
    for apart in [[10.0, 10.0, 0.0], [10.0, 10.0, 10.0]] {
        let mesh = touching(apart);
        for element in ["tet4", "tet4-nodal", "tet10"] {
            let (error, message) = refusal(&mesh, &format!("{held}[solver]\nelement = '{element}'\n"));
            assert!(matches!(error, FemError::Hinged { cells: 48, cell: 48 }), "{error}");
            assert!(message.contains("an edge or a corner") && message.contains("`fixed`"), "{message}");
        }
        for own in ["fixed = ['held', 'x']\n", "fixed = ['held']\n[[tethers]]\nset = 'x'\nstiffness_pa_per_mm = 50.0\n"]
        {
            assert!(solved(&mesh, &format!("{own}{GREY}{weight}")).warnings.is_empty(), "{own}");
        }
    }
    // A wall stops it where it is pulled against one, which is told.
    let wall = "[[contact]]\nset = 'y'\nwall = { shape = 'own-surface' }\n";
    let found = solved(&touching([10.0, 10.0, 0.0]), &format!("fixed = ['held']\n{wall}{GREY}{weight}"));
    assert_eq!(found.warnings, [FemWarning::Hinged { cells: 48, cell: 48 }]);
    assert!(found.contact[0].force_n[1] < 0.0, "{:?}", found.contact);
    // Motions have their mass to hold on to.
    let moving = format!("{held}[solver]\nmethod = 'backward-euler'\n[dynamics]\nsteps = 2\n");
    assert!(solved(&touching([10.0, 10.0, 0.0]), &moving).motion.is_some());
}

#[test]
fn labels_without_name_or_material_are_refused() {
    let mesh = two_tissue_cube(2, 10.0);
    let (error, message) = refusal(&mesh, &format!("fixed = ['z0']\n{GREY}"));
    assert!(matches!(error, FemError::NoMaterial { .. }));
    assert!(message.contains("[materials.white_matter]"), "{message}");
    let (error, message) = refusal(&mesh, &format!("fixed = ['z0']\n{GREY}[labels]\nwhite_matter = 7\n"));
    assert!(matches!(error, FemError::UnnamedLabel { label: 3, .. }), "{message}");
    let strange = GREY.replace("grey_matter", "gray");
    assert!(matches!(refusal(&mesh, &format!("fixed = ['z0']\n{strange}")).0, FemError::UnknownLabel { .. }));
}

#[test]
fn bad_numbers_are_refused_by_key() {
    let mesh = cube(1, 10.0);
    for (from, to, key) in [
        ("1000.0", "-5.0", "shear_modulus_pa"),
        ("0.45", "0.5", "poisson_ratio"),
        ("1000.0", "nan", "shear_modulus_pa"),
    ] {
        let (error, message) = refusal(&mesh, &format!("fixed = ['z0']\n{}", GREY.replace(from, to)));
        assert!(matches!(error, FemError::Material { .. }));
        assert!(message.contains(key) && message.contains("grey_matter"), "{message}");
    }
    let density = format!("fixed = ['z0']\n{GREY}[loads]\ndensity_kg_per_m3 = -1.0");
    assert!(refusal(&mesh, &density).1.contains("density_kg_per_m3"));
}

#[test]
fn a_set_is_not_held_in_two_ways_at_once() {
    let mesh = cube(2, 10.0);
    let (error, message) = refusal(&mesh, &format!("fixed = ['z0', 'x0']\n[supports]\nx0 = 'sliding'\n{GREY}"));
    assert!(matches!(error, FemError::TwoSupports { .. }) && message.contains("`x0`"), "{message}");
    let moved = "[[prescribed]]\nset = 'z0'\ndisplacement_mm = [0, 0, 1]\n";
    let (error, message) = refusal(&mesh, &format!("fixed = ['z0']\n{moved}{GREY}"));
    assert!(matches!(error, FemError::TwoSupports { .. }) && message.contains("`prescribed`"), "{message}");
}

#[test]
fn a_node_is_not_moved_to_two_places_and_one_that_is_held_all_the_same_is_told() {
    let mesh = cube(2, 10.0);
    let moved = |set: &str, x: f64, z: bool| {
        format!("[[prescribed]]\nset = '{set}'\ndisplacement_mm = [{x}, 0, 0]\ncomponents = [true, false, {z}]\n")
    };
    let none = moved("x1", 1.0, false).replace("true", "false");
    assert!(refusal(&mesh, &format!("fixed = ['z0']\n{none}{GREY}")).1.contains("moves no component"));
    let pair = |second: &str| format!("fixed = ['z0']\n{}{second}{GREY}", moved("x1", 1.0, false));
    let (error, message) = refusal(&mesh, &pair(&moved("y1", 2.0, false)));
    assert!(matches!(error, FemError::TwoMovements { .. }), "{error:?}");
    assert!(message.contains("`x1` and `y1`") && message.contains("take these nodes out"), "{message}");
    // To the same place, or along other axes, is no contradiction.
    let solved = |text: &str| simulate(&mesh, &Scenario::from_toml(text).unwrap(), &|_| ()).unwrap();
    solved(&pair(&moved("y1", 1.0, true)));
    // Three of the nine nodes of a face are on the edge of the one that is held.
    let held = solved(&pair("")).warnings;
    assert_eq!(held, [FemWarning::StaysHeld { set: "x1".to_owned(), nodes: 3, of: 9 }]);
}

#[test]
fn what_acts_on_held_nodes_alone_is_said_to_have_no_effect() {
    let mesh = cube(2, 10.0);
    let weight = "[loads]\ngravity_m_per_s2 = [0, 0, -9.81]\n";
    let solved = |text: &str| simulate(&mesh, &Scenario::from_toml(text).unwrap(), &|_| ()).unwrap();
    let alone = solved(&format!("fixed = ['z0']\n{GREY}{weight}"));
    assert!(alone.warnings.is_empty(), "{:?}", alone.warnings);
    for (more, idle) in [
        ("[[contact]]\nset = 'z0'\nwall = { shape = 'own-surface' }\n", Idle::Contact),
        ("[[tethers]]\nset = 'z0'\nstiffness_pa_per_mm = 50.0\n", Idle::Tether),
        ("[[loads.pressure]]\nset = 'z0'\npressure_pa = 500.0\n", Idle::Pressure),
        ("[[loads.patch]]\nset = 'z0'\nforce_n = [0, 0, -1]\n", Idle::Patch),
    ] {
        let (before, after) = if more.contains("loads") { ("", more) } else { (more, "") };
        let found = solved(&format!("fixed = ['z0']\n{before}{GREY}{weight}{after}"));
        assert_eq!(found.warnings, [FemWarning::NoEffect { set: "z0".to_owned(), idle }]);
        assert_eq!(found.displacement_mm, alone.displacement_mm);
    }
    // A neighbour that shares only an edge with what is held is free.
    let beside = format!("fixed = ['z0']\n{GREY}{weight}[[loads.pressure]]\nset = 'x0'\npressure_pa = 5.0\n");
    assert!(solved(&beside).warnings.is_empty());
}

#[test]
fn a_fluid_has_a_weight_and_tissue_that_floats_in_it_is_pointed_out() {
    let mesh = cube(2, 10.0);
    let text = |tissue: f64, fluid: f64| {
        format!(
            "fixed = ['z0']\n{GREY}[loads]\ngravity_m_per_s2 = [0, 0, -9.81]\ndensity_kg_per_m3 = {tissue}\n\
             csf = {{ density_kg_per_m3 = {fluid}, level_mm = 5.0 }}\n"
        )
    };
    for none in [0.0, -1007.0] {
        assert!(refusal(&mesh, &text(1040.0, none)).1.contains("`loads.csf.density_kg_per_m3`"));
    }
    let floats = |tissue: f64| {
        let found = simulate(&mesh, &Scenario::from_toml(&text(tissue, 1007.0)).unwrap(), &|_| ()).unwrap();
        found.warnings.iter().any(|w| matches!(w, FemWarning::LighterThanFluid { .. }))
    };
    assert!(floats(100.0) && floats(300.0) && !floats(1040.0));
}

#[test]
fn a_plane_before_which_nothing_lies_is_named_for_what_it_is() {
    let mesh = cube(2, 10.0);
    let wall = |z: f64, up: f64| {
        format!(
            "fixed = ['z0']\n[[contact]]\nset = 'z1'\nwall = {{ shape = 'plane', point_mm = [0, 0, {z}], \
             normal = [0, 0, {up}] }}\n{GREY}"
        )
    };
    let (error, message) = refusal(&mesh, &wall(200.0, 1.0));
    assert!(matches!(error, FemError::BeyondWall { .. }) && message.contains("`wall.normal`"), "{message}");
    assert!(message.contains("190.0 mm"), "{message}");
    // Flush with the face that it looks away from it would pull the body through itself, and so a hair within it.
    for z in [10.0, 9.9999] {
        let (error, message) = refusal(&mesh, &wall(z, 1.0));
        assert!(matches!(error, FemError::BeyondWall { .. }) && message.contains("at or beyond"), "{message}");
        assert!(message.contains("by 0.0 mm"), "{message}");
    }
    // Turned round it is far away, and a plane a little into the body presses it.
    for (z, up) in [(200.0, -1.0), (10.0, -1.0), (9.9, -1.0)] {
        assert!(simulate(&mesh, &Scenario::from_toml(&wall(z, up)).unwrap(), &|_| ()).is_ok());
    }
}

#[test]
fn springs_that_give_way_by_more_than_the_body_hold_nothing() {
    let mesh = cube(2, 10.0);
    let text = |stiffness: f64| {
        format!(
            "[[tethers]]\nset = 'surface'\nstiffness_pa_per_mm = {stiffness:e}\n{GREY}[loads]\n\
             gravity_m_per_s2 = [0, 0, -9.81]\ndensity_kg_per_m3 = 100.0\n"
        )
    };
    let (error, message) = refusal(&mesh, &text(1e-12));
    assert!(matches!(error, FemError::WeakSprings { .. }) && message.contains("`tethers."), "{message}");
    assert!(simulate(&mesh, &Scenario::from_toml(&text(50.0)).unwrap(), &|_| ()).is_ok());
    // Weak springs beside what is held are weak springs.
    assert!(
        simulate(&mesh, &Scenario::from_toml(&format!("fixed = ['z0']\n{}", text(1e-12))).unwrap(), &|_| ()).is_ok()
    );
}
